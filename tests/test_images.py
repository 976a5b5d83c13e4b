"""Single pictures: exact round trips, published layouts, broken files."""

from __future__ import annotations

import struct
import zlib
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import tifffile
from picture_helpers import assert_same, frames_of
from PIL import Image
from unsmear.images import read_image, write_image
from unsmear.sequences import read_frames, write_frames

DTYPES = [np.uint8, np.uint16]


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3), (1, 1), (1, 9), (8, 1, 3)])
@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_picture_round_trip(tmp_path: Path, dtype: type, shape, suffix: str):
    image = frames_of(dtype, *shape)
    write_image(tmp_path / f"a{suffix}", image)
    assert_same(read_image(tmp_path / f"a{suffix}"), image)
    assert len(list(tmp_path.iterdir())) == 1


def test_booleans_become_black_and_white(tmp_path: Path):
    write_image(tmp_path / "a.png", np.array([[True, False]]))
    assert_same(read_image(tmp_path / "a.png"), np.array([[255, 0]], np.uint8))


def test_eight_bit_formats_round_deeper_pictures(tmp_path: Path):
    deep = np.array([[0, 128, 129, 257, 65535]], np.uint16)
    write_image(tmp_path / "a.bmp", deep)
    # 65535 / 255 = 257: 128 / 257 rounds to 0 and 129 / 257 to 1.
    expected = np.array([[0, 0, 1, 1, 255]], np.uint8)
    assert_same(read_image(tmp_path / "a.bmp"), expected)


def png_file(head: bytes, lines: bytes) -> bytes:
    """Put an IHDR body and filtered scanlines into the chunks of a PNG."""
    data = b"\x89PNG\r\n\x1a\n"
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(lines)), (b"IEND", b""))
    for name, body in parts:
        crc = struct.pack(">I", zlib.crc32(name + body))
        data += struct.pack(">I", len(body)) + name + body + crc
    return data


@pytest.mark.parametrize("shape", [(1, 1), (3, 2), (8, 8), (11, 13)])
def test_interlaced_deep_png(tmp_path: Path, shape: tuple[int, int]):
    # The pass of each pixel of an 8 x 8 tile, from the figure in the specification.
    tile = """16462646 77777777 56565656 77777777
              36463646 77777777 56565656 77777777"""
    passes = np.array([[int(n) for n in row] for row in tile.split()])
    image = frames_of(np.uint16, *shape, 3)
    numbers = np.tile(passes, (2, 2))[: shape[0], : shape[1]]
    lines = b""
    for n in range(1, 8):
        for row, place in zip(image, numbers == n, strict=True):
            if place.any():
                lines += b"\0" + row[place].astype(">u2").tobytes()
    head = struct.pack(">IIBBBBB", shape[1], shape[0], 16, 2, 0, 0, 1)
    (tmp_path / "a.png").write_bytes(png_file(head, lines))
    assert_same(read_image(tmp_path / "a.png"), image)


@pytest.mark.parametrize("colour_type", [0, 2, 4, 6])
@pytest.mark.parametrize("levels", [2**16, 5])
def test_deep_png_from_its_layout(tmp_path: Path, colour_type: int, levels: int):
    """Build each 16-bit kind by hand with every row filter.

    With 5 levels the candidates of the Paeth filter often tie.
    """
    channels = {0: 1, 2: 3, 4: 2, 6: 4}[colour_type]
    image = frames_of(np.uint16, 20, 9, channels) % np.uint32(levels)
    image = image.astype(np.uint16)
    rows = image.astype(">u2").view(np.uint8).reshape(20, -1).astype(int)
    step = 2 * channels
    lines = b""
    for y, row in enumerate(rows):
        left = [0] * step + list(row[:-step])
        up = list(rows[y - 1]) if y else [0] * len(row)
        corner = [0] * step + up[:-step]
        kind = y % 5
        predicted = []
        for a, b, c in zip(left, up, corner, strict=True):
            nearest = min((a, b, c), key=lambda n: abs(a + b - c - n))
            predicted.append([0, a, b, (a + b) // 2, nearest][kind])
        lines += bytes([kind, *(int(v) for v in (row - predicted) % 256)])
    head = struct.pack(">IIBBBBB", 9, 20, 16, colour_type, 0, 0, 0)
    (tmp_path / "a.png").write_bytes(png_file(head, lines))
    expected = image[..., 0] if channels < 3 else image[..., :3]
    assert_same(read_image(tmp_path / "a.png"), expected)


@pytest.mark.parametrize("mode", ["P", "RGBA", "LA", "1", "CMYK"])
def test_other_pixel_modes(tmp_path: Path, mode: str):
    colours = np.zeros((4, 6, 3), np.uint8)
    colours[:2, :, 0] = 255
    colours[2:] = 255
    picture = Image.fromarray(colours)
    if mode == "RGBA":
        picture.putalpha(Image.fromarray(np.full((4, 6), 9, np.uint8)))
    elif mode == "LA":
        picture = picture.convert("L").convert("LA")
        picture.putalpha(3)
    elif mode == "P":
        picture = picture.quantize(4)
    else:
        picture = picture.convert(mode)
    name = "a.tif" if mode == "CMYK" else "a.png"
    picture.save(tmp_path / name)
    read = read_image(tmp_path / name)
    if mode == "LA":
        # The red of the upper half as Rec. 601 luma, 0.299 * 255 = 76.
        expected = np.where(np.arange(4)[:, None] < 2, 76, 255) + np.zeros((4, 6))
        assert_same(read, expected.astype(np.uint8))
    elif mode == "1":
        assert read.shape == (4, 6)
        assert set(np.unique(read)) <= {0, 255}
    else:
        assert_same(read, colours)


def test_camera_orientation_is_applied(tmp_path: Path):
    image = frames_of(np.uint8, 4, 6)
    exif = Image.Exif()
    exif[274] = 6  # the first row is the right edge: turn clockwise by 90 degrees
    Image.fromarray(image).save(tmp_path / "a.png", exif=exif)
    assert_same(read_image(tmp_path / "a.png"), np.rot90(image, -1))
    extra = [(274, "H", 1, 6, True)]
    tifffile.imwrite(tmp_path / "a.tif", image, extratags=extra, metadata=None)
    assert_same(read_image(tmp_path / "a.tif"), np.rot90(image, -1))


def test_tiff_of_other_layouts(tmp_path: Path):
    colour = frames_of(np.uint16, 5, 6, 3)
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, colour, photometric="rgb", compression="zlib")
    assert_same(read_image(path), colour)
    planes = colour.transpose(2, 0, 1)
    tifffile.imwrite(path, planes, photometric="rgb", planarconfig="separate")
    assert_same(read_image(path), colour)
    with_alpha = np.concatenate([colour, colour[..., :1]], axis=-1)
    tifffile.imwrite(path, with_alpha, photometric="rgb", extrasamples=["unassalpha"])
    assert_same(read_image(path), colour)
    tifffile.imwrite(path, colour[..., 0], photometric="miniswhite")
    assert_same(read_image(path), 65535 - colour[..., 0])
    stack = frames_of(np.uint8, 3, 5, 6)
    with tifffile.TiffWriter(path) as writer:  # pages without a word on their axes
        for page in stack:
            writer.write(page, photometric="minisblack", metadata=None)
    assert_same(read_frames(path), stack)


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.jpg", "a.bmp", "a.gif"])
@pytest.mark.parametrize("dtype", DTYPES)
def test_truncated_pictures(tmp_path: Path, name: str, dtype: type):
    path = tmp_path / name
    image = frames_of(dtype, 9, 11, 3)
    if name == "a.gif":
        write_frames(path, image[None])
    else:
        write_image(path, image)
    data = path.read_bytes()
    whole = read_frames(path)
    for length in range(0, len(data), max(1, len(data) // 150)):
        path.write_bytes(data[:length])
        if length <= 0.9 * len(data):
            with pytest.raises(ValueError, match=name):
                read_frames(path)
            continue
        with suppress(ValueError):  # only bytes after the last pixel may be missing
            np.testing.assert_array_equal(read_frames(path), whole)


@pytest.mark.parametrize("name", ["a.gif", "a.tif"])
def test_a_cut_stack_is_not_a_shorter_one(tmp_path: Path, name: str):
    path = tmp_path / name
    frames = frames_of(np.uint8, 4, 6, 8)
    if name == "a.tif":  # every page with its own directory, as cameras write them
        with tifffile.TiffWriter(path) as writer:
            for page in frames:
                writer.write(page, photometric="minisblack", metadata=None)
    else:
        write_frames(path, frames)
    data = path.read_bytes()
    lengths = set()
    for length in range(1, len(data)):
        path.write_bytes(data[:length])
        try:
            lengths.add(len(read_frames(path)))
        except ValueError:
            lengths.add(0)
    assert lengths <= {0, 4}


def test_text_in_a_picture_name(tmp_path: Path):
    (tmp_path / "a.png").write_text("hello")
    with pytest.raises(ValueError, match=r"a\.png"):
        read_frames(tmp_path)
    (tmp_path / "a.png").write_bytes(b"")
    with pytest.raises(ValueError, match=r"a\.png.*empty"):
        read_frames(tmp_path)
