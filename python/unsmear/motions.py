r"""Several motions in one place: velocities on which component velocities agree.

A component with phase gradient :math:`(\phi_x, \phi_y, \phi_t)` allows all velocities
on a line of the plane of velocities; from velocity v that line is

.. math:: d(v) = |\phi_x u + \phi_y v + \phi_t| / \sqrt{\phi_x^2 + \phi_y^2}

px/frame away. Where one thing moves all lines meet in its velocity. At the edge of an
object, or through something transparent, there are two such points: this is what a
single flow vector cannot say.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from unsmear.component_velocity import ComponentVelocities

__all__ = ["Motion", "several_motions", "velocity_votes"]

# Lines that vote: an evenly spread sample; shares of a hundredth stand out of it.
_MOST_VOTERS = 3_000
# Least ratio of the eigenvalues of the normals' matrix: below it lines are parallel and
# meet nowhere in particular.
_LEAST_CROSSING = 0.05
_REFINEMENTS = 5


@dataclass(frozen=True)
class Motion:
    """A velocity on which components agree.

    Attributes
    ----------
    velocity : tuple of float
        (u, v), right and down, px/frame.
    share : float
        Of the components in question, how many pass within the tolerance.
    """

    velocity: tuple[float, float]
    share: float


def velocity_votes(
    components: ComponentVelocities,
    *,
    region: ArrayLike | None = None,
    tolerance: float = 0.15,
    reach: float | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    r"""Count, for each velocity, the component velocities that allow it.

    A line at distance d votes with :math:`\max(0, 1 - d^2/tolerance^2)`; of very many
    lines an even sample votes.

    Parameters
    ----------
    components : ComponentVelocities
        Of one frame; only those that passed their tests vote.
    region : array_like of bool, shape (H, W), optional
        Pixels that vote; default all.
    tolerance : float, default 0.15
        px/frame: about the error of a component velocity.
    reach : float, optional
        Largest \|u\| and \|v\|, px/frame; default what the coarsest filter can tell
        from one frame to the next, half its wavelength.

    Returns
    -------
    votes : ndarray of shape (M, M), float64
        Share of all components; rows v (downwards), columns u.
    axis : ndarray of shape (M,), float64
        Velocities of rows and columns, px/frame, ``tolerance / 2`` apart.

    Raises
    ------
    ValueError
        ``region`` of another shape, or a parameter that is not positive.
    """
    lines = _lines(components, region)
    axis = _axis(components, tolerance, reach)
    return _votes(lines, axis, tolerance), axis


def several_motions(
    components: ComponentVelocities,
    *,
    count: int = 2,
    region: ArrayLike | None = None,
    tolerance: float = 0.15,
    reach: float | None = None,
) -> list[Motion]:
    """Find the velocities on which most component velocities agree.

    The velocity with most votes is taken and refined by least squares; the components
    that agree with it are set aside, and the rest are asked again.

    Parameters
    ----------
    components : ComponentVelocities
        Of one frame. For two motions in one place (transparency) they should come from
        ``temporal="velocity-tuned"`` filters, or from several scales with
        ``least_steadiness=0.95``; see `component_velocities`.
    count : int, default 2
        Velocities wanted.
    region, tolerance, reach
        As in `velocity_votes`. A region of 20 to 30 px across holds enough components.

    Returns
    -------
    list of Motion
        At most ``count``, in the order found: fewer where the components left have all
        one direction, or there are none. A motion of its own has a share of the order
        of its area; what is left of a single motion has a few hundredths.

    Raises
    ------
    ValueError
        As `velocity_votes`, or ``count`` below 1.

    References
    ----------
    .. [1] D. J. Fleet, A. D. Jepson, IJCV 5 (1990) 77-104, doi:10.1007/BF00056772

    Examples
    --------
    >>> import numpy as np, unsmear
    >>> make = unsmear.synthetic
    >>> paint = [make.texture((120, 120), seed=n, exponent=0.6) for n in (1, 2)]
    >>> veil = make.layers(
    ...     *paint, np.full((120, 120), 0.5), shape=(64, 64), n_frames=15,
    ...     background_motion=make.translating((1.0, -0.5)),
    ...     foreground_motion=make.translating((-0.8, 0.9)))
    >>> c = unsmear.component_velocities(
    ...     veil.sharp, temporal="velocity-tuned", tuning_frequency=(0.25, 0.18))
    >>> seen = unsmear.several_motions(c)
    >>> sorted(tuple(round(x, 1) for x in motion.velocity) for motion in seen)
    [(-0.8, 0.9), (1.0, -0.5)]
    """
    if count < 1:
        msg = f"count must be >= 1, got {count}"
        raise ValueError(msg)
    lines = _lines(components, region)
    axis = _axis(components, tolerance, reach)
    total = len(lines)
    found: list[Motion] = []
    while len(lines) and len(found) < count:
        votes = _votes(lines, axis, tolerance)
        row, column = np.unravel_index(np.argmax(votes), votes.shape)
        velocity = _refined(lines, np.array([axis[column], axis[row]]), tolerance)
        if velocity is None:
            break
        agree = _distances(lines, velocity) <= tolerance
        found.append(
            Motion((float(velocity[0]), float(velocity[1])), float(agree.sum() / total))
        )
        lines = lines[~agree]
    return found


def _lines(
    components: ComponentVelocities, region: ArrayLike | None
) -> NDArray[np.float64]:
    """(n_x, n_y, offset) of the components that passed, n of length 1: (L, 3)."""
    valid = np.isfinite(components.velocity).all(axis=-1)
    if region is not None:
        mask = np.asarray(region)
        if mask.shape != valid.shape[1:] or mask.dtype != np.bool_:
            msg = (
                f"region must be bool of shape {valid.shape[1:]}, "
                f"got {mask.dtype} of shape {mask.shape}"
            )
            raise ValueError(msg)
        valid = valid & mask
    gradients = components.phase_gradient[valid].astype(np.float64)
    return np.asarray(gradients / np.hypot(gradients[:, 0], gradients[:, 1])[:, None])


def _axis(
    components: ComponentVelocities, tolerance: float, reach: float | None
) -> NDArray[np.float64]:
    far = 0.5 / float(components.frequency.min()) if reach is None else reach
    for name, value in (("tolerance", tolerance), ("reach", far)):
        if not 0 < value < np.inf:
            msg = f"{name} must be > 0 px/frame, got {value}"
            raise ValueError(msg)
    half = int(np.ceil(far / (tolerance / 2)))
    return np.linspace(-half, half, 2 * half + 1) * (tolerance / 2)


def _distances(
    lines: NDArray[np.float64], velocity: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.asarray(np.abs(lines[:, :2] @ velocity + lines[:, 2]))


def _votes(
    lines: NDArray[np.float64], axis: NDArray[np.float64], tolerance: float
) -> NDArray[np.float64]:
    votes = np.zeros((len(axis), len(axis)))
    if not len(lines):
        return votes
    voters = lines[:: -(-len(lines) // _MOST_VOTERS)] / tolerance
    along_u = voters[:, :1] * axis + voters[:, 2:]
    for row, v in zip(votes, axis, strict=True):
        squared = (along_u + voters[:, 1:2] * v) ** 2
        row[:] = np.maximum(0.0, 1.0 - squared).sum(axis=0)
    return votes / len(voters)


def _refined(
    lines: NDArray[np.float64], velocity: NDArray[np.float64], tolerance: float
) -> NDArray[np.float64] | None:
    """Least squares over the lines that agree; None where they do not cross."""
    for _ in range(_REFINEMENTS):
        near = lines[_distances(lines, velocity) <= tolerance]
        matrix = near[:, :2].T @ near[:, :2]
        smaller, larger = np.linalg.eigvalsh(matrix)
        if smaller <= _LEAST_CROSSING * larger:
            return None
        velocity = np.asarray(np.linalg.solve(matrix, -near[:, :2].T @ near[:, 2]))
    return velocity
