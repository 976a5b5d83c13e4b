"""Flow pictures: the published colour coding, symmetries, and what is drawn where."""

from __future__ import annotations

from math import atan2, floor, hypot, pi

import numpy as np
import pytest
from unsmear import plot

RED, YELLOW, GREEN = (255, 0, 0), (255, 255, 0), (0, 255, 0)
CYAN, BLUE, MAGENTA = (0, 255, 255), (0, 0, 255), (255, 0, 255)


def smooth_flow(height: int = 40, width: int = 60) -> np.ndarray:
    y, x = np.mgrid[:height, :width]
    return np.stack([3 * np.sin(x / 9), 2 * np.cos(y / 7)], axis=-1)


def color_by_hand(u: float, v: float, top: float) -> list[float]:
    """Evaluate Baker et al.'s coding for one vector from a wheel written by hand."""
    wheel = [(255, 255 * i / 15, 0) for i in range(15)]
    wheel += [(255 - 255 * i / 6, 255, 0) for i in range(6)]
    wheel += [(0, 255, 255 * i / 4) for i in range(4)]
    wheel += [(0, 255 - 255 * i / 11, 255) for i in range(11)]
    wheel += [(255 * i / 13, 0, 255) for i in range(13)]
    wheel += [(255, 0, 255 - 255 * i / 6) for i in range(6)]
    place = (atan2(-v, -u) / pi + 1) / 2 * 55
    low = floor(place)
    share = place - low
    pairs = zip(wheel[low % 55], wheel[(low + 1) % 55], strict=True)
    hue = [(1 - share) * a + share * b for a, b in pairs]
    speed = min(hypot(u, v) / top, 1)
    return [255 - speed * (255 - h) for h in hue]


def test_color_of_single_vectors_by_hand():
    flow = np.random.default_rng(0).normal(0, 2, (12, 13, 2))
    shown = plot.flow_to_color(flow, max_flow=3.0)
    expected = [[color_by_hand(u, v, 3.0) for u, v in row] for row in flow]
    # Rounding to whole grey levels, plus the last bit of two arctangents.
    assert np.abs(shown - np.array(expected)).max() <= 0.5 + 1e-9


def test_primaries_lie_where_the_segments_end():
    # Segment boundaries at 0, 15, 21, 25, 36, 49 of 55 steps round the circle; the
    # direction at place k has the angle -pi + 2 pi k / 55 of (-u, -v).
    for place, colour in zip(
        (0, 15, 21, 25, 36, 49), (RED, YELLOW, GREEN, CYAN, BLUE, MAGENTA), strict=True
    ):
        angle = -pi + 2 * pi * place / 55
        flow = np.array([[(-np.cos(angle), -np.sin(angle))]])
        assert tuple(plot.flow_to_color(flow, max_flow=1.0)[0, 0]) == colour


def test_the_wheel_has_no_seam():
    angle = np.linspace(-pi, pi, 2000)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)[None]
    shown = plot.flow_to_color(ring, max_flow=1.0)[0].astype(int)
    # The steepest segment has 4 steps of 64 levels in 4/55 of the circle: 1.8 levels
    # from one of 2000 samples to the next, and one more from rounding.
    assert np.abs(np.diff(shown, axis=0)).max() <= 3
    zeros = np.array([[(1.0, 0.0), (1.0, -0.0)]])
    above, below = plot.flow_to_color(zeros, max_flow=1.0)[0]
    np.testing.assert_array_equal(above, below)


def test_rest_is_white_unknown_black_and_fast_full():
    flow = np.zeros((1, 4, 2))
    flow[0, 1] = np.nan
    flow[0, 2] = (0.0, np.nan)
    flow[0, 3] = (1e30, 0)
    shown = plot.flow_to_color(flow, max_flow=1.0)
    expected = [[(255, 255, 255), (0, 0, 0), (0, 0, 0), RED]]
    np.testing.assert_array_equal(shown, expected)


def test_default_top_speed_is_robust():
    flow = np.zeros((100, 100, 2))
    flow[..., 0] = 2.0
    clean = plot.flow_to_color(flow)
    flow[0, :50, 0] = 1e6  # half a percent of wild pixels
    np.testing.assert_array_equal(plot.flow_to_color(flow)[1:], clean[1:])


def test_default_top_speed_of_few_moving_pixels():
    flow = np.zeros((100, 100, 2))
    flow[0, 0] = (2.0, 0.0)  # the 99th percentile is 0 here
    shown = plot.flow_to_color(flow)
    assert tuple(shown[0, 0]) == RED
    assert (shown[1:] == 255).all()


def test_coding_depends_on_relative_speed_only():
    flow = smooth_flow()
    once = plot.flow_to_color(flow, max_flow=3.0)
    np.testing.assert_array_equal(plot.flow_to_color(8 * flow, max_flow=24.0), once)


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (9, 1), (2, 2)])
@pytest.mark.parametrize("value", [0.0, 1.5, np.nan])
def test_smallest_fields(shape: tuple[int, int], value: float):
    flow = np.full((*shape, 2), value)
    assert plot.flow_to_color(flow).shape == (*shape, 3)
    assert plot.arrows(flow).shape == (*shape, 3)
    figure = plot.flow_figure(flow)
    np.testing.assert_array_equal(
        figure[: shape[0], : shape[1]], plot.flow_to_color(flow)
    )


def test_any_memory_layout_and_type_gives_the_same_picture():
    flow = np.rint(smooth_flow()).astype(np.float32)
    expected = plot.flow_to_color(flow)
    read_only = flow.copy()
    read_only.flags.writeable = False
    forms = [np.asfortranarray(flow), flow[::-1].copy()[::-1], flow.astype(">f8")]
    forms += [read_only, flow.astype(np.int16), flow.astype(np.float16), flow.tolist()]
    for form in forms:
        np.testing.assert_array_equal(plot.flow_to_color(form), expected)
    masked = np.ma.MaskedArray(flow.astype(np.int64), mask=False)
    masked[3, 4] = np.ma.masked
    shown = plot.flow_to_color(masked)
    assert (shown[3, 4] == 0).all()
    np.testing.assert_array_equal(shown[:3], expected[:3])


def test_legend_shows_the_coding_of_its_own_directions():
    wheel = plot.legend(101)
    assert wheel.shape == (101, 101, 3)
    # A point on a diagonal, away from cross and rim: its offset is its vector.
    radius = 101 / 2 - 2
    for dx, dy in [(20, 20), (-25, 10), (10, -30), (-15, -15)]:
        expected = color_by_hand(dx / radius, dy / radius, 1.0)
        assert np.abs(wheel[50 + dy, 50 + dx] - np.array(expected)).max() <= 0.51
    assert (wheel[0, 0] == 255).all()


def test_legend_text_names_the_speed():
    blank = plot.legend(160)
    labelled = plot.legend(160, max_flow=3.0)
    assert labelled.shape == blank.shape
    assert (labelled[-16:] < 128).any()  # ink in the strip of text
    assert (plot.legend(160, max_flow=4.0)[-20:] != labelled[-20:]).any()


def test_arrow_points_along_the_flow_from_its_pixel():
    black = np.zeros((41, 41), np.uint8)
    for u, v in [(1, 0), (-1, 0), (0, 1), (0, -1)]:
        flow = np.full((41, 41, 2), np.nan)
        flow[20, 20] = (u, v)
        drawn = plot.arrows(flow, black, step=41, max_flow=2.5)
        y, x = np.nonzero(drawn[..., 0] > 100)
        # From the centre of its pixel, 41 * 1.2 * 1 / 2.5 = 19.7 px long.
        along, across = (x - 20) * u + (y - 20) * v, (x - 20) * v - (y - 20) * u
        assert along.min() == 0
        assert 18 <= along.max() <= 20
        assert abs(across.mean()) < 0.3  # symmetric to the axis


def test_arrow_edges_are_soft_and_bands_have_no_seam():
    flow = np.full((600, 30, 2), np.nan)
    flow[240, 10] = (0.3, 1.0)  # crosses the border of the bands at row 256
    drawn = plot.arrows(flow, np.zeros((600, 30)), step=30)[..., 0]
    assert len(np.unique(drawn)) > 5
    shifted = np.full((600, 30, 2), np.nan)
    shifted[40, 10] = (0.3, 1.0)  # the same arrow within a band
    other = plot.arrows(shifted, np.zeros((600, 30)), step=30)[..., 0]
    np.testing.assert_array_equal(drawn[230:290], other[30:90])


def test_no_arrows_where_nothing_is_known():
    picture = np.full((20, 30, 3), 77, np.uint8)
    drawn = plot.arrows(np.full((20, 30, 2), np.nan), picture)
    np.testing.assert_array_equal(drawn, picture)
    assert (picture == 77).all()


def test_pictures_of_any_type_look_the_same():
    grey = np.arange(256, dtype=np.uint8).reshape(16, 16)
    still = np.full((16, 16, 2), np.nan)
    expected = np.repeat(grey[..., None], 3, axis=2)
    for image in (grey, grey.astype(np.uint16) * 257, grey / 255, expected):
        np.testing.assert_array_equal(plot.arrows(still, image), expected)
    # Floats beyond [0, 1] are stretched from their least to their greatest value.
    np.testing.assert_array_equal(plot.arrows(still, grey * 3.0 - 50), expected)


def test_side_by_side_keeps_every_pixel():
    tall = np.full((30, 10), 50, np.uint8)
    flat = np.full((10, 40, 3), 90, np.uint8)
    both = plot.side_by_side([tall, flat])
    assert both.shape == (30, 10 + 8 + 40, 3)
    assert (both[:, :10] == 50).all()
    assert (both[:10, 18:] == 90).all()
    assert (both[10:, 18:] == 255).all()
    labelled = plot.side_by_side([tall, flat], labels=["", "x" * 100])
    np.testing.assert_array_equal(labelled[22:], both)
    assert (labelled[:22, :18] == 255).all()  # a long label stays over its picture
    assert (labelled[:22, 18:] < 128).any()


def test_figure_tells_of_unknown_pixels():
    flow = smooth_flow()
    known = plot.flow_figure(flow)
    flow[0, 0] = np.nan
    assert len(plot.flow_figure(flow)) > len(known)


@pytest.mark.parametrize("shape", [(0, 3, 2), (3, 4), (3, 4, 3), (1, 3, 4, 2)])
def test_wrong_flow_shapes_are_refused(shape: tuple[int, ...]):
    for function in (plot.flow_to_color, plot.arrows, plot.flow_figure):
        with pytest.raises(ValueError, match=r"flow must have shape \(H, W, 2\)"):
            function(np.zeros(shape))


def test_wrong_arguments_are_refused():
    flow = smooth_flow(4, 5)
    for bad in (0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="max_flow must be positive"):
            plot.flow_to_color(flow, max_flow=bad)
    with pytest.raises(TypeError, match="max_flow"):
        plot.flow_to_color(flow, max_flow="3")
    with pytest.raises(TypeError, match="flow must be"):
        plot.flow_to_color(flow.astype(complex))
    with pytest.raises(ValueError, match="step must be at least 1, got 0"):
        plot.arrows(flow, step=0)
    with pytest.raises(ValueError, match="size must be at least 32"):
        plot.legend(31)
    with pytest.raises(ValueError, match=r"height and width of flow, \(4, 5\)"):
        plot.arrows(flow, np.zeros((5, 4)))
    with pytest.raises(ValueError, match="image must have shape"):
        plot.arrows(flow, np.zeros((4, 5, 2)))
    with pytest.raises(ValueError, match="at least one picture"):
        plot.side_by_side([])
    with pytest.raises(ValueError, match=r"as many as images \(1\), got 2"):
        plot.side_by_side([np.zeros((2, 2))], labels=["a", "b"])
