"""Flow files: exact round trips, the published layouts byte by byte, refusals."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from flow_helpers import field, png
from unsmear.flow_files import read_flow, write_flow

SUFFIXES = [".flo", ".pfm", ".png", ".npy", ".npz", ".flo5"]


def need(suffix: str) -> None:
    if suffix == ".flo5":
        pytest.importorskip("h5py")


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("shape", [(5, 7), (1, 1), (1, 9), (8, 1)])
def test_round_trip_is_exact(tmp_path: Path, suffix: str, shape: tuple[int, int]):
    need(suffix)
    flow = field(*shape)
    write_flow(tmp_path / f"a{suffix}", flow)
    back = read_flow(tmp_path / f"a{suffix}")
    assert back.dtype == np.float32
    assert back.flags.c_contiguous
    assert back.flags.writeable
    # assert_array_equal takes NaN at the same place as equal.
    np.testing.assert_array_equal(back, flow)
    assert [p.name for p in tmp_path.iterdir()] == [f"a{suffix}"]  # nothing left over


@pytest.mark.parametrize("suffix", [".flo", ".pfm", ".npy", ".npz", ".flo5"])
def test_float_formats_keep_every_bit(tmp_path: Path, suffix: str):
    need(suffix)
    flow = np.random.default_rng(1).normal(0, 1e3, (9, 4, 2)).astype(np.float32)
    flow[0, 0] = (1e-40, -0.0)  # a subnormal and a signed zero
    write_flow(tmp_path / f"a{suffix}", flow)
    back = read_flow(tmp_path / f"a{suffix}")
    np.testing.assert_array_equal(back.view(np.uint32), flow.view(np.uint32))


def test_kitti_rounds_to_the_nearest_sixty_fourth(tmp_path: Path):
    flow = np.random.default_rng(2).uniform(-511, 511, (6, 5, 2)).astype(np.float32)
    write_flow(tmp_path / "a.png", flow)
    # Half a step of 1/64 px; the values themselves are exact in float32.
    assert np.abs(read_flow(tmp_path / "a.png") - flow).max() <= 0.5 / 64


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_half_known_pixel_is_unknown(tmp_path: Path, suffix: str):
    need(suffix)
    flow = np.ones((2, 3, 2), np.float32)
    flow[1, 2, 0] = np.nan
    write_flow(tmp_path / f"a{suffix}", flow)
    unknown = np.isnan(read_flow(tmp_path / f"a{suffix}"))
    assert unknown[1, 2].all()
    assert unknown.sum() == 2


# --- the layouts, written here by hand from their descriptions ---------------------


def test_flo_layout(tmp_path: Path):
    values = [1.5, -2.0, 1e10, 0.0, 0.25, 2e9, -3.0, 4.0, 5.0, 6.0, -1e10, 1e10]
    data = struct.pack("<f2i12f", 202021.25, 3, 2, *values)
    (tmp_path / "a.flo").write_bytes(data)
    nan = np.nan
    expected = [[(1.5, -2), (nan, nan), (nan, nan)], [(-3, 4), (5, 6), (nan, nan)]]
    np.testing.assert_array_equal(read_flow(tmp_path / "a.flo"), expected)
    write_flow(tmp_path / "b.flo", np.array([[(1.5, -2.0), (nan, nan)]]))
    expected_bytes = struct.pack("<f2i4f", 202021.25, 2, 1, 1.5, -2.0, 1e10, 1e10)
    assert (tmp_path / "b.flo").read_bytes() == expected_bytes


@pytest.mark.parametrize(("order", "scale"), [("<", "-1.0"), (">", "1"), ("<", "-.5")])
def test_pfm_layout_rows_from_the_bottom(tmp_path: Path, order: str, scale: str):
    bottom_row, top_row = [1, 2, 0, 3, 4, 0], [5, 6, 0, 7, np.nan, 0]
    head = f"PF\n2 2\n{scale}\n".encode()
    data = head + struct.pack(f"{order}12f", *bottom_row, *top_row)
    (tmp_path / "a.PFM").write_bytes(data)
    expected = [[(5, 6), (np.nan, np.nan)], [(1, 2), (3, 4)]]
    np.testing.assert_array_equal(read_flow(tmp_path / "a.PFM"), expected)


def test_pfm_third_channel_as_mask(tmp_path: Path):
    data = b"PF 2 1 -1\n" + struct.pack("<6f", 1, 2, 1, 3, 4, 0)
    (tmp_path / "a.pfm").write_bytes(data)
    expected = [[(1, 2), (np.nan, np.nan)]]
    np.testing.assert_array_equal(read_flow(tmp_path / "a.pfm"), expected)


def test_kitti_layout(tmp_path: Path):
    row = b"\0" + struct.pack(">6H", 2**15 + 64, 2**15 - 32, 1, 2**15, 2**15, 0)
    (tmp_path / "a.png").write_bytes(png(16, 2, 2, 1, row))
    expected = [[(1, -0.5), (np.nan, np.nan)]]
    np.testing.assert_array_equal(read_flow(tmp_path / "a.png"), expected)


@pytest.mark.parametrize("dtype", ["<f2", "<f4", ">f4", "<f8", ">f8"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_npy_of_any_float_and_order(tmp_path: Path, dtype: str, order: str):
    flow = np.asarray(field(), dtype=dtype, order=order)
    np.save(tmp_path / "a.npy", flow)
    np.testing.assert_array_equal(read_flow(tmp_path / "a.npy"), field())
    np.savez(tmp_path / "a.npz", other=np.zeros(3), flow=flow)
    np.testing.assert_array_equal(read_flow(tmp_path / "a.npz"), field())


def test_written_arrays_are_numpys_own(tmp_path: Path):
    write_flow(tmp_path / "a.npy", field())
    write_flow(tmp_path / "a.npz", field())
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), field())
    np.testing.assert_array_equal(np.load(tmp_path / "a.npz")["flow"], field())


# --- what may be handed in ---------------------------------------------------------


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_any_memory_layout_gives_the_same_file(tmp_path: Path, suffix: str):
    need(suffix)
    flow = field()
    wide = np.zeros((10, 14, 2), np.float32)
    wide[::2, ::2] = flow
    read_only = flow.copy()
    read_only.flags.writeable = False
    masked = np.ma.MaskedArray(np.nan_to_num(flow), mask=np.isnan(flow))
    forms = [np.asfortranarray(flow), flow[::-1, ::-1].copy()[::-1, ::-1]]
    forms += [wide[::2, ::2], read_only, flow.astype(">f4"), flow.astype(np.float64)]
    forms += [masked, flow.tolist()]
    for form in forms:
        write_flow(tmp_path / f"a{suffix}", form)
        np.testing.assert_array_equal(read_flow(tmp_path / f"a{suffix}"), flow)
    np.testing.assert_array_equal(flow, field())  # the input was not touched


@pytest.mark.parametrize(
    "shape", [(0, 3, 2), (3, 0, 2), (2, 3, 4), (3, 4), (2,), (1, 3, 4, 2)]
)
def test_wrong_shapes_are_refused(tmp_path: Path, shape: tuple[int, ...]):
    with pytest.raises(ValueError, match=r"flow must have shape \(H, W, 2\)"):
        write_flow(tmp_path / "a.flo", np.zeros(shape))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("bad", [np.inf, -np.inf, 1e39])
def test_infinite_flow_is_refused(tmp_path: Path, bad: float):
    with pytest.raises(ValueError, match="finite"):
        write_flow(tmp_path / "a.npy", np.full((2, 2, 2), bad))


def test_values_a_format_cannot_say_are_refused(tmp_path: Path):
    with pytest.raises(ValueError, match=r"512.*got -513"):
        write_flow(tmp_path / "a.png", np.full((2, 2, 2), -513.0))
    with pytest.raises(ValueError, match="512"):
        write_flow(tmp_path / "a.png", np.full((2, 2, 2), 512.0))
    with pytest.raises(ValueError, match=r"1e\+09"):
        write_flow(tmp_path / "a.flo", np.full((2, 2, 2), 1.5e9))
    write_flow(tmp_path / "a.npy", np.full((2, 2, 2), 1.5e9))


@pytest.mark.parametrize("dtype", [bool, complex, object, "U3"])
def test_other_types_are_refused(tmp_path: Path, dtype: type):
    with pytest.raises(TypeError, match="real numbers"):
        write_flow(tmp_path / "a.flo", np.zeros((2, 2, 2), dtype))


def test_paths_that_are_none(tmp_path: Path):
    with pytest.raises(ValueError, match=r"must end in one of \.flo"):
        read_flow(tmp_path / "a.txt")
    with pytest.raises(TypeError, match="path must be"):
        read_flow(3)
    with pytest.raises(FileNotFoundError, match=r"none\.flo"):
        read_flow(tmp_path / "none.flo")
    with pytest.raises(FileNotFoundError, match="folder"):
        write_flow(tmp_path / "no" / "a.flo", field())


def test_a_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch):
    target = tmp_path / "a.flo"
    write_flow(target, field())
    old = target.read_bytes()

    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(Path, "write_bytes", fail)
    with pytest.raises(OSError, match="disk full"):
        write_flow(target, field(seed=1))
    assert target.read_bytes() == old
    assert list(tmp_path.iterdir()) == [target]


def test_links_and_permissions_survive(tmp_path: Path):
    (tmp_path / "real.flo").touch()
    (tmp_path / "real.flo").chmod(0o640)
    (tmp_path / "link.flo").symlink_to("real.flo")
    write_flow(tmp_path / "link.flo", field())
    assert (tmp_path / "link.flo").is_symlink()
    assert (tmp_path / "real.flo").stat().st_mode & 0o777 == 0o640
    np.testing.assert_array_equal(read_flow(tmp_path / "real.flo"), field())
