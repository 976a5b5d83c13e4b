"""Component velocities: what single filters see of the motion, before any choice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import _unsmear
from unsmear._arrays import as_grey_frames
from unsmear._parameters import COMPONENT_PARAMETERS, checked
from unsmear._progress import of_steps
from unsmear.flow import reference_frame

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from unsmear._progress import Progress, Steps

__all__ = ["ComponentVelocities", "component_velocities"]


@dataclass(frozen=True)
class ComponentVelocities:
    """Component velocities of one frame, filter by filter.

    Attributes
    ----------
    velocity : ndarray of shape (N, H, W, 2), float32
        Velocity along the phase gradient, px/frame (right, down); NaN where a test
        fails or there is no phase.
    phase_gradient : ndarray of shape (N, H, W, 3), float32
        ``(phi_x, phi_y, phi_t)``: rad/px, rad/px, rad/frame; NaN where the response
        is 0. Not tested.
    amplitude : ndarray of shape (N, H, W), float32
        Modulus of the responses, in the unit of the frames (integers scaled to [0, 1]).
    orientation : ndarray of shape (N,), float64
        Direction of each filter's wavevector against the x axis, rad; positive turns
        from right to down. In [0, pi), or (-pi, pi] for the velocity-tuned filters.
    frequency : ndarray of shape (N,), float64
        Length of each filter's wavevector, cycles/px.
    """

    velocity: NDArray[np.float32]
    phase_gradient: NDArray[np.float32]
    amplitude: NDArray[np.float32]
    orientation: NDArray[np.float64]
    frequency: NDArray[np.float64]


def component_velocities(
    frames: ArrayLike,
    *,
    index: int | None = None,
    channel_axis: int | None = None,
    progress: Progress | None = None,
    **parameters: Any,
) -> ComponentVelocities:
    r"""Measure the component (normal) velocities of one frame.

    A filter sees only the motion along its phase gradient,

    .. math:: v_n = -\phi_t \nabla\phi / |\nabla\phi|^2,

    believed where the amplitude is at least ``amplitude_fraction`` of the largest and
    the instantaneous frequency within ``tau / sigma`` of the tuned one. Two motions at
    a boundary or through a transparency show as two groups of components, which
    `several_motions` tells apart.

    Parameters
    ----------
    frames : array_like of shape (T, H, W)
        At least 2 (3 unless ``temporal="steps"``); integers are scaled by their range.
    index : int, optional
        Reference frame; default ``(T - 1) // 2``.
    channel_axis : int, optional
        Axis of the 3 colour channels.
    progress : callable, optional
        Called with the share done in [0, 1]; an exception it raises cancels the call.
    **parameters
        ``tuning_frequency=0.15`` (cycles/px; one, or several for as many scales: their
        filters follow one another in the result, in the order given),
        ``bandwidth_octaves=0.8`` (at one deviation of the spectrum),
        ``orientations=6`` (over 180 degrees), ``support=3.0`` (deviations of the
        window), ``amplitude_fraction=0.05`` (of the largest of its scale),
        ``tau=1.25``, ``border="replicate"`` ("reflect", "zero"), and ``temporal``:
        "steps" (default: mean phase difference to the neighbouring frames, exact for
        uniform shifts up to half a wavelength), "gaussian" (a window over many frames,
        no carrier: slow motion only) or "velocity-tuned" (22 filters over many frames,
        each of a range of motions: the sharpest eye for two motions in one place;
        ``orientations`` is then not used). ``least_steadiness=0.0``, of "steps" only:
        the harmonic agreement ``2 a0 a1 / (a0^2 + a1^2)`` that amplitudes of
        neighbouring frames must have. Two motions in one filter beat, and 0.95 sorts
        most of what they leave out, with half of the good; 0 tests nothing, right for
        one motion per neighbourhood.

    Returns
    -------
    ComponentVelocities

    Raises
    ------
    ValueError
        Too few frames, ``index`` without the neighbours it needs, samples that are not
        finite, or a parameter out of range.
    TypeError
        ``frames`` are not real numbers.

    References
    ----------
    .. [1] D. J. Fleet, A. D. Jepson, IJCV 5 (1990) 77-104, doi:10.1007/BF00056772

    Examples
    --------
    >>> import numpy as np, unsmear
    >>> frames = unsmear.synthetic.plane_wave((48, 48), (0.1, 0.0), velocity=(1.5, 0.0))
    >>> c = unsmear.component_velocities(frames, tuning_frequency=(0.1, 0.2))
    >>> c.velocity.shape, c.frequency.round(2).tolist()[::6]
    ((12, 48, 48, 2), [0.1, 0.2])
    >>> c.velocity[0, 24, 24].round(2).tolist()
    [1.5, 0.0]
    """
    scales = _scales(parameters)
    grey = as_grey_frames(frames, channel_axis, np.float64)
    if not np.isfinite(grey).all():
        msg = "frames must be finite everywhere"
        raise ValueError(msg)
    reference = reference_frame(index, grey.shape[0])
    # Without its mean a sequence keeps the digits of its contrast in single precision.
    centred = (grey - (grey.mean() if grey.size else 0.0)).astype(np.float32)
    steps = of_steps(progress)
    banks = [
        _unsmear.component_velocities(
            centred, reference, values, progress=_share(steps, number, len(scales))
        )
        for number, values in enumerate(scales)
    ]
    planes = np.concatenate([planes for planes, _ in banks], axis=1)
    k = np.concatenate([np.asarray(wavevectors) for _, wavevectors in banks])
    return ComponentVelocities(
        velocity=np.ascontiguousarray(np.moveaxis(planes[3:5], 0, -1)),
        phase_gradient=np.ascontiguousarray(np.moveaxis(planes[:3], 0, -1)),
        amplitude=np.ascontiguousarray(planes[5]),
        orientation=np.arctan2(k[:, 1], k[:, 0]),
        frequency=np.hypot(k[:, 0], k[:, 1]) / (2 * np.pi),
    )


def _scales(parameters: dict[str, Any]) -> list[dict[str, Any]]:
    """Parameters of the bank of each scale, names and types checked."""
    given: Any = parameters.get("tuning_frequency")
    if isinstance(given, str) or not isinstance(given, Sequence | np.ndarray):
        return [checked(parameters, COMPONENT_PARAMETERS, "component_velocities")]
    frequencies = list(given)
    if not frequencies:
        msg = "tuning_frequency must name at least one frequency, got none"
        raise ValueError(msg)
    return [
        checked(
            parameters | {"tuning_frequency": frequency},
            COMPONENT_PARAMETERS,
            "component_velocities",
        )
        for frequency in frequencies
    ]


def _share(steps: Steps | None, number: int, count: int) -> Steps | None:
    """Progress of one of several equal parts."""
    if steps is None:
        return None
    return lambda done, of: steps(number * of + done, count * of)
