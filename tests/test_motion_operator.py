"""The motion operator: its laws, the true blur of moving waves, then the slow twin."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import pytest
import unsmear
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from reference import motion_operator as slow

Real = NDArray[np.float64]
Taps = Literal["cubic", "linear"]
TAPS: tuple[Taps, ...] = ("cubic", "linear")


def affine(shape: tuple[int, int], matrix: Any, centre: tuple[float, float]) -> Real:
    """Velocity matrix @ (p - centre), (x, y)."""
    y, x = np.indices(shape).astype(np.float64)
    place = np.stack([x - centre[0], y - centre[1]], axis=-1)
    return place @ np.asarray(matrix, dtype=np.float64).T


def turning(angle: float) -> list[list[float]]:
    return [[0.0, -angle], [angle, 0.0]]


MATRICES = {
    "rotation": turning(0.3),
    "zoom": [[0.2, 0.0], [0.0, 0.2]],
    "shear": [[0.1, 0.5], [-0.2, 0.05]],
}


@pytest.mark.parametrize("taps", TAPS)
@pytest.mark.parametrize("motion", MATRICES)
@pytest.mark.parametrize("pad", [None, 2])
def test_adjoint_is_the_transpose(
    rng: np.random.Generator, taps: Taps, motion: str, pad: int | None
) -> None:
    flow = affine((37, 51), MATRICES[motion], (20.0, 15.0))
    flow[3:6, 7:9] = np.nan
    acceleration = rng.normal(0.0, 2.0, flow.shape)
    operator = unsmear.MotionOperator(
        flow, exposure=0.8, acceleration=acceleration, taps=taps, pad=pad
    )
    x = rng.normal(size=operator.unknown_shape).astype(np.float32)
    b = rng.normal(size=operator.data_shape).astype(np.float32)
    forward, adjoint = operator.forward(x).astype(float), operator.adjoint(b)
    # Single precision of some 100 terms each, mostly cancelling.
    limit = 1e-6 * float(np.linalg.norm(forward) * np.linalg.norm(b))
    difference = (forward * b).sum() - (x.astype(float) * adjoint).sum()
    assert abs(difference) < limit
    ones = operator.forward(np.ones(operator.unknown_shape))
    assert_allclose(ones, 1.0, atol=2e-6)


@pytest.mark.parametrize("motion", [0.0, np.nan])
def test_stillness_and_ignorance_copy_bit_for_bit(
    rng: np.random.Generator, motion: float
) -> None:
    operator = unsmear.MotionOperator(np.full((9, 33, 2), motion), pad=3)
    x = rng.normal(size=(15, 39)).astype(np.float32)
    assert_array_equal(operator.forward(x), x[3:-3, 3:-3])
    # Among pixels that move as well.
    flow = np.full((9, 33, 2), 5.0)
    flow[4, 7] = motion
    operator = unsmear.MotionOperator(flow)
    x = rng.normal(size=operator.unknown_shape).astype(np.float32)
    pad = operator.pad
    assert operator.forward(x)[4, 7] == x[4 + pad, 7 + pad]


def waves(x: Real, y: Real) -> Real:
    """A texture of five waves of up to 0.9 rad/px, evaluated anywhere."""
    angles = np.arange(5) * 2.4
    lengths = np.linspace(0.3, 0.9, 5)
    return sum(
        (
            np.cos(k * (x * np.cos(a) + y * np.sin(a)) + a)
            for k, a in zip(lengths, angles, strict=True)
        ),
        np.zeros_like(x),
    )


@pytest.mark.parametrize(("degrees", "bound"), [(5.0, 0.012), (25.0, 0.012)])
def test_blur_of_a_rotation_is_the_true_one(degrees: float, bound: float) -> None:
    shape, centre = (96, 120), (60.0, 48.0)
    angle = np.deg2rad(degrees)
    flow = affine(shape, turning(angle), centre)
    operator = unsmear.MotionOperator(flow)
    pad = operator.pad
    y, x = np.indices(operator.unknown_shape).astype(np.float64) - pad
    blurred = operator.forward(waves(x, y))
    y, x = np.indices(shape).astype(np.float64)
    truth = np.zeros(shape)
    instants = (np.arange(400) + 0.5) / 400.0 - 0.5
    for t in instants:
        cos, sin = np.cos(angle * t), np.sin(angle * t)
        right, below = x - centre[0], y - centre[1]
        truth += waves(
            centre[0] + cos * right + sin * below, centre[1] - sin * right + cos * below
        )
    error = blurred - truth / 400.0
    # Keys' cubic errs by w^3 / 24 of a wave, 3 % at 0.9 rad/px and far less after the
    # blur; a straight path errs by 0.4 at 25 degrees (the third power of the angle is
    # what a parabola lacks).
    assert np.sqrt((error**2).mean()) < bound
    straight = unsmear.MotionOperator(
        flow, acceleration=affine(shape, -np.eye(2) * angle**2, centre)
    )
    x_straight = np.indices(straight.unknown_shape).astype(np.float64) - straight.pad
    chord = straight.forward(waves(x_straight[1], x_straight[0])) - truth / 400.0
    assert np.sqrt((chord**2).mean()) > np.sqrt((error**2).mean())


@pytest.mark.parametrize("taps", TAPS)
@pytest.mark.parametrize("motion", MATRICES)
def test_is_the_slow_twin(rng: np.random.Generator, taps: Taps, motion: str) -> None:
    # Off the grid, so that no pixel moves as fast on one axis as on the other.
    shape, centre = (7, 21), (11.3, 2.2)
    matrix = np.asarray(MATRICES[motion])
    velocity = affine(shape, matrix, centre)
    exposure = 0.7
    offset = rng.uniform(-2.0, 2.0, velocity.shape).astype(np.float32)
    acceleration = rng.uniform(-3.0, 3.0, velocity.shape).astype(np.float32)
    operator = unsmear.MotionOperator(
        velocity,
        exposure=exposure,
        acceleration=acceleration,
        offset=offset,
        taps=taps,
        pad=2,
    )
    # (v.grad) v of an affine field is M v, and differences find it exactly.
    curvature = exposure**2 * (velocity @ matrix.T - acceleration)
    dense = slow.matrix(
        exposure * velocity,
        curvature,
        offset.astype(np.float64),
        operator.pad,
        cubic=taps == "cubic",
    )
    x = rng.normal(size=operator.unknown_shape).astype(np.float32)
    ours = operator.forward(x).ravel()
    error = np.abs(ours - dense @ x.ravel())
    # Times of gently bent paths are polynomials off by 6e-4 (see lanes.rs), on noise of
    # unit deviation; the rest is single precision.
    assert error.max() < 3e-3
    b = rng.normal(size=shape).astype(np.float32)
    spread = np.abs(operator.adjoint(b).ravel() - dense.T @ b.ravel())
    assert spread.max() < 6e-3


def test_bytes_do_not_depend_on_threads(threads: Any, rng: np.random.Generator) -> None:
    operator = unsmear.MotionOperator(affine((200, 70), turning(0.2), (30.0, 90.0)))
    b = rng.normal(size=operator.data_shape).astype(np.float32)
    results = []
    for n in (1, 2, 3):
        threads(n)
        results.append(operator.adjoint(b))
    assert_array_equal(results[0], results[1])
    assert_array_equal(results[0], results[2])


def test_bad_input_is_refused_by_name() -> None:
    flow = np.zeros((4, 5, 2))
    with pytest.raises(ValueError, match="exposure must"):
        unsmear.MotionOperator(flow, exposure=0.0)
    with pytest.raises(ValueError, match="taps must"):
        unsmear.MotionOperator(flow, taps="quintic")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="pad must"):
        unsmear.MotionOperator(flow, pad=-1)
    with pytest.raises(ValueError, match="offset must"):
        unsmear.MotionOperator(flow, offset=np.full((4, 5, 2), np.nan))
    with pytest.raises(ValueError, match="acceleration must"):
        unsmear.MotionOperator(flow, acceleration=np.zeros((4, 6, 2)))
    operator = unsmear.MotionOperator(flow, pad=1)
    with pytest.raises(ValueError, match="x must have shape"):
        operator.forward(np.zeros((4, 5)))
    with pytest.raises(ValueError, match="b must have shape"):
        operator.adjoint(np.zeros((6, 7)))
