"""Flow fields in and out of files: .flo, .pfm, KITTI .png, .npy, .npz, .flo5.

A flow field is (H, W, 2) float32: u to the right and v down, in px/frame, from a frame
to the next; NaN = unknown in both components. The format follows from the suffix:

| suffix | exact round trip | unknown pixels | used by                      |
|--------|------------------|----------------|------------------------------|
| .flo   | yes, |u| <= 1e9  | written 1e10   | Middlebury, MPI Sintel       |
| .pfm   | yes              | NaN, mask      | FlyingThings3D, Driving      |
| .png   | to 1/64 px       | blue channel   | KITTI, HD1K; |u| <= 511.98   |
| .npy   | yes              | NaN            | NumPy                        |
| .npz   | yes, compressed  | NaN            | NumPy, key "flow"            |
| .flo5  | yes, compressed  | NaN            | Spring (HDF5, needs h5py)    |

The byte layouts and their sources stand in `_flow_codecs`; .flo5 is an HDF5 file with
one data set "flow" (L. Mehl et al., "Spring: a high-resolution high-detail dataset and
benchmark for scene flow, optical flow and stereo", CVPR 2023,
doi:10.1109/CVPR52729.2023.00482).
"""

from __future__ import annotations

import importlib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import _flow_codecs as codecs
from unsmear._atomic import atomic_path, write_bytes_atomic
from unsmear._format_error import FormatError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    Flow = NDArray[np.float32]

__all__ = ["FlowFileError", "read_flow", "write_flow"]

_DECODERS: dict[str, Callable[[bytes], Flow]] = {
    ".flo": codecs.decode_flo,
    ".pfm": codecs.decode_pfm,
    ".png": codecs.decode_kitti,
    ".npy": codecs.decode_npy,
    ".npz": codecs.decode_npz,
}
_ENCODERS: dict[str, Callable[[Flow], bytes]] = {
    ".flo": codecs.encode_flo,
    ".pfm": codecs.encode_pfm,
    ".png": codecs.encode_kitti,
    ".npy": codecs.encode_npy,
    ".npz": codecs.encode_npz,
}
_HDF5_SUFFIX = ".flo5"
_HDF5_KEY = "flow"
_HDF5_GZIP_LEVEL = 5  # what the Spring data set uses


class FlowFileError(ValueError):
    """A file that is not one sound flow field of the format its suffix names.

    Parameters
    ----------
    path : path-like
        The file.
    expected : str
        What the format demands.
    got : str
        What the file holds instead.
    """

    def __init__(self, path: str | os.PathLike[str], expected: str, got: str) -> None:
        super().__init__(f"{os.fspath(path)}: expected {expected}, got {got}")
        self.path = Path(path)
        self.expected = expected
        self.got = got


def read_flow(path: str | os.PathLike[str]) -> NDArray[np.float32]:
    """Read a flow field from a file.

    Parameters
    ----------
    path : path-like
        A .flo, .pfm, .png (KITTI, 16-bit RGB), .npy, .npz (key ``flow``) or .flo5 file;
        upper case is the same.

    Returns
    -------
    ndarray of shape (H, W, 2), float32
        (u, v) in px/frame, u right, v down. NaN in both = unknown; a pixel with one
        component unknown or infinite counts as unknown.

    Raises
    ------
    FlowFileError
        If the file is truncated, too long, corrupt or of another shape or type. No
        array is made before the file is known to fill it.
    FileNotFoundError
        If there is no such file.
    ValueError
        If the suffix names no known format.
    ImportError
        If .flo5 is asked for without h5py (``pip install "unsmear[hdf5]"``).

    Notes
    -----
    Formats and sources: the table at the head of this module.
    """
    source = _as_path(path)
    suffix = _known_suffix(source)
    if suffix == _HDF5_SUFFIX:
        return _read_hdf5(source)
    data = source.read_bytes()
    try:
        return _DECODERS[suffix](data)
    except FormatError as error:
        raise FlowFileError(source, error.expected, error.got) from None


def write_flow(path: str | os.PathLike[str], flow: ArrayLike) -> None:
    """Write a flow field to a file, whole or not at all.

    Parameters
    ----------
    path : path-like
        The target; its suffix names the format as in `read_flow`. An existing file is
        replaced at the end in one step.
    flow : array_like of shape (H, W, 2)
        (u, v) in px/frame, any real type and memory layout; NaN or masked = unknown.
        Stored as float32, in KITTI's format rounded to 1/64 px.

    Raises
    ------
    ValueError
        If the shape is wrong, a value is infinite (in float32), lies outside what the
        format can say (.png: [-512, 511.984]; .flo: 1e9), or the suffix is unknown.
    TypeError
        If ``flow`` is not an array of real numbers.
    FileNotFoundError
        If the folder does not exist.
    ImportError
        If .flo5 is asked for without h5py (``pip install "unsmear[hdf5]"``).

    Examples
    --------
    >>> import numpy as np, tempfile, pathlib
    >>> from unsmear.flow_files import read_flow, write_flow
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "truth.flo"
    >>> write_flow(path, np.full((2, 3, 2), 0.5))
    >>> read_flow(path).shape
    (2, 3, 2)
    """
    target = _as_path(path)
    suffix = _known_suffix(target)
    field = _as_writable_flow(flow)
    if suffix == _HDF5_SUFFIX:
        _write_hdf5(target, field)
        return
    try:
        data = _ENCODERS[suffix](field)
    except FormatError as error:
        raise ValueError(
            f"flow must have {error.expected} to be stored as {suffix}, "
            f"got {error.got}; .npy takes any value"
        ) from None
    write_bytes_atomic(target, data)


def _as_path(path: str | os.PathLike[str]) -> Path:
    if not isinstance(path, str | os.PathLike):
        raise TypeError(f"path must be a string or a path, got {type(path).__name__}")
    return Path(path)


def _known_suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix != _HDF5_SUFFIX and suffix not in _DECODERS:
        known = ", ".join([*_DECODERS, _HDF5_SUFFIX])
        raise ValueError(f"path must end in one of {known}, got {os.fspath(path)!r}")
    return suffix


def _as_writable_flow(flow: ArrayLike) -> Flow:
    """Check ``flow`` and return it as float32 with whole pixels known or unknown."""
    array: np.ma.MaskedArray[Any, Any] = np.ma.asanyarray(flow)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"flow must hold real numbers, got dtype {array.dtype}")
    if array.ndim != 3 or array.shape[2] != 2 or array.size == 0:
        raise ValueError(
            f"flow must have shape (H, W, 2) with H, W >= 1, got {array.shape}"
        )
    with np.errstate(over="ignore"):
        values: Flow = np.array(array.data, dtype=np.float32)
    values[np.ma.getmaskarray(array)] = np.nan
    if np.isinf(values).any():
        raise ValueError(
            "flow must be finite in float32, or NaN where it is unknown, "
            f"got {int(np.isinf(values).sum())} infinite values"
        )
    values[np.isnan(values).any(axis=-1)] = np.nan
    return values


def _import_h5py() -> Any:
    try:
        return importlib.import_module("h5py")
    except ImportError:
        raise ImportError(
            ".flo5 files are HDF5 and need h5py; install it with "
            'pip install "unsmear[hdf5]"'
        ) from None


def _read_hdf5(path: Path) -> Flow:
    h5py = _import_h5py()
    limit = codecs.DEFLATE_LIMIT * path.stat().st_size
    try:
        with h5py.File(path, "r") as archive:
            found = archive.get(_HDF5_KEY)
            if not isinstance(found, h5py.Dataset):
                keys = ", ".join(archive) or "an empty file"
                raise FormatError(f"a data set {_HDF5_KEY!r}", keys)
            shape, dtype = found.shape, found.dtype
            if shape is None or len(shape) != 3 or shape[2] != 2 or min(shape) < 1:
                raise FormatError("a shape (H, W, 2) with H, W >= 1", f"{shape}")
            if dtype.kind != "f":
                raise FormatError("real floats", f"dtype {dtype}")
            if found.nbytes > limit:
                raise FormatError("a size the file can hold", f"{found.nbytes} bytes")
            with np.errstate(over="ignore"):
                flow = np.array(found[()], dtype=np.float32)
    except FormatError as error:
        raise FlowFileError(path, error.expected, error.got) from None
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as error:
        raise FlowFileError(path, "a sound HDF5 file", str(error)) from None
    flow[~np.isfinite(flow).all(axis=-1)] = np.nan
    return flow


def _write_hdf5(path: Path, flow: Flow) -> None:
    h5py = _import_h5py()
    with atomic_path(path) as temporary, h5py.File(temporary, "w") as archive:
        archive.create_dataset(
            _HDF5_KEY,
            data=flow,
            compression="gzip",
            compression_opts=_HDF5_GZIP_LEVEL,
        )
