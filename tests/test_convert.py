"""Flow in other libraries' conventions: round trips, and the libraries themselves."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import unsmear
from unsmear import convert


@pytest.fixture
def flow(rng: np.random.Generator) -> np.ndarray:
    field = rng.normal(scale=3, size=(5, 7, 2)).astype(np.float32)
    field[1, 2] = np.nan
    field[4, 6, 0] = np.nan  # unknown in one component only
    return field


def bits(field: np.ndarray) -> bytes:
    return np.ascontiguousarray(field).tobytes()


def test_skimage_order_is_rows_then_columns(flow: np.ndarray) -> None:
    theirs = convert.to_skimage(flow)
    assert theirs.shape == (2, 5, 7) and theirs.flags.c_contiguous
    v, u = theirs
    np.testing.assert_array_equal(u, flow[..., 0])
    np.testing.assert_array_equal(v, flow[..., 1])


def test_round_trips_are_exact_with_nan(flow: np.ndarray) -> None:
    before = bits(flow)
    assert bits(convert.from_skimage(convert.to_skimage(flow))) == before
    assert bits(convert.from_opencv(convert.to_opencv(flow))[0, 0]) == bits(flow[0, 0])
    again = convert.from_opencv(convert.to_opencv(flow))
    np.testing.assert_array_equal(again, flow)
    # With a sign for unknown both components become unknown; the rest is the same.
    marked = convert.to_opencv(flow, unknown=1e10)
    assert (marked[1, 2] == np.float32(1e10)).all()
    whole = flow.copy()
    whole[4, 6] = np.nan
    np.testing.assert_array_equal(convert.from_opencv(marked), whole)
    assert bits(flow) == before, "the input is not touched"


def test_skimage_moves_a_picture_by_the_converted_flow() -> None:
    transform = pytest.importorskip("skimage.transform")
    make = unsmear.synthetic
    s = make.translation(make.texture((64, 64), seed=2), (3.0, -1.0), shape=(40, 44))
    rows, columns = np.mgrid[:40, :44].astype(np.float64)
    v, u = convert.to_skimage(s.flow[1])
    back = transform.warp(s.sharp[2], np.stack([rows + v, columns + u]), order=3)
    inside = (slice(4, -4), slice(4, -4))
    # Whole pixels: nothing is interpolated. With u and v exchanged it would be .1 off.
    np.testing.assert_allclose(back[inside], s.sharp[1][inside], atol=1e-6)


def test_skimage_and_opencv_measure_the_same_motion() -> None:
    registration = pytest.importorskip("skimage.registration")
    cv2 = pytest.importorskip("cv2")
    make = unsmear.synthetic
    s = make.translation(
        make.texture((96, 96), seed=2, exponent=1.5), (1.2, -0.7), shape=(64, 70)
    )
    first, second = s.sharp[:2]
    ours = unsmear.optical_flow(s.sharp[:2]).flow
    theirs = [convert.from_skimage(registration.optical_flow_ilk(first, second))]
    bytes_ = [np.rint(255 * np.clip(f, 0, 1)).astype(np.uint8) for f in (first, second)]
    theirs.append(
        convert.from_opencv(
            cv2.calcOpticalFlowFarneback(*bytes_, None, 0.5, 3, 15, 3, 5, 1.2, 0)
        )
    )
    middle = (slice(16, -16), slice(16, -16))
    for field in (ours, *theirs):
        # A sign or an order taken wrongly would be off by more than a pixel.
        mean = field[middle].mean(axis=(0, 1))
        np.testing.assert_allclose(mean, (1.2, -0.7), atol=0.15)


@pytest.mark.parametrize(
    ("function", "given", "message"),
    [
        (convert.to_skimage, (2, 5, 7), r"flow must have shape \(H, W, 2\), got"),
        (convert.from_skimage, (5, 7, 2), r"flow must have shape \(2, H, W\), got"),
        (convert.from_opencv, (5, 7), r"flow must have shape \(H, W, 2\), got"),
    ],
)
def test_a_wrong_layout_is_refused(function, given, message) -> None:
    with pytest.raises(ValueError, match=message):
        function(np.zeros(given))


def test_values_that_are_no_numbers_are_refused() -> None:
    with pytest.raises(TypeError, match="flow must be an array of integers or real"):
        convert.from_skimage(np.full((2, 3, 3), "a"))


class Labelled:
    """What labelled arrays of other libraries offer NumPy."""

    def __init__(self, values: np.ndarray) -> None:
        self.values = values

    def __array__(self, dtype=None, copy=None) -> np.ndarray:
        return np.asarray(self.values, dtype=dtype)


def test_arrays_of_other_libraries_pass(flow: np.ndarray) -> None:
    np.testing.assert_array_equal(
        convert.to_skimage(Labelled(flow)), convert.to_skimage(flow)
    )
    make = unsmear.synthetic
    frames = make.translation(make.texture((64, 64)), (1, 0), shape=(40, 40)).sharp
    np.testing.assert_array_equal(
        unsmear.optical_flow(Labelled(frames)).flow, unsmear.optical_flow(frames).flow
    )
    field = np.full((40, 40, 2), (3.0, 1.0))
    np.testing.assert_array_equal(
        unsmear.deblur(Labelled(frames[0]), Labelled(field), method="wiener").image,
        unsmear.deblur(frames[0], field, method="wiener").image,
    )


def test_integers_are_pixels() -> None:
    assert convert.from_skimage(np.full((2, 1, 1), 3)).ravel().tolist() == [3.0, 3.0]


def test_flow_of_xarray_is_labelled_like_its_frames(flow: np.ndarray) -> None:
    xarray = pytest.importorskip("xarray")
    rows, columns = np.arange(5) * 0.5, np.arange(7) + 100
    frames = xarray.DataArray(
        np.zeros((7, 2, 5)),
        dims=("x", "t", "y"),
        coords={"x": columns, "y": rows, "t": [3, 4]},
    )
    one = convert.to_xarray(flow, like=frames)
    assert one.dims == ("y", "x", "component") and one.attrs["units"] == "px/frame"
    v = one.sel(y=0.5, x=102, component="v")  # NaN: unknown
    assert np.isnan(v) and one.sel(y=1.0, x=106, component="u") == flow[2, 6, 0]
    several = convert.to_xarray(np.stack([flow, 2 * flow]), like=frames)
    assert several.dims == ("t", "y", "x", "component")
    np.testing.assert_array_equal(several.sel(t=4), 2 * flow)
    assert bits(convert.from_xarray(several.transpose(..., "t"))[0]) == bits(flow)
    assert bits(convert.from_xarray(convert.to_xarray(flow))) == bits(flow)
    one[:] = 0
    assert flow[0].any(), "a copy"
    with pytest.raises(ValueError, match="like must have 5 along y, got 6"):
        convert.to_xarray(
            flow, like=xarray.DataArray(np.zeros((6, 7)), dims=("y", "x"))
        )
    with pytest.raises(ValueError, match=r"flow must have shape \(H, W, 2\) or"):
        convert.to_xarray(flow[..., :1])


def test_axes_of_xarray_come_in_any_order(rng: np.random.Generator) -> None:
    xarray = pytest.importorskip("xarray")
    frames = rng.integers(0, 255, (4, 5, 7, 3)).astype(np.uint8)
    named = xarray.DataArray(frames, dims=("t", "y", "x", "c"))
    assert np.shares_memory(convert.from_xarray(named), frames)
    turned = convert.from_xarray(named.transpose("c", "x", "t", "y"))
    np.testing.assert_array_equal(turned, frames)
    assert turned.dtype == np.uint8
    for wrong in (named.rename(t="time"), named[:, 0]):
        with pytest.raises(ValueError, match="array must have axes named y, x and at"):
            convert.from_xarray(wrong)
    with pytest.raises(TypeError, match=r"must be an xarray\.DataArray, got ndarray"):
        convert.from_xarray(frames)


def test_frames_of_xarray_pass_as_they_are() -> None:
    xarray = pytest.importorskip("xarray")
    make = unsmear.synthetic
    frames = make.translation(make.texture((64, 64)), (1, 0), shape=(40, 40)).sharp
    named = xarray.DataArray(frames, dims=("t", "y", "x"))
    np.testing.assert_array_equal(
        unsmear.optical_flow(named).flow, unsmear.optical_flow(frames).flow
    )


def test_without_xarray_the_message_says_what_to_install(
    flow: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ImportError, match="pip install xarray"):
        convert.to_xarray(flow)
