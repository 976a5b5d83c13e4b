"""Flow fields as bytes: .flo, .pfm, KITTI .png, .npy and .npz, both ways.

Every decoder turns a whole file into (H, W, 2) float32, u right and v down in
px/frame, NaN = unknown, and raises `FormatError` for anything that is not exactly one
well-formed field. Sizes are read as Python integers and compared with the bytes at
hand before an array is made, so that no header can ask for memory the file does not
fill. A pixel with one unknown component is unknown.

Layouts
-------
.flo    "PIEH" (the float 202021.25), int32 width, int32 height, then float32 u, v per
        pixel, rows from the top, little-endian; |value| > 1e9 = unknown, written 1e10.
.pfm    "PF", width, height, scale as text, then three float32 per pixel, rows from
        the bottom; scale < 0 = little-endian, its magnitude has no agreed meaning and
        is ignored. Channels u, v, w: w = 0 everywhere (FlyingThings3D) says nothing,
        otherwise w = 1 known, 0 unknown.
.png    16-bit RGB (KITTI): R = 64 u + 2^15, G = 64 v + 2^15, B = 1 known, 0 unknown.
        u and v lie in [-512, 511.984] in steps of 1/64 px.
.npy    NumPy's array format, a float array of shape (H, W, 2); .npz: under key "flow".

References
----------
S. Baker et al., "A database and evaluation methodology for optical flow", Int. J.
Comput. Vis. 92 (2011), doi:10.1007/s11263-010-0390-2 (.flo).
N. Mayer et al., "A large dataset to train convolutional networks for disparity,
optical flow, and scene flow estimation", CVPR 2016, doi:10.1109/CVPR.2016.438 (.pfm).
M. Menze and A. Geiger, "Object scene flow for autonomous vehicles", CVPR 2015,
doi:10.1109/CVPR.2015.7298925 (KITTI .png).
NumPy Enhancement Proposal 1, "A simple file format for NumPy arrays" (.npy, .npz).
"""

from __future__ import annotations

import io
import re
import struct
import zipfile
import zlib
from math import isfinite, prod
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._format_error import FormatError
from unsmear._png import decode_png16, encode_png16, read_header

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Flow = NDArray[np.float32]

FLO_UNKNOWN = 1e9  # a larger magnitude means unknown
_FLO_WRITTEN = 1e10  # what unknown pixels are written as
_FLO_MAGIC = b"PIEH"
_KITTI_STEPS = 64  # per pixel
_KITTI_ZERO = 2**15
# Deflate codes at most 258 bytes in 2 bits: it cannot shrink data further than this.
DEFLATE_LIMIT = 1032
_NPZ_KEY = "flow"


def decode_flo(data: bytes) -> Flow:
    """Decode a Middlebury .flo file."""
    if data[:4] != _FLO_MAGIC:
        raise FormatError(f"the magic {_FLO_MAGIC!r}", f"{data[:4]!r}")
    _require_length(data, 12, at_least=True)
    width, height = struct.unpack("<ii", data[4:12])
    _require_sizes(width, height)
    _require_length(data, 12 + 8 * width * height)
    flow = np.frombuffer(data, "<f4", offset=12).reshape(height, width, 2)
    with np.errstate(invalid="ignore"):
        known = (np.abs(flow) <= FLO_UNKNOWN).all(axis=-1)  # False for NaN as well
    return _masked(flow, known)


def encode_flo(flow: Flow) -> bytes:
    """Encode as Middlebury .flo; known values above 1e9 cannot be told from unknown."""
    if (np.abs(flow) > FLO_UNKNOWN).any():
        raise FormatError(f"magnitudes up to {FLO_UNKNOWN:g}", f"{_largest(flow):g}")
    height, width = flow.shape[:2]
    values = np.where(np.isnan(flow), np.float32(_FLO_WRITTEN), flow).astype("<f4")
    return _FLO_MAGIC + struct.pack("<ii", width, height) + values.tobytes()


def decode_pfm(data: bytes) -> Flow:
    """Decode a three-channel portable float map."""
    number = rb"([-+.\w]{1,32})"
    head = re.match(rb"(P\w)\s+" + number + rb"\s+" + number + rb"\s+" + number, data)
    if head is None or head[1] != b"PF":
        raise FormatError("'PF width height scale' (3 channels)", f"{data[:20]!r}")
    try:
        width, height, scale = int(head[2]), int(head[3]), float(head[4])
    except ValueError:
        raise FormatError("two integers and a number", f"{head[0]!r}") from None
    _require_sizes(width, height)
    if not isfinite(scale) or scale == 0:
        raise FormatError("a finite scale that is not 0", f"{scale}")
    start = head.end() + 1  # exactly one byte of white space ends the header
    _require_length(data, start + 12 * width * height)
    if not data[start - 1 : start].isspace():
        raise FormatError("white space after the scale", f"{data[start - 1 : start]!r}")
    raw = np.frombuffer(data, "<f4" if scale < 0 else ">f4", offset=start)
    rows = raw.reshape(height, width, 3)[::-1]
    flow, third = rows[..., :2], rows[..., 2]
    known = np.isfinite(flow).all(axis=-1)
    if not np.isin(third, (0, 1)).all():
        raise FormatError("a third channel of 0 and 1 only", "other values")
    if third.any():
        known &= third == 1
    return _masked(flow, known)


def encode_pfm(flow: Flow) -> bytes:
    """Encode as little-endian PFM with the mask of known pixels in channel three."""
    height, width = flow.shape[:2]
    known = ~np.isnan(flow[..., :1])
    rows = np.concatenate([flow, known], axis=-1, dtype="<f4")[::-1]
    return f"PF\n{width} {height}\n-1.0\n".encode() + rows.tobytes()


def decode_kitti(data: bytes) -> Flow:
    """Decode a KITTI flow picture."""
    header = read_header(data)
    if (header.depth, header.colour_type) != (16, 2):
        got = f"bit depth {header.depth}, colour type {header.colour_type}"
        raise FormatError("a 16-bit RGB picture (depth 16, colour type 2)", got)
    picture = decode_png16(data, allow_trailing=False)
    valid = picture[..., 2]
    if valid.max() > 1:
        raise FormatError("a blue channel of 0 and 1 only", f"{valid.max()}")
    flow = (picture[..., :2].astype(np.float32) - _KITTI_ZERO) / _KITTI_STEPS
    return _masked(flow, valid == 1)


def encode_kitti(flow: Flow) -> bytes:
    """Encode as a KITTI flow picture, rounded to 1/64 px."""
    steps = np.rint(flow.astype(np.float64) * _KITTI_STEPS) + _KITTI_ZERO
    if (steps < 0).any() or (steps > np.iinfo(np.uint16).max).any():
        raise FormatError("u and v in [-512, 511.984]", f"{_largest(flow):g}")
    known = ~np.isnan(flow[..., :1])
    picture = np.concatenate([np.where(known, steps, 0), known], axis=-1)
    return encode_png16(picture.astype(np.uint16))


def decode_npy(data: bytes) -> Flow:
    """Decode an .npy file holding a float array of shape (H, W, 2)."""
    if data[:6] != b"\x93NUMPY" or len(data) < 12:
        raise FormatError("the magic b'\\x93NUMPY' and a header", f"{data[:6]!r}")
    size_bytes = 2 if data[6] == 1 else 4
    start = 8 + size_bytes + int.from_bytes(data[8 : 8 + size_bytes], "little")
    _require_length(data, start, at_least=True)
    # The header is a Python literal. Three searches read what a flow field needs and
    # never evaluate anything that a stranger wrote.
    header = data[8 + size_bytes : start].decode("latin-1")
    kind = re.search(r"'descr'\s*:\s*('[^']*'|\[)", header)
    order = re.search(r"'fortran_order'\s*:\s*(True|False)\b", header)
    dims = re.search(r"'shape'\s*:\s*\(([\d\s,]{0,80})\)", header)
    if not (kind and order and dims):
        raise FormatError("a header with descr, fortran_order, shape", header[:80])
    dtype = re.fullmatch(r"'([<>=]f[248])'", kind[1])
    if dtype is None:
        raise FormatError("floats of 2, 4 or 8 bytes", f"dtype {kind[1]}")
    shape = tuple(int(n) for n in dims[1].split(",") if n.strip().isdecimal())
    _require_shape(shape)
    _require_length(data, start + int(dtype[1][-1]) * prod(shape))
    flat = np.frombuffer(data, dtype[1], offset=start)
    flow = flat.reshape(shape, order="F" if order[1] == "True" else "C")
    with np.errstate(over="ignore"):
        narrow = flow.astype(np.float32)
    return _masked(narrow, np.asarray(np.isfinite(narrow).all(axis=-1)))


def encode_npy(flow: Flow) -> bytes:
    """Encode as .npy, little-endian float32."""
    buffer = io.BytesIO()
    np.save(buffer, flow.astype("<f4"), allow_pickle=False)
    return buffer.getvalue()


def decode_npz(data: bytes) -> Flow:
    """Decode an .npz archive whose key ``flow`` holds the field."""
    member = f"{_NPZ_KEY}.npy"
    # An archive without a comment ends with its 22-byte directory record; zipfile
    # itself would overlook bytes after it.
    if data[:4] != b"PK\x03\x04" or data[-22:-18] != b"PK\x05\x06":
        raise FormatError("a whole zip archive", f"{data[:4]!r} ... {data[-22:-18]!r}")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if member not in archive.namelist():
                keys = ", ".join(archive.namelist())[:80]
                raise FormatError(f"a key {_NPZ_KEY!r}", keys or "an empty archive")
            size = archive.getinfo(member).file_size
            if size > DEFLATE_LIMIT * len(data):
                raise FormatError("a size the archive can hold", f"{size} bytes")
            content = archive.read(member)
    except FormatError:
        raise
    except (ValueError, KeyError, RuntimeError, OSError, EOFError, OverflowError,
            zipfile.BadZipFile, zlib.error, struct.error) as error:  # fmt: skip
        raise FormatError("a sound zip archive", str(error)) from None
    return decode_npy(content)


def encode_npz(flow: Flow) -> bytes:
    """Encode as a compressed .npz archive with the key ``flow``."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, flow=flow)  # the keyword is _NPZ_KEY
    return buffer.getvalue()


def _masked(flow: NDArray[Any], known: NDArray[np.bool_]) -> Flow:
    result = np.array(flow, dtype=np.float32, order="C")
    result[~known] = np.nan
    return result


def _largest(flow: Flow) -> float:
    """Return the finite value of the largest magnitude, for messages."""
    values = flow[np.isfinite(flow)]
    return float(values[np.abs(values).argmax()])


def _require_sizes(width: int, height: int) -> None:
    if width < 1 or height < 1:
        raise FormatError("a width and height of at least 1", f"{width} x {height}")


def _require_shape(shape: tuple[int, ...]) -> None:
    if len(shape) != 3 or shape[2] != 2 or min(shape) < 1:
        raise FormatError("a shape (H, W, 2) with H, W >= 1", f"{shape}")


def _require_length(data: bytes, length: int, *, at_least: bool = False) -> None:
    if len(data) < length or (len(data) > length and not at_least):
        raise FormatError(f"{length} bytes", f"{len(data)} bytes")
