"""The chain of `unsmear.deblur_sequence`, chunk by chunk in time.

What a restored frame depends on is a window of frames around it: exposures are pooled
over five frames, not over the clip, and each pass over a clip looks seven frames
farther (`restoration.chain`, `restoration.passes`). A chunk gets that window, and the
first frame of the clip, which alone decides the scale of floats. Its frames keep their
numbers, so that the ends of the clip and the random choices stay where they are. A
frame asked for beyond the window is an error, never a wrong result.

Over space nothing is local: flow is not, and the solver's scalar products are sums over
the whole frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from operator import getitem
from typing import TYPE_CHECKING, Any

import dask.array as da
import numpy as np
from dask import delayed
from dask.base import tokenize

from unsmear import _unsmear
from unsmear.dask.cores import share_cores
from unsmear.dask.parts import as_frames, block, clipped, joined, ranges_of
from unsmear.restoration.passes import reach
from unsmear.restoration.source import Source
from unsmear.sequence import restored_frames, settings_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Range = tuple[int, int]
    Restored = tuple[NDArray[Any], NDArray[np.float32], list[dict[str, Any]]]

__all__ = ["LazySequence", "deblur_sequence"]


@dataclass(frozen=True)
class LazySequence:
    """A clip to be restored.

    Attributes
    ----------
    frames : dask array like the frames given
        Restored.
    flows : dask array of shape (T, H, W, 2), float32
        Velocity at mid-exposure of each, px/frame; NaN = unknown.
    reports : dask.delayed.Delayed
        The list of the reports of all frames, as `unsmear.SequenceResult.reports`.
    """

    frames: Any
    flows: Any
    reports: Any


def deblur_sequence(
    frames: Any,
    *,
    exposure: float | str = "auto",
    flow_method: str = "balanced",
    joint: int = 3,
    second_pass: bool | None = None,
    noise: float | None = None,
    seed: int = 0,
    channel_axis: int | None = None,
    **flow_parameters: Any,
) -> LazySequence:
    """Restore the frames of a blurred clip, lazily.

    Parameters
    ----------
    frames : dask array of shape (T, H, W), or colour with ``channel_axis``
        T >= 2, time first; chunked in time as it suits, in space at will.
    exposure, flow_method, joint, second_pass, noise, seed, **flow_parameters
        As for `unsmear.deblur_sequence`.
    channel_axis : int, optional
        Axis of 1 or 3 colour channels. Default: grey.

    Returns
    -------
    LazySequence
        Frames, flows and reports of `unsmear.deblur_sequence`, bit for bit; chunked in
        time like ``frames``, whole in space. Compute them together,
        ``dask.compute(s.frames, s.reports)``, or the work is done twice.

    Raises
    ------
    TypeError
        If ``frames`` is no dask array of real numbers, or a parameter has the wrong
        type.
    ValueError
        Fewer than 2 frames, a shape or a parameter out of range.

    Notes
    -----
    A task holds its chunk and 7 frames on each side, 21 unless ``second_pass`` is
    False, one more unless ``joint`` is 1. Their motion and exposure are found again in
    every chunk that needs them, which for one pass costs as much as 7 frames more: a
    quarter for chunks of 30 frames, 7 % for chunks of 100.

    References
    ----------
    See `unsmear.deblur_sequence`.

    Examples
    --------
    >>> import dask, dask.array as da, unsmear, unsmear.dask
    >>> clip = unsmear.synthetic.translation(
    ...     unsmear.synthetic.texture((80, 80), seed=3), (5.0, 2.0), shape=(48, 48),
    ...     exposure=0.8, n_frames=4, bits=8).blurred
    >>> lazy = unsmear.dask.deblur_sequence(
    ...     da.from_array(clip, chunks=(2, -1, -1)), exposure=0.8, flow_method="fast")
    >>> whole = unsmear.deblur_sequence(clip, exposure=0.8, flow_method="fast")
    >>> bool((lazy.frames.compute() == whole.frames).all())
    True
    """
    given = {
        "exposure": exposure,
        "noise": noise,
        "flow_method": flow_method,
        "flow_parameters": flow_parameters,
        "joint": joint,
        "seed": seed,
    }
    settings_of(**given, scale=1.0)  # type: ignore[arg-type]
    stack = as_frames(frames, channel_axis, 2)
    count = stack.shape[0]
    halo = reach(second_pass, joint)
    token = tokenize(stack.name, given, second_pass, _unsmear.__version__)
    first = block(stack, (0, 1))
    made, sizes = [], []
    for part in ranges_of(stack.chunks[0]):
        seen = clipped(part, halo, halo, count)
        made.append(
            delayed(restored, pure=True)(
                block(stack, seen),
                first,
                seen[0],
                part,
                stack.shape,
                given,
                second_pass,
                dask_key_name=f"restored-{token}-{part[0]}",
            )
        )
        sizes.append(part[1] - part[0])

    def item(number: int, rest: tuple[int, ...], dtype: Any) -> Any:
        items = [
            delayed(getitem, pure=True)(
                one, number, dask_key_name=f"{one.key}-{number}"
            )
            for one in made
        ]
        return joined(items, [(n, *rest) for n in sizes], dtype)

    pictures = item(0, stack.shape[1:], stack.dtype.newbyteorder("="))
    if channel_axis is not None:
        pictures = da.moveaxis(pictures, -1, channel_axis)
    reports = delayed(together, pure=True)(
        [delayed(getitem, pure=True)(one, 2) for one in made],
        dask_key_name=f"reports-{token}",
    )
    return LazySequence(pictures, item(1, (*stack.shape[1:3], 2), np.float32), reports)


def together(parts: list[list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Return the reports of all chunks as one list."""
    return list(chain.from_iterable(parts))


class Window:
    """The frames of a clip (T, H, W, C) of which some are here, by their numbers."""

    def __init__(
        self,
        frames: NDArray[Any],
        first: NDArray[Any],
        start: int,
        shape: tuple[int, ...],
    ) -> None:
        self._frames = with_channels(frames, 4)
        self._first = with_channels(first, 4)[0]
        self._start = start
        self.shape = shape if len(shape) == 4 else (*shape, 1)
        self.dtype = frames.dtype

    def __getitem__(self, index: int, /) -> NDArray[Any]:
        """Return a frame (H, W, C)."""
        if self._start <= index < self._start + len(self._frames):
            return np.asarray(self._frames[index - self._start])
        if index == 0:
            return np.asarray(self._first)
        last = self._start + len(self._frames) - 1
        raise IndexError(f"frame must be in {self._start}..{last}, got {index}")


def with_channels(array: NDArray[Any], ndim: int) -> NDArray[Any]:
    """Return ``array`` with ``ndim`` axes, the last of them of channels."""
    return array if array.ndim == ndim else array[..., np.newaxis]


def restored(
    frames: NDArray[Any],
    first: NDArray[Any],
    start: int,
    wanted: Range,
    shape: tuple[int, ...],
    given: dict[str, Any],
    second_pass: bool | None,
) -> Restored:
    """Return restored frames, their velocities and reports.

    ``frames`` begin with number ``start`` of a clip of the ``shape`` given whose frame
    0 is ``first``; those from ``wanted[0]`` up to ``wanted[1]`` are restored.
    """
    share_cores()
    source = Source.read_when_needed(Window(frames, first, start, shape))
    pictures, flows, reports = [], [], []
    for picture, flow, report in restored_frames(
        source,
        list(range(*wanted)),
        settings_of(**given, scale=source.scale),
        second_pass=second_pass,
    ):
        pictures.append(with_channels(picture, len(shape) - 1))
        flows.append(flow)
        reports.append(report)
    return np.stack(pictures), np.stack(flows), reports
