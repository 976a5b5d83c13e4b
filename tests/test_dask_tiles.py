"""Tiles with their halo: the picture in memory, bit for bit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import unsmear
from unsmear import synthetic

da = pytest.importorskip("dask.array", reason="dask is not here")
import dask  # noqa: E402
import unsmear.dask  # noqa: E402
from unsmear.dask import halos  # noqa: E402


@pytest.fixture(autouse=True)
def in_this_thread() -> Any:
    """Errors of tasks are raised where they are asked for."""
    with dask.config.set(scheduler="synchronous"):
        yield


def field(height: int, width: int) -> np.ndarray:
    """Motion that turns, jumps, rests and is unknown somewhere."""
    y, x = np.mgrid[:height, :width].astype(np.float32)
    flow = np.stack([0.12 * (y - height / 2), -0.12 * (x - width / 2)], axis=-1)
    flow[height // 3 : height // 2, width // 3 : width // 2] = (-4, 3)
    flow[5:15, 5:15] = 0
    flow[-12:-6, 20:30] = np.nan
    return flow


@pytest.mark.parametrize("dtype", [np.uint8, np.float32, np.float64])
@pytest.mark.parametrize("tile", [(23, 31), (1, 500), (64, 64)])
def test_tiles_equal_the_picture(dtype: Any, tile: tuple[int, int]) -> None:
    height, width = 150, 131
    if tile == (1, 500):
        height, width = 24, 40
    flow = field(height, width)
    texture = 255 * synthetic.texture((height, width), seed=6)
    image = np.stack([texture, texture[::-1], texture[:, ::-1]], axis=0).astype(dtype)
    if dtype != np.uint8:
        image[:, 40 % height, 20] = np.nan
    lazy = da.from_array(image, chunks=(2, *tile))
    options: dict[str, Any] = {"exposure": 0.7, "channel_axis": 0}
    whole = unsmear.blur(image, flow, **options)
    made = unsmear.dask.blur(lazy, flow, **options).compute()
    np.testing.assert_array_equal(made, whole)
    assert made.dtype == image.dtype and not np.array_equal(made, image)
    lazy_flow = da.from_array(flow, chunks=(50, 40, 1))
    for given in ({"noise": 1.0}, {"regularization": 0.02}):
        told = {"method": "wiener", "turn": 0, **given, **options}
        whole = unsmear.deblur(image, flow, **told).image
        made = unsmear.dask.wiener(lazy, lazy_flow, longest=9, **given, **options)
        np.testing.assert_array_equal(made.compute(), whole)


def test_tiles_take_a_flow_beside_the_blur_as_it_is() -> None:
    # In memory the flow would be turned: every tile by an angle of its own is worse.
    flow = np.full((160, 160, 2), (9.0, 2.0))
    beside = np.full((160, 160, 2), (9.0, 0.4))
    blurred = unsmear.blur(255 * synthetic.texture((160, 160), seed=3), flow)
    lazy = da.from_array(blurred, chunks=80)
    made = unsmear.dask.wiener(lazy, beside, noise=0.5).compute()
    whole = unsmear.deblur(blurred, beside, method="wiener", noise=0.5, turn=0)
    np.testing.assert_array_equal(made, whole.image)
    assert unsmear.deblur(blurred, beside, method="wiener").report["turn"] > 5


def test_a_smaller_halo_would_not_do() -> None:
    # What is read at the far end of the blur, and by the spline around it.
    image = np.zeros((1, 101))
    image[0, 50] = 1e9
    for length in (8.0, 20.0):
        flow = np.full((1, 101, 2), (length, 0.0))
        reached = np.flatnonzero(unsmear.blur(image, flow)[0])
        halo = halos.blur_halo(length)
        assert halo - 2 <= 50 - reached[0] <= halo


def speeding_up(height: int, width: int) -> np.ndarray:
    """Motion that grows along itself as fast as a walk follows it, and starts anew."""
    flow = np.zeros((height, width, 2), np.float32)
    flow[..., 0] = 0.6 + 0.45 * (np.arange(width) % 21)
    return flow


def test_restoring_looks_as_far_as_motion_that_grows_leads(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    image, flow = synthetic.texture((24, 400), seed=2), speeding_up(24, 400)
    whole = unsmear.deblur(image, flow, method="wiener", regularization=0.01).image

    def made() -> np.ndarray:
        lazy = da.from_array(image, chunks=(24, 19))
        return unsmear.dask.wiener(lazy, flow, regularization=0.01).compute()

    np.testing.assert_array_equal(made(), whole)
    monkeypatch.setattr("unsmear.dask.tiles.wiener_halo", lambda *_: 25)
    assert not np.array_equal(made(), whole), "a smaller halo would not do"


@pytest.mark.parametrize("length", [0.7, 3.0, 12.5, 60.0, 250.0])
def test_halos_hold_what_the_core_says_it_reads(length: float) -> None:
    flow = np.full((8, 9, 2), (length, 0))
    options = {"method": "wiener", "noise": 1.0}
    reach = unsmear.deblur(np.ones((8, 9)), flow, **options).report["reach"]
    detail, spline = halos.DETAIL, halos.SPLINE
    halo = halos.wiener_halo(length, 1.0)
    assert halo - spline - 1 >= reach - detail >= 0


def test_blur_longer_than_announced_is_refused_when_it_is_met() -> None:
    flow = np.zeros((40, 60, 2), np.float32)
    flow[:, 40:] = (6, 0)
    lazy = unsmear.dask.blur(
        da.ones((40, 60), chunks=20), da.from_array(flow, chunks=20), longest=2
    )
    assert (lazy[:20, :20].compute() == 1).all()
    with pytest.raises(ValueError, match=r"longest must be at least .* 6 px .* got 2"):
        lazy.compute()
