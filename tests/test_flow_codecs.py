"""Hostile flow files: cut, padded, flipped, absurd, of another kind; always refused."""

from __future__ import annotations

import io
import os
import pickle
import struct
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from flow_helpers import field, png
from unsmear.flow_files import FlowFileError, read_flow, write_flow

BYTE_SUFFIXES = [".flo", ".pfm", ".png", ".npy", ".npz"]  # decoded by our own code


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
