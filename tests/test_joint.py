"""Several exposures restored as one, and what registers them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import unsmear
from unsmear import _unsmear
from unsmear.restoration.clip_motion import Motion
from unsmear.restoration.joint import Neighbour, restore_jointly
from unsmear.restoration.looks import cropped, look, walk
from unsmear.restoration.neighbours import seen_in
from unsmear.restoration.registration import affine_field, settled
from unsmear.restoration.sampling import inside
from unsmear.synthetic import ExposureSeries, exposure_series, texture

SHAPE = (96, 104)
NOISE = 1.0
STRENGTH = 0.06
INNER = (slice(16, -16),) * 2


@pytest.fixture(scope="module")
def series() -> ExposureSeries:
    # Blocks on a texture: edges for the prior, detail for the registration.
    y, x = np.mgrid[:200, :200]
    picture = 0.6 * texture((200, 200), seed=4, exponent=1.2)
    picture += 0.4 * ((y // 17 + x // 13) % 2)
    return exposure_series(picture, shape=SHAPE, lengths=9.0, noise=NOISE, seed=1)


def own(series: ExposureSeries) -> Any:
    velocity = series.velocity[1]
    planes = series.blurred[1].astype(np.float32)[np.newaxis]
    return look(planes, velocity, 0 * velocity, 1.0, np.ones(SHAPE, np.float32))


def neighbour(series: ExposureSeries, k: int) -> Neighbour:
    velocity, offset = series.velocity[k], series.offset[k].copy()
    steady = velocity, np.zeros_like(velocity)
    motion = Motion(*steady, steady, None, None)
    planes = series.blurred[k].astype(np.float32)[np.newaxis]
    return Neighbour(planes, motion, 1.0, offset, inside(offset).astype(np.float32))


def alone(series: ExposureSeries) -> tuple[Any, int]:
    pictures, pad = walk([own(series)], (1.4 * STRENGTH,), NOISE, sharp=True)
    return pictures[0], pad


def join(series: ExposureSeries, neighbours: list[Neighbour]) -> Any:
    picture, pad = alone(series)
    return restore_jointly(
        own(series),
        neighbours,
        picture,
        pad,
        strength=STRENGTH,
        noise=NOISE,
    )


def error(picture: Any, pad: int, series: ExposureSeries) -> float:
    """Root mean square error of a padded restoration, grey levels."""
    difference = cropped(picture, pad)[0] - series.sharp[1].astype(float)
    return float(np.sqrt((difference[INNER] ** 2).mean()))


def test_stacked_operators_with_offsets_have_exact_transposes(
    series: ExposureSeries,
) -> None:
    rng = np.random.default_rng(3)
    pad, sums, sizes = 24, np.zeros(2), np.zeros(2)
    x = rng.normal(size=(SHAPE[0] + 2 * pad, SHAPE[1] + 2 * pad)).astype(np.float32)
    back = np.zeros(x.shape)
    for velocity, offset in zip(series.velocity, series.offset, strict=True):
        operator = unsmear.MotionOperator(velocity, offset=offset, pad=pad)
        b = rng.normal(size=SHAPE).astype(np.float32)
        recorded = operator.forward(x).astype(np.float64)
        sums[0] += (recorded * b).sum()
        sizes += [(recorded**2).sum(), (b.astype(float) ** 2).sum()]
        back += operator.adjoint(b)
    sums[1] = (x.astype(np.float64) * back).sum()
    # Single precision in some 100 taps a datum.
    assert abs(sums[0] - sums[1]) < 1e-6 * np.sqrt(sizes.prod())


def test_offset_path_records_the_other_exposure() -> None:
    # What the neighbour's operator makes of the sharp middle is the neighbour's record.
    picture = texture((200, 200), seed=4, exponent=1.6)
    series = exposure_series(picture, shape=SHAPE, lengths=9.0, noise=0.0)
    pad = 24
    sharp = np.pad(series.sharp[1].astype(np.float32), pad, mode="edge")
    for k in (0, 2):
        look_there = neighbour(series, k).look(np.ones(SHAPE, np.float32))
        predicted = _unsmear.record_look(look_there, sharp[np.newaxis], pad)[0]
        exposed = 255 * series.exposed[k]
        # Interpolation by cubics, where the series was made by splines of degree 5.
        difference = (predicted - exposed)[INNER]
        elsewhere = (sharp[pad:-pad, pad:-pad] - exposed)[INNER]
        assert np.sqrt((difference**2).mean()) < 0.3
        assert np.sqrt((elsewhere**2).mean()) > 5


def test_different_blurs_complete_each_other(series: ExposureSeries) -> None:
    before = error(*alone(series), series)
    joint = join(series, [neighbour(series, k) for k in (0, 2)])
    after = error(joint.picture, joint.pad, series)
    # Three times the data alone would be a factor of .58.
    assert after < 0.7 * before
    assert joint.weight > 0.5
    assert joint.kept < 0.05


def test_copies_are_one_frame_with_less_noise(series: ExposureSeries) -> None:
    grain = [series.with_noise(NOISE, seed) for seed in (1, 2, 3)]
    steady = series.velocity[1], 0 * series.velocity[1]
    motion = Motion(*steady, steady, None, None)
    copies = [
        Neighbour(
            one.blurred[1].astype(np.float32)[np.newaxis],
            motion,
            1.0,
            np.zeros_like(series.offset[1]),
            np.ones(SHAPE, np.float32),
        )
        for one in grain[1:]
    ]
    joint = join(series, copies)
    mean = np.mean([one.blurred[1] for one in grain], axis=0, dtype=np.float32)
    averaged = {**own(series), "planes": mean[np.newaxis]}
    # K frames of weight 1 with lambda sqrt(K) are their mean with lambda / sqrt(K).
    pictures, pad = walk(
        [averaged], (1.4 * STRENGTH / 3**0.5,), NOISE / 3**0.5, sharp=True
    )
    before = error(*alone(series), series)
    together = error(joint.picture, joint.pad, series)
    assert together < 0.95 * before
    # Weights below one and Cauchy's scale differ, not more.
    assert together == pytest.approx(error(pictures[0], pad, series), rel=0.1)


def test_order_of_neighbours_does_not_matter(series: ExposureSeries) -> None:
    pictures = []
    for order in ((0, 2), (2, 0)):
        joint = join(series, [neighbour(series, k) for k in order])
        pictures.append(cropped(joint.picture, joint.pad))
    # Sums in another order; the prior is not convex and may amplify their rounding.
    assert np.sqrt(((pictures[0] - pictures[1]) ** 2).mean()) < 0.1


def test_a_frame_that_sees_nothing_changes_nothing(series: ExposureSeries) -> None:
    hidden = neighbour(series, 0)
    hidden.seen = np.zeros(SHAPE, np.float32)
    hidden.planes = np.full_like(hidden.planes, 77.0)
    pictures = []
    for others in ([], [hidden]):
        joint = join(series, [neighbour(series, 2), *others])
        pictures.append(cropped(joint.picture, joint.pad))
    # Equal but for the padding, which the offset of the hidden frame may widen.
    assert np.abs(pictures[0] - pictures[1])[(0, *INNER)].max() < 0.5


def test_a_foreign_frame_is_left_out(series: ExposureSeries) -> None:
    foreign = neighbour(series, 0)
    foreign.planes = foreign.planes[:, ::-1, ::-1].copy()
    before = error(*alone(series), series)
    joint = join(series, [foreign])
    assert joint.weight < 0.3
    assert error(joint.picture, joint.pad, series) < 1.03 * before


def test_equal_channels_are_restored_like_one(series: ExposureSeries) -> None:
    picture, pad = alone(series)
    pictures = []
    for channels in (1, 3):
        others = [neighbour(series, k) for k in (0, 2)]
        for one in others:
            one.planes = np.repeat(one.planes, channels, axis=0)
        frame = own(series)
        frame["planes"] = np.repeat(frame["planes"], channels, axis=0)
        start = np.repeat(picture, channels, axis=0)
        options = {"strength": STRENGTH, "noise": NOISE}
        joint = restore_jointly(frame, others, start, pad, **options)
        pictures.append(cropped(joint.picture, joint.pad)[-1])
    # Means over channels round, which a prior that is not convex may amplify.
    assert np.sqrt(((pictures[0] - pictures[1]) ** 2).mean()) < 0.1


def test_without_neighbours_the_frame_is_kept(series: ExposureSeries) -> None:
    picture, pad = alone(series)
    joint = join(series, [])
    assert joint.pad == pad
    np.testing.assert_array_equal(joint.picture, picture)


def test_settling_removes_the_flow_s_own_errors(series: ExposureSeries) -> None:
    sharp = series.sharp.astype(np.float32)
    flow = unsmear.optical_flow(np.stack([sharp[0], sharp[1]]), index=0).flow
    seen = inside(flow).astype(np.float32)
    smooth = settled(sharp[0], sharp[1], flow, seen)
    before, after = (
        np.linalg.norm(field - series.offset[0], axis=-1)[INNER].mean()
        for field in (flow, smooth)
    )
    assert after < min(0.05, 0.7 * before)


def test_settling_keeps_another_body_s_flow() -> None:
    first = 255 * texture((96, 96), seed=2, exponent=1.0).astype(np.float32)
    flow = np.zeros((96, 96, 2), np.float32)
    body = np.zeros((96, 96), bool)
    body[40:52, 40:52] = True
    flow[body] = (5.0, -3.0)
    seen = np.ones((96, 96), np.float32)
    smooth = settled(first, first, flow, seen)
    np.testing.assert_array_equal(smooth[body], flow[body])
    assert np.abs(smooth[~body]).max() < 0.05
    flow[0, 0] = np.nan
    assert np.isnan(settled(first, first, flow, seen)[0, 0]).all()


def test_affine_field_is_found_among_outliers() -> None:
    y, x = np.mgrid[:40, :50].astype(np.float32)
    truth = np.stack([2 + 0.03 * x - 0.01 * y, -1 + 0.02 * y], axis=-1)
    field = truth.copy()
    field[8:24, 10:30] += (6.0, -4.0)
    field[30, 20] = np.nan
    ones = np.ones((40, 50), np.float32)
    # Cauchy's weights leave 16 % of outliers, 7 px away, (.05 / 7)^2 each.
    np.testing.assert_allclose(affine_field(field, ones), truth, atol=0.02)
    assert not affine_field(field, 0 * ones).any()


def test_seen_is_what_comes_back_inside() -> None:
    way = np.zeros((20, 24, 2), np.float32)
    way[..., 0] = 4.0
    back = -way
    back[5, 12] = (3.0, 0.0)
    visible = np.ones((20, 24), np.float32)
    visible[15, 3] = 0
    seen = seen_in(way, back, visible)
    # Hidden pixels take those beside them along: the last 4 columns and one more, ...
    assert not seen[:, -5:].any()
    # ... what did not come back (from column 12, seen from 8), what mixes motions.
    expected = np.ones((20, 19), bool)
    expected[4:7, 7:10] = False
    expected[14:17, 2:5] = False
    np.testing.assert_array_equal(seen[:, :19] > 0, expected)


def test_series_is_what_it_says(series: ExposureSeries) -> None:
    np.testing.assert_allclose(np.linalg.norm(series.velocity, axis=-1), 9, atol=1e-3)
    angles = np.degrees(np.arctan2(series.velocity[..., 1], series.velocity[..., 0]))
    for k, angle in enumerate((0, 60, 120)):
        np.testing.assert_allclose(angles[k], angle, atol=0.01)
    assert not series.offset[1].any()
    # There and back: the inverse of a turn and a shift.
    there = series.way[0].astype(float).mean(axis=(0, 1))
    back = series.offset[0].astype(float).mean(axis=(0, 1))
    np.testing.assert_allclose(there, -back, atol=0.05)
    assert (series.with_noise(0.0).blurred != series.blurred).any()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"directions": (0.0, 90.0)}, "directions must be an odd number"),
        ({"lengths": (1.0, 2.0)}, "lengths must be one"),
        ({"noise": -1.0}, "noise must be"),
    ],
)
def test_series_refuses(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        exposure_series(np.zeros((40, 40)), shape=(16, 16), n_subframes=2, **change)


def test_more_exposures_are_further_apart(series: ExposureSeries) -> None:
    five = exposure_series(
        np.eye(60), shape=(16, 16), directions=(0, 1, 2, 3, 4), n_subframes=2
    )
    distance = np.linalg.norm(five.offset, axis=-1).mean(axis=(1, 2))
    np.testing.assert_allclose(distance[[0, 4]] / distance[[1, 3]], 2, rtol=0.05)
    assert replace(series).sharp is series.sharp
