"""Flow files: exact round trips, the published layouts byte by byte, hostile files."""

from __future__ import annotations

import io
import os
import pickle
import struct
import tracemalloc
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from unsmear.flow_files import FlowFileError, read_flow, write_flow

SUFFIXES = [".flo", ".pfm", ".png", ".npy", ".npz", ".flo5"]
BYTE_SUFFIXES = SUFFIXES[:-1]  # decoded by our own code


def field(height: int = 5, width: int = 7, seed: int = 0) -> np.ndarray:
    """A field on KITTI's grid of 1/64 px, so that every format keeps it exactly."""
    steps = np.random.default_rng(seed).integers(-2000, 2000, (height, width, 2))
    flow = (steps / 64).astype(np.float32)
    flow[height // 2, width // 3] = np.nan
    return flow


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


def png(depth: int, colour_type: int, width: int, height: int, scanlines: bytes):
    """A PNG from the chunk layout of its specification, unfiltered scanlines."""
    head = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n"
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(scanlines)), (b"IEND", b""))
    for kind, body in parts:
        checksum = zlib.crc32(kind + body)
        data += struct.pack(">I", len(body)) + kind + body + struct.pack(">I", checksum)
    return data


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


# --- hostile files -----------------------------------------------------------------


def refused(path: Path, data: bytes, match: str | None = None) -> None:
    path.write_bytes(data)
    with pytest.raises(FlowFileError, match=match) as caught:
        read_flow(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("suffix", BYTE_SUFFIXES)
def test_truncation_at_every_byte(tmp_path: Path, suffix: str):
    path = tmp_path / f"a{suffix}"
    write_flow(path, field(3, 4))
    data = path.read_bytes()
    for length in range(len(data)):
        refused(path, data[:length])


@pytest.mark.parametrize("suffix", BYTE_SUFFIXES)
def test_trailing_bytes(tmp_path: Path, suffix: str):
    path = tmp_path / f"a{suffix}"
    write_flow(path, field(3, 4))
    data = path.read_bytes()
    for tail in (b"\0", b"\n", b"12345678", data):
        # Two whole zip archives in a row are one archive by the rules of zip.
        if not (suffix == ".npz" and tail == data):
            refused(path, data + tail)


@pytest.mark.parametrize("suffix", BYTE_SUFFIXES)
def test_flipped_bytes_are_refused_or_give_a_field(tmp_path: Path, suffix: str):
    path = tmp_path / f"a{suffix}"
    write_flow(path, field(3, 4))
    data = bytearray(path.read_bytes())
    rng = np.random.default_rng(7)
    outcomes = {"field": 0, "refused": 0}
    for _ in range(1500):
        broken = data.copy()
        for position in rng.integers(0, len(data), rng.integers(1, 4)):
            broken[position] ^= int(rng.integers(1, 256))
        path.write_bytes(broken)
        try:
            flow = read_flow(path)
        except FlowFileError:
            outcomes["refused"] += 1
        else:
            outcomes["field"] += 1
            assert flow.dtype == np.float32
            assert flow.ndim == 3
            assert flow.shape[2] == 2
            assert not np.isinf(flow).any()
            assert (np.isnan(flow[..., 0]) == np.isnan(flow[..., 1])).all()
    assert outcomes["refused"] > 100


def test_truncated_hdf5(tmp_path: Path):
    pytest.importorskip("h5py")
    path = tmp_path / "a.flo5"
    write_flow(path, field(3, 4))
    data = path.read_bytes()
    for length in range(0, len(data), 97):
        refused(path, data[:length])


SIZES = [(-5, 3), (3, -5), (0, 3), (2_000_000_000, 2_000_000_000), (2**31 - 1, 1)]


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_absurd_sizes_allocate_nothing(tmp_path: Path, width: int, height: int):
    body = bytes(64)
    npy = io.BytesIO()
    shape = (max(height, 0), max(width, 0), 2)
    header = {"descr": "<f4", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(npy, header)
    npz = io.BytesIO()
    with zipfile.ZipFile(npz, "w") as archive:
        archive.writestr("flow.npy", npy.getvalue() + body)
    files = {
        "a.flo": struct.pack("<4s2i", b"PIEH", width, height) + body,
        "a.pfm": f"PF\n{width} {height}\n-1.0\n".encode() + body,
        "a.png": png(16, 2, width % 2**32, height % 2**32, body),
        "a.npy": npy.getvalue() + body,
        "a.npz": npz.getvalue(),
    }
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
        tracemalloc.start()
        try:
            with pytest.raises(FlowFileError):
                read_flow(tmp_path / name)
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        # File objects, messages and tracebacks take some kB; the files ask for more
        # than 16 GB (or for nothing).
        assert peak < 1_000_000, name


def test_a_zip_bomb_is_not_inflated(tmp_path: Path):
    npz = io.BytesIO()
    with zipfile.ZipFile(npz, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("flow.npy", bytes(1000))
    data = npz.getvalue()
    # The size the directory promises, a little-endian 32-bit number, raised to 4 GB.
    promised = struct.pack("<I", 1000)
    refused(tmp_path / "a.npz", data.replace(promised, b"\xff\xff\xff\x7f"), "size")


@pytest.mark.parametrize(
    ("name", "data", "match"),
    [
        ("a.flo", b"", "magic"),
        ("a.flo", b"HEIP" + bytes(20), "magic"),
        ("a.pfm", b"Pf\n1 1\n-1\n" + bytes(4), "3 channels"),
        ("a.pfm", b"PF\n1 1\n0\n" + bytes(12), "scale"),
        ("a.pfm", b"PF\n1 1\nnan\n" + bytes(12), "scale"),
        ("a.pfm", b"PF\n1.5 1\n-1\n" + bytes(12), "integers"),
        ("a.pfm", b"PF\n1 1\n-1\n" + struct.pack("<3f", 1, 2, 7), "third channel"),
        ("a.png", png(8, 2, 1, 1, b"\0123"), "16-bit RGB"),
        ("a.png", png(16, 0, 1, 1, b"\0" * 3), "16-bit RGB"),
        ("a.png", png(16, 2, 1, 1, b"\0" * 6 + b"\2"), "blue channel"),
        ("a.png", png(16, 2, 1, 1, b"\7" + bytes(6)), "filter types"),
        ("a.png", png(16, 2, 1, 1, bytes(8)), "scanlines"),
        ("a.npz", b"PK\x03\x04" + bytes(30), "zip"),
    ],
)
def test_malformed_files(tmp_path: Path, name: str, data: bytes, match: str):
    refused(tmp_path / name, data, match)


@pytest.mark.parametrize(
    ("array", "match"),
    [
        (np.zeros((2, 3, 2), np.int32), "floats"),
        (np.zeros((2, 3, 2), complex), "floats"),
        (np.zeros((2, 3, 3), np.float32), "shape"),
        (np.zeros((2, 3), np.float32), "shape"),
        (np.zeros((0, 3, 2), np.float32), "shape"),
        (np.zeros((2, 3, 2), [("u", "f4")]), "floats"),
    ],
)
def test_npy_of_another_kind(tmp_path: Path, array: np.ndarray, match: str):
    buffer = io.BytesIO()
    np.save(buffer, array)
    refused(tmp_path / "a.npy", buffer.getvalue(), match)
    np.savez(tmp_path / "b.npz", flow=array)
    refused(tmp_path / "b.npz", (tmp_path / "b.npz").read_bytes(), match)


class Trap:
    """Runs a command when unpickled."""

    def __reduce__(self):
        return (os.mkdir, ("trapped",))


def test_pickles_are_refused_and_never_run(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    array = np.empty((1, 1, 2), object)
    array[:] = Trap()
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=True)
    refused(tmp_path / "a.npy", buffer.getvalue(), "floats")
    refused(tmp_path / "b.npy", pickle.dumps(Trap()), "magic")
    assert not (tmp_path / "trapped").exists()


def test_npz_without_the_key_names_what_is_there(tmp_path: Path):
    np.savez(tmp_path / "a.npz", velocity=field())
    with pytest.raises(FlowFileError, match=r"velocity\.npy"):
        read_flow(tmp_path / "a.npz")
