"""Blurred clips in, sharp clips out, no parameter needed."""

from __future__ import annotations

import operator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import _unsmear
from unsmear._parameters import merged
from unsmear.plot import _notebook
from unsmear.restoration.alternatives import Alternatives
from unsmear.restoration.passes import Passes
from unsmear.restoration.records import Settings
from unsmear.restoration.source import Source

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import ArrayLike, NDArray

    from unsmear._progress import Progress

__all__ = ["SequenceResult", "deblur_sequence", "restored_frames"]

FLOW_METHODS = ("fast", "balanced", "accurate")
JOINT = (1, 3)


@dataclass(frozen=True)
class SequenceResult:
    """A restored clip and how it was made.

    Attributes
    ----------
    frames : ndarray of shape (N, H, W) or like the frames given
        The frames asked for, restored; like the input in type and range.
    flows : ndarray of shape (N, H, W, 2), float32
        Velocity at mid-exposure of each, px/frame; NaN = unknown, and in black bars.
    reports : list of dict
        One per frame, plain data: exposure and the trust in it, noise, strength of
        the prior, the verdict in words (``verdict``, ``expected_gain_db``,
        ``ringing_risk``), per moving region too, widths of black ``bars`` (px), how far
        odd lines lie below their place (``line_pairing``, px), and all parameters.
    """

    frames: NDArray[Any]
    flows: NDArray[np.float32]
    reports: list[dict[str, Any]] = field(repr=False)

    def _repr_html_(self) -> str:
        return _notebook.clip_html(self.frames, self.flows, self.reports)


def deblur_sequence(
    frames: ArrayLike,
    *,
    exposure: float | str = "auto",
    indices: Sequence[int] | None = None,
    flow_method: str = "balanced",
    joint: int = 3,
    second_pass: bool | None = None,
    noise: float | None = None,
    seed: int = 0,
    channel_axis: int | None = None,
    progress: Progress | None = None,
    **flow_parameters: Any,
) -> SequenceResult:
    r"""Restore the frames of a blurred clip.

    For every frame: flow to both neighbours, from it velocity and acceleration; how
    long the shutter was open, from the spectra of the blur; a restoration whose
    strength is chosen by how well restored neighbours agree; and a verdict, region by
    region, by which what would not get better is returned as it came.

    Parameters
    ----------
    frames : array_like of shape (T, H, W), or colour with ``channel_axis``
        T >= 2 frames, time first. Integers of any depth, floats of any scale; not
        modified.
    exposure : "auto" or float, default "auto"
        Share of the frame interval during which the shutter was open; > 0.
    indices : sequence of int, optional
        Frames to restore, counted from the start, or from the end if negative.
        Default: all.
    flow_method : {"balanced", "fast", "accurate"}
        See `unsmear.optical_flow`, which takes ``flow_parameters``.
    joint : {3, 1}, default 3
        Frames restored together: 3 uses the neighbours' data too. Frames blurred alike
        come out 1 to 4 dB better, frames blurred in different directions more (4.7 dB
        where their blur is known), and with less flicker than as they came; in about
        twice the time. Frames whose exposure is not sure, or that are blurred by less
        than about 3 px, are restored by themselves, as are all by 1.
    second_pass : bool, optional
        Measure flow again on restored frames, up to three passes in all, as long as
        restored frames agree better. Default: for frames whose acceleration exceeds a
        quarter of their velocity, where blur differs between frames.
    noise : float, optional
        Standard deviation of the noise in the units of ``frames``. Default: measured.
    seed : int, default 0
        Of the random choices in the search for the exposure.
    channel_axis : int, optional
        Axis of 1 or 3 colour channels. Default: grey.
    progress : callable, optional
        Called with the share done in [0, 1]; an exception it raises cancels the call.
    **flow_parameters
        Parameters of the flow method.

    Returns
    -------
    SequenceResult

    Raises
    ------
    ValueError
        Fewer than 2 frames, a shape, an index or a parameter out of range.
    TypeError
        If ``frames`` are not real numbers, or a parameter has the wrong type.

    Notes
    -----
    A frame is :math:`b = \int_{-1/2}^{1/2} x(p + D(t)) dt` with
    :math:`D = -t s v + t^2 s^2 (2 (v \cdot \nabla) v - A) / 2`, velocity
    :math:`v = (f - g)/2` and acceleration :math:`A = f + g` from the flows f, g to
    both neighbours, s the exposure. x minimises
    :math:`\frac12 \sum_n w_n \rho(A_n x - b_n) + \lambda R(x)` over the frames n that
    are restored together.

    Needs motion between 1 px and a tenth of the picture per frame. Blur that is not
    motion (focus), rolling shutters and strong compression are not modelled: the
    verdict then leaves frames as they are, or should. Black bars are no picture: they
    come back as they were, and so does ground at rest beside what moves. Lines of
    interlaced frames that lie closer in pairs than they should are restored, and shown,
    where they lie. White samples of integer frames may have been brighter than they
    could say; where a restoration shows that they were not, they are white.

    References
    ----------
    L. I. Rudin, S. Osher, E. Fatemi, Physica D 60 (1992) 259-268,
    doi:10.1016/0167-2789(92)90242-F. P. Whittle, J. R. Stat. Soc. B 15 (1953) 125-139,
    doi:10.1111/j.2517-6161.1953.tb00131.x.

    Examples
    --------
    >>> import unsmear
    >>> texture = unsmear.synthetic.texture((200, 200), seed=3)
    >>> clip = unsmear.synthetic.translation(
    ...     texture, (8.0, 3.0), shape=(128, 128), exposure=0.8, n_frames=3, bits=8)
    >>> restored = unsmear.deblur_sequence(clip.blurred, indices=[1])
    >>> gain = (unsmear.metrics.psnr(restored.frames[0], clip.sharp[1])
    ...         - unsmear.metrics.psnr(clip.blurred[1], clip.sharp[1]))
    >>> bool(gain > 3)
    True
    """
    source = Source(frames, channel_axis)
    wanted = _wanted(indices, source.count)
    pictures, flows, reports = [], [], []
    settings = settings_of(
        exposure, noise, flow_method, flow_parameters, joint, seed, source.scale
    )
    for done, (picture, flow, report) in enumerate(
        restored_frames(source, wanted, settings, second_pass=second_pass), start=1
    ):
        pictures.append(picture)
        flows.append(flow)
        reports.append(report)
        if progress is not None:
            progress(done / len(wanted))
    return SequenceResult(np.stack(pictures), np.stack(flows), reports)


def restored_frames(
    source: Source,
    wanted: list[int],
    settings: Settings,
    *,
    second_pass: bool | None = None,
) -> Iterator[tuple[NDArray[Any], NDArray[np.float32], dict[str, Any]]]:
    """Yield frames one by one, each with its velocity and report.

    Keeps what a window of about twenty frames needs, however long the clip is.
    """
    passes = Passes(source, settings)
    others = Alternatives(source, settings)
    for index in wanted:
        result, chain, number = passes.best(index, second_pass)
        if result.report["exposure_status"] == "unsure":
            result, chain = others.best(index, result, chain)
        result = chain.joined(index) if result.changed.any() else result
        picture = source.as_came(result.planes, index, result.changed)
        hidden = source.bars(index)
        report = result.report | {
            "bars": hidden._asdict(),
            "passes": number,
            "joint": settings.joint,
            "flow_method": settings.flow_method,
            "flow_parameters": settings.flow_options,
            "seed": settings.seed,
            "version": _unsmear.__version__,
        }
        velocity = chain.motion.motion(index).velocity.copy()
        hidden.hide(np.moveaxis(velocity, -1, 0))
        yield picture, velocity, report
        passes.forget_before(index)
        others.forget_before(index)


def settings_of(
    exposure: float | str,
    noise: float | None,
    flow_method: str,
    flow_parameters: dict[str, Any],
    joint: int,
    seed: int,
    scale: float,
) -> Settings:
    given = None
    if exposure != "auto":
        try:
            given = float(exposure)
        except ValueError:
            msg = f"exposure must be 'auto' or a number > 0, got {exposure!r}"
            raise ValueError(msg) from None
        if not (np.isfinite(given) and given > 0):
            msg = f"exposure must be 'auto' or a number > 0, got {exposure!r}"
            raise ValueError(msg)
    if flow_method not in FLOW_METHODS:
        names = ", ".join(repr(name) for name in FLOW_METHODS)
        msg = f"flow_method must be one of {names}, got {flow_method!r}"
        raise ValueError(msg)
    merged(flow_method, flow_parameters)
    if joint not in JOINT:
        msg = f"joint must be 1 or 3, got {joint!r}"
        raise ValueError(msg)
    if noise is not None and not (np.isfinite(noise) and noise >= 0):
        msg = f"noise must be finite and not negative, got {noise}"
        raise ValueError(msg)
    return Settings(
        exposure=given,
        noise=None if noise is None else float(noise) * scale,
        flow_method=flow_method,
        flow_options=dict(flow_parameters),
        joint=joint,
        seed=operator.index(seed),
    )


def _wanted(indices: Sequence[int] | None, count: int) -> list[int]:
    if indices is None:
        return list(range(count))
    wanted = [operator.index(index) for index in indices]
    for index in wanted:
        if not -count <= index < count:
            msg = f"indices must be in {-count}..{count - 1}, got {index}"
            raise ValueError(msg)
    if not wanted:
        msg = "indices must name at least one frame, got none"
        raise ValueError(msg)
    return [index % count for index in wanted]
