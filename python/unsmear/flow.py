"""Optical flow of an image sequence: one call, several methods."""

from __future__ import annotations

import operator
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import _coarse_to_fine, _unsmear
from unsmear._arrays import as_grey_frames
from unsmear._parameters import PARAMETERS, merged
from unsmear._progress import of_steps
from unsmear.plot import _notebook

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from unsmear._progress import Progress

__all__ = ["FlowResult", "optical_flow"]

_COARSE_TO_FINE = ("fast", "balanced", "accurate", "steady", "steady-accurate")
_LEAST_FRAMES = {"least-squares": 2, "fleet-jepson": 3, "thesis": 2}


@dataclass(frozen=True)
class FlowResult:
    """Flow of one frame and how far to trust it.

    Attributes
    ----------
    flow : ndarray of shape (H, W, 2), float32
        ``(u, v)``, right and down, px/frame, from the reference frame to the next; NaN
        where nothing is known.
    confidence : ndarray of shape (H, W), float32
        In [0, 1]; 0 where the flow is unknown.
    valid : ndarray of shape (H, W), bool
        Where the flow is known.
    report : dict
        Method, parameters, frames used, timings and warnings: plain data that
        ``json.dumps`` takes, enough to repeat the result.
    """

    flow: NDArray[np.float32]
    confidence: NDArray[np.float32]
    valid: NDArray[np.bool_]
    report: dict[str, Any] = field(repr=False)

    def _repr_html_(self) -> str:
        return _notebook.flow_html(self.flow, self.confidence, self.report)


def optical_flow(
    frames: ArrayLike,
    *,
    index: int | None = None,
    method: str = "balanced",
    mask: ArrayLike | None = None,
    channel_axis: int | None = None,
    progress: Progress | None = None,
    **parameters: Any,
) -> FlowResult:
    r"""Measure the motion of every pixel of one frame.

    Every method filters the frames with Gabor filters and follows surfaces of constant
    phase, ``grad phi . (u, v, 1) = 0``; phase does not change with brightness and
    contrast, so neither does the result. Where the light of the frames differs, the
    coarse-to-fine methods bring them to the light of the reference first (gain, tone,
    shading down to periods of 100 px), and leave out of all what one could not record
    for saturation.

    Parameters
    ----------
    frames : array_like of shape (T, H, W)
        Integers or floats of any scale; the input is not modified and must not be
        during the call. Colour sequences need ``channel_axis``.
    index : int, optional
        Frame whose motion (to the next frame) is measured; default ``(T - 1) // 2``.
        Negative values count from the end. "thesis" pools all frames and ignores it.
    method : str, default "balanced"
        - "balanced": two frames, ``index`` and the next, over a pyramid with
          edge-preserving smoothness; any speed, every pixel. The default because it is
          accurate on all kinds of scenes and takes a fraction of a second.
        - "fast": the same, stopped at half the resolution; a quarter of the time.
        - "accurate": the same with finer steps of the pyramid; twice the time.
        - "steady": up to 3 frames on each side, for motion that is constant over them;
          where it is not (measured, not assumed) the result is that of two frames.
        - "steady-accurate": the same with the finer steps of "accurate"; for several
          frames what "accurate" is for two.
        - "least-squares": phase differences of neighbouring frames, local least squares
          at one scale; 2 frames are enough, about 7 are best, motion up to 4 px/frame.
        - "fleet-jepson": 22 velocity-tuned filters and local affine least squares; 3
          frames at least, 15 fill its windows. More exact, and silent (NaN) where its
          tests fail, often on half of a picture.
        - "thesis": the founding method, flaws included (speeds come out at a tenth to a
          fifth of the truth); for comparison with published figures only.
    mask : array_like of bool, shape (H, W), optional
        Pixels of all frames that may be used. Pixels outside take no part, nor do
        samples that are NaN or infinite; their flow is that of their surroundings, or
        NaN where these tell nothing. Coarse-to-fine methods only.
    channel_axis : int, optional
        Axis of the 3 colour channels; they are reduced to Rec. 601 luma, and the
        coarse-to-fine methods let their edges break the flow. A shape never decides:
        without it, frames have three axes.
    progress : callable, optional
        Called with the share done in [0, 1]; an exception it raises cancels the call.
    **parameters
        Parameters of the method.

        "balanced" (others below): ``pyramid_factor=0.5`` (ratio of the sizes of
        levels), ``coarsest_side=16.0`` (px: shorter side of the smallest level),
        ``finest_level=0`` (levels left out at the fine end), ``warps=6`` and
        ``finest_warps=2`` (refinements per level and on the finest, where most is
        known already), ``passes=2`` and ``sweeps=10`` (rounds of reweighting per warp
        and of the solver per round; more changes the error by less than 1 %),
        ``smoothness=0.11`` (weight against the data; more for noise, less for fine
        detail), ``edge_sensitivity=2.0`` (how far edges of the picture let the flow
        break; 0 not at all), ``strongest_channel=False`` (edges by the channel that
        shows them best, not the rms of all), ``residual_scale=1.0`` (rad: where a
        constraint loses half its weight), ``precision_scale=0.3`` (rad: data around
        which residuals are smaller count more, by the inverse of their square, so that
        smooth patterns are followed; 0 leaves it out), ``tau=1.25`` (deviations off the
        tuned frequency where weights halve), ``amplitude_fraction=0.05`` (of the rms
        amplitude) plus ``amplitude_floor=0.2`` (where weights halve; grey levels of a
        picture with a standard deviation of 64), ``median_radius=5`` (px, of the
        weighted median at motion boundaries; 0 leaves it out), ``guide_sigma=10.0``
        (grey levels it tolerates), ``frames_each_side=0`` (0: two frames),
        ``choose_frames=False`` (fall back to two frames where more disagree),
        ``adapt_to_noise=True`` (smooth more and trust edges less in a noisy picture),
        ``static_evidence=True`` (hold still what the frames show to rest),
        ``forward_backward=False`` (lower the confidence where the flow of the reversed
        frames does not lead back: ranks errors 2 % better at twice the time).

        "fast" differs by ``finest_level=1``, ``warps=4``, ``finest_warps=3``,
        ``smoothness=0.1``;
        "accurate" by ``pyramid_factor=0.75``, ``warps=3``, ``passes=3``, ``sweeps=15``,
        ``smoothness=0.13``, ``edge_sensitivity=2.5``, ``strongest_channel=True``,
        ``residual_scale=0.7``, ``precision_scale=0.25``; "steady" by
        ``smoothness=0.088``, ``edge_sensitivity=1.0``, ``residual_scale=0.5``,
        ``frames_each_side=3``, ``choose_frames=True``; "steady-accurate" from
        "accurate" by ``smoothness=0.104``, ``edge_sensitivity=1.25``,
        ``residual_scale=0.35`` and the frames of "steady".

        The others have ``tuning_frequency`` (cycles/px, in (0, 0.5)) and
        ``bandwidth_octaves``.

        "least-squares": ``tuning_frequency=0.12`` (sees half a wavelength, 4.2 px),
        ``bandwidth_octaves=0.8``, ``orientations=6``, ``support=3.0`` (deviations of
        the filters' window), ``amplitude_fraction=0.02`` (of the largest amplitude:
        where weights halve), ``tau=1.25`` (deviations from the tuned frequency, where
        weights halve), ``neighbourhood=4.0`` (px, deviation of the local window; 0
        solves each pixel alone), ``time_sigma=1.5`` (frames), ``robust=0.5`` (rad),
        ``passes=2``, ``least_eigenvalue=1e-3``, ``border="replicate"``.

        "fleet-jepson": ``tuning_frequency=1/4.25``, ``bandwidth_octaves=0.8``,
        ``support=3.0``, ``amplitude_fraction=0.05`` and ``tau=1.25`` (hard tests),
        ``window_radius=2`` (px), ``least_constraints=12``, ``condition_limit=8.0``,
        ``residual_limit=0.05`` (px/frame), ``border="replicate"``.

        "thesis": ``tuning_frequency=0.06``, ``bandwidth_octaves=0.8``,
        ``zero_static="none"`` (or "velocity", "image+velocity"), ``interpolate=False``
        (doubles the picture; velocities stay in half pixels, as published),
        ``std_limit=5.0``, ``distance_limit=2.0``, ``least_fraction=10/12``.

    Returns
    -------
    FlowResult
        ``flow``, ``confidence``, ``valid`` and ``report``. The coarse-to-fine methods'
        confidence falls where the frames differ along the flow, where the flow or its
        scales disagree (motion boundaries), and where the picture is flat or has one
        direction only; the flow is NaN where no scale sees anything.
        ``report["levels"]`` tells what happened at each level, coarsest first: frames
        used, size, ``changes`` (mean change by each warp, px of the level: where they
        do not fall the motion was not found at that scale), mean ``evidence`` (1 on
        texture, 0 where flat) and pull to ``rest``; "steady" lists two frames first.

    Raises
    ------
    ValueError
        Too few frames or too small, ``index`` out of range, samples that are not
        finite (unless the method is coarse-to-fine), ``mask`` of another shape or for
        another method, an unknown method or parameter, or a value out of range.
    TypeError
        ``frames`` are not real numbers, or ``index`` or a parameter has the wrong type.

    References
    ----------
    .. [1] D. J. Fleet, A. D. Jepson, "Computation of component image velocity from
       local phase information", IJCV 5 (1990) 77-104, doi:10.1007/BF00056772
    .. [2] C. Texin, "Optical Flow Using Phase Information for Deblurring", MIT MEng
       thesis, 2007 ("thesis")

    Examples
    --------
    >>> import numpy as np, unsmear
    >>> sequence = unsmear.synthetic.translation(
    ...     unsmear.synthetic.texture((96, 96), seed=1), (1.5, -0.5), shape=(64, 64))
    >>> r = unsmear.optical_flow(sequence.sharp)
    >>> np.nanmedian(r.flow, axis=(0, 1)).round(1).tolist()
    [1.5, -0.5]
    """
    values = merged(method, parameters)
    started = time.perf_counter()
    if method in _COARSE_TO_FINE:
        flow, confidence, shape, reference, levels = _coarse_to_fine.estimate(
            frames,
            channel_axis,
            lambda count: reference_frame(index, count),
            mask,
            values,
            of_steps(progress),
            method,
        )
    else:
        if mask is not None:
            known = ", ".join(repr(name) for name in _COARSE_TO_FINE)
            msg = f"mask must be None for method {method!r}; it works with {known}"
            raise ValueError(msg)
        grey = as_grey_frames(frames, channel_axis, np.float64)
        least = _LEAST_FRAMES[method]
        if grey.shape[0] < least or 0 in grey.shape:
            msg = (
                f"frames must have shape (T >= {least}, H >= 1, W >= 1) for method "
                f"{method!r}, got {np.shape(frames)}"
            )
            raise ValueError(msg)
        reference = reference_frame(index, grey.shape[0])
        flow, confidence = _run(method, grey, reference, values, progress)
        shape, levels = list(grey.shape), []
    # A reduction over two samples takes ten times as long.
    valid = ~(np.isnan(flow[..., 0]) | np.isnan(flow[..., 1]))
    return FlowResult(
        flow=flow,
        confidence=confidence,
        valid=valid,
        report={
            "method": method,
            "parameters": values,
            "frames": shape,
            "index": reference,
            "density": np.count_nonzero(valid) / valid.size,
            "seconds": time.perf_counter() - started,
            "threads": _unsmear.get_num_threads(),
            "version": _unsmear.__version__,
            "levels": levels,
            "warnings": [] if valid.any() else ["nothing to measure motion on"],
        },
    )


def reference_frame(index: int | None, count: int) -> int:
    """Return the index of the reference frame, counted from the start."""
    if index is None:
        return (count - 1) // 2
    try:
        position = operator.index(index)
    except TypeError:
        msg = f"index must be an integer, got {type(index).__name__} {index!r}"
        raise TypeError(msg) from None
    if not -count <= position < count:
        msg = f"index must be in {-count}..{count - 1}, got {position}"
        raise ValueError(msg)
    return position % count


def _run(
    method: str,
    grey: NDArray[np.float64],
    index: int,
    values: dict[str, Any],
    progress: Progress | None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    steps = of_steps(progress)
    if method == "thesis":
        if not np.isfinite(grey).all():
            msg = "frames must be finite everywhere for method 'thesis'"
            raise ValueError(msg)
        exact = _unsmear.thesis_flow(grey, values, progress=steps)
        known = np.asarray(~np.isnan(exact).any(axis=-1))
        # The founding method has no measure of trust: known or not.
        return exact.astype(np.float32), known.astype(np.float32)
    if method == "least-squares":
        return _unsmear.least_squares(grey, index, values, progress=steps)
    return _unsmear.fleet_jepson(grey, index, values, progress=steps)


assert {*_LEAST_FRAMES, *_COARSE_TO_FINE} == set(PARAMETERS), "every method is here"
