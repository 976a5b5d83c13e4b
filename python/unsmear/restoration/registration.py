r"""Displacements between restored frames, made as smooth as what displaces them.

Flow is right to a sixth of a pixel, erring otherwise at every place: half of what a
second frame could give to a joint restoration is lost by that. A camera displaces
smoothly, so the displacement d from I to J is sought as an affine field a plus a change
that is constant in a window G around each place p (a Gaussian of 16 px):

.. math:: \min_{e(p)} \sum_q G(p - q) \, w(q) \,
          [\nabla I(q) \cdot (a(q) + e(p) - d(q)) + J(q + d(q)) - I(q)]^2,

the Gauss-Newton step of B. D. Lucas and T. Kanade (Proc. 7th IJCAI, 1981, 674-679,
no DOI) from the flow d, which it replaces instead of adding to it. a is fitted to d,
robustly. w leaves out what is not seen in both, what differs in grey level, and what is
displaced otherwise than its window by more than a pixel: another body, whose
displacement, as that of all that is closer to such than the window resolves, stays the
flow. Units: px, grey levels.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear.restoration.sampling import pulled, smoothed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Plane = NDArray[np.float32]
    Field = NDArray[np.float32]

__all__ = ["affine_field", "settled"]

WINDOW = 16.0
"""Of 4, 8 and 16 px the best of four photographs: .15, .08 and .03 px are left."""
ROUNDS = 2
ALIKE = 9.0
"""Difference of restored frames, grey levels, that counts half."""
LARGEST_CHANGE = 1.0
"""Distance of flow from the smooth displacement, px, beyond which it is another's."""
RIDGE = 4.0
"""Power of the gradient, grey levels^2 per px^2, at which flow counts as much."""
FIT_ROUNDS = 6
LEAST_SCALE = 0.05
LEAST_SHARE = 0.02
"""Of a window that must be believed, or the flow stays."""


def settled(first: Plane, second: Plane, flow: Field, seen: Plane) -> Field:
    """Return the smooth displacement from ``first`` to ``second``.

    Parameters
    ----------
    first, second : ndarray of shape (H, W), float32
        Grey levels.
    flow : ndarray of shape (H, W, 2), float32
        From ``first`` to ``second``, right to a pixel; NaN = unknown.
    seen : ndarray of shape (H, W), float32
        How far each pixel of ``first`` is believed to be seen in ``second``, in [0, 1].

    Returns
    -------
    ndarray of shape (H, W, 2), float32
        NaN where ``flow`` is.
    """
    present = flow
    for _ in range(ROUNDS):
        base = affine_field(present, seen)
        near = np.where(np.isfinite(present).all(axis=-1), 1.0, 0.0)
        smooth = _step(first, second, present, base, seen * near)
        # Once more without what moves otherwise.
        near *= np.linalg.norm(present - smooth, axis=-1) < LARGEST_CHANGE
        smooth = _step(first, second, present, base, seen * near)
        close = np.linalg.norm(flow - smooth, axis=-1) < LARGEST_CHANGE
        present = np.where(close[..., np.newaxis], smooth, flow).astype(np.float32)
    return present


def _step(
    first: Plane, second: Plane, present: Field, base: Field, weight: Plane
) -> Field:
    """Return a + e; NaN where nothing in the window is believed."""
    moved = pulled(second, present)
    known = np.isfinite(moved)
    moved = np.where(known, moved, first)
    difference = (moved - first).astype(np.float64)
    down, across = np.gradient(0.5 * (moved.astype(np.float64) + first))
    alike = 1 / (1 + smoothed(difference**2, 1.0) / ALIKE**2)
    believed = np.where(known, weight, 0.0) * alike

    def window(values: NDArray[Any]) -> NDArray[np.float64]:
        return smoothed(values * believed, WINDOW)

    rest = np.nan_to_num(present - base).astype(np.float64)
    aim = across * rest[..., 0] + down * rest[..., 1] - difference
    share = window(np.ones(first.shape))
    xx, yy = (window(np.square(g)) + RIDGE * share for g in (across, down))
    xy = window(np.asarray(across * down))
    bx, by = (
        window(np.asarray(g * aim + RIDGE * rest[..., part]))
        for part, g in enumerate((across, down))
    )
    enough = share > LEAST_SHARE
    determinant = np.where(enough, xx * yy - xy * xy, 1.0)
    change = np.stack([yy * bx - xy * by, xx * by - xy * bx], axis=-1)
    change /= determinant[..., np.newaxis]
    change[~enough] = np.nan
    return np.asarray(base + change, np.float32)


def affine_field(field: Field, weight: Plane) -> Field:
    """Return the affine field nearest to ``field`` where it is believed, robustly.

    By least squares reweighted with Cauchy's weights, at twice the median residual.
    Zero if less than three pixels are believed.
    """
    height, width = field.shape[:2]
    values = np.moveaxis(np.asarray(field, np.float64), -1, 0)
    given = np.where(np.isfinite(values).all(axis=0), weight, 0.0)
    counts = given > 0
    if counts.sum() < 3:
        return np.zeros_like(field)
    values = np.nan_to_num(values)
    # Sums, not products of matrices: those depend on the number of threads.
    y, x = (np.arange(count) / max(height, width) for count in (height, width))
    weights, fitted = given, values
    for _ in range(FIT_ROUNDS):
        one, wx, wy = _moments(weights, y, x)
        _, wxx, wxy = _moments(weights * x, y, x)
        wyy = float((weights.sum(axis=1) * y**2).sum())
        normal = np.array([[one, wx, wy], [wx, wxx, wxy], [wy, wxy, wyy]])
        aim = np.array([_moments(weights * part, y, x) for part in values]).T
        solution = np.linalg.lstsq(normal, aim, rcond=None)[0]
        fitted = np.array([c + cx * x + (cy * y)[:, None] for c, cx, cy in solution.T])
        distance = np.hypot(*(values - fitted))
        scale = max(2 * float(np.median(distance[counts])), LEAST_SCALE)
        weights = given / (1 + (distance / scale) ** 2)
    return np.ascontiguousarray(np.moveaxis(fitted, 0, -1), np.float32)


def _moments(
    plane: NDArray[np.float64], y: NDArray[np.float64], x: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Return the sums of a plane (H, W), of it times x and of it times y."""
    down, across = plane.sum(axis=1), plane.sum(axis=0)
    return float(down.sum()), float((across * x).sum()), float((down * y).sum())
