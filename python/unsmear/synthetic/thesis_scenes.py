"""The nine scenes of the founding work, in kind.

C. Texin, "Optical Flow Using Phase Information for Deblurring", MIT MEng thesis, 2007,
chapter 5.1.1, tried its method on the Yosemite flight and on eight ray-traced sequences
made at Otago. These take their subjects and difficulties, nothing else; unlike there,
motion is also true inside areas without texture, and never beyond reason.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from unsmear.synthetic import outdoors, still_life
from unsmear.synthetic.sequence import Sequence, record

if TYPE_CHECKING:
    from collections.abc import Callable

    from unsmear.synthetic.ray_caster import World

__all__ = ["THESIS_SCENES", "sphere", "thesis_scene"]

THESIS_SCENES: dict[str, Callable[[tuple[int, int]], World]] = {
    "yosemite": outdoors.yosemite,
    "sphere": still_life.sphere,
    "office": still_life.office,
    "street": outdoors.street,
    "blocks": still_life.blocks,
    "vcbox": still_life.vcbox,
    "simple": still_life.simple,
    "medium": outdoors.medium,
    "complex": outdoors.complex_,
}
"""Name -> function of the picture's shape that returns the `World`."""


def thesis_scene(
    name: str, *, shape: tuple[int, int] = (192, 256), **options: Any
) -> Sequence:
    """Record one of the nine scenes.

    Parameters
    ----------
    name : str
        A key of ``THESIS_SCENES``: "yosemite", "sphere", "office", "street", "blocks",
        "vcbox", "simple", "medium" or "complex"; each function there says what moves
        and what makes it hard.
    shape : (int, int), default (192, 256)
        (H, W) of the picture; speeds in px grow with its width.
    **options
        Those of `record`: ``n_frames=3``, ``exposure=0.0``, ``n_subframes=64``,
        ``noise=0.0``, ``bits=None``, ``seed=0``.

    Returns
    -------
    Sequence

    Raises
    ------
    ValueError
        An unknown name, a shape without pixels, or an option out of range.

    Examples
    --------
    >>> from unsmear import synthetic
    >>> s = synthetic.thesis_scene("sphere", shape=(48, 64), n_frames=2)
    >>> s.sharp.shape, s.flow[0, 0, 0].tolist()
    ((2, 48, 64), [0.0, 0.0])
    """
    if name not in THESIS_SCENES:
        known = ", ".join(repr(scene) for scene in THESIS_SCENES)
        msg = f"name must be one of {known}, got {name!r}"
        raise ValueError(msg)
    return record(THESIS_SCENES[name](shape), **options)


def sphere(*, shape: tuple[int, int] = (192, 256), **options: Any) -> Sequence:
    """Record a checkered ball that turns in place: `thesis_scene` "sphere"."""
    return thesis_scene("sphere", shape=shape, **options)
