"""Sequences: exact round trips, order and choice of files, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from picture_helpers import assert_same, frames_of
from PIL import Image
from unsmear.images import read_image, write_image
from unsmear.sequences import natural_key, read_frames, write_frames

DTYPES = [np.uint8, np.uint16]


# --- round trips -------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_tiff_keeps_floats_as_they_are(tmp_path: Path, dtype: type):
    stack = frames_of(dtype, 4, 6, 5) * dtype(300) - dtype(7)
    stack[0, 0, 0] = np.nan
    write_frames(tmp_path / "a.tiff", stack)
    assert_same(read_frames(tmp_path / "a.tiff"), stack)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("shape", [(3, 5, 7), (3, 5, 7, 3), (1, 4, 6), (3, 1, 1)])
@pytest.mark.parametrize("target", ["out", "out/", "deep/er/out", "a.tif"])
def test_sequence_round_trip(tmp_path: Path, dtype: type, shape, target: str):
    frames = frames_of(dtype, *shape)
    path = f"{tmp_path}/{target}"
    write_frames(path, frames)
    assert_same(read_frames(path), frames)


def test_folder_names_and_floats_as_sixteen_bit(tmp_path: Path):
    frames = np.array([[[0.0, 0.25]], [[0.5, 1.0]]])
    write_frames(tmp_path / "out", frames)
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == ["frame_0000.png", "frame_0001.png"]
    # 65535 / 4 = 16383.75 and 65535 / 2 = 32767.5, rounded to nearest, ties to even.
    expected = np.array([[[0, 16384]], [[32768, 65535]]], np.uint16)
    assert_same(read_frames(tmp_path / "out"), expected)


def test_gif_keeps_equal_frames_and_grey_levels(tmp_path: Path):
    frames = np.repeat(frames_of(np.uint8, 2, 20, 16), 3, axis=0)
    write_frames(tmp_path / "a.gif", frames, fps=10)
    expected = np.repeat(frames[..., None], 3, axis=-1)
    assert_same(read_frames(tmp_path / "a.gif"), expected)
    with Image.open(tmp_path / "a.gif") as picture:
        assert picture.info["duration"] == 100  # ms
        assert picture.info["loop"] == 0


def test_any_memory_layout_gives_the_same_file(tmp_path: Path):
    frames = frames_of(np.uint16, 3, 5, 7)
    wide = np.zeros((3, 10, 14), np.uint16)
    wide[:, ::2, ::2] = frames
    read_only = frames.copy()
    read_only.flags.writeable = False
    forms = [np.asfortranarray(frames), frames[::-1].copy()[::-1], wide[:, ::2, ::2]]
    forms += [read_only, frames.astype(">u2"), frames[..., None]]
    forms += [np.ma.MaskedArray(frames), list(frames)]
    for form in forms:
        write_frames(tmp_path / "out", form)
        assert_same(read_frames(tmp_path / "out"), frames)


# --- which files, and in which order -----------------------------------------------


def test_natural_order():
    names = ["f10.png", "f2.png", "F1.png", "f02.png", "g1.png", "f2b.png", "f.png"]
    expected = ["F1.png", "f02.png", "f2.png", "f2b.png", "f10.png", "f.png", "g1.png"]
    assert sorted(names, key=natural_key) == expected
    assert natural_key("a" + "9" * 5000) < natural_key("a1" + "0" * 5000)


def numbered(folder: Path, *numbers: int) -> None:
    folder.mkdir(exist_ok=True)
    for n in numbers:
        write_image(folder / f"im{n}.png", np.full((2, 3), n, np.uint8))


def test_folder_glob_and_list(tmp_path: Path):
    numbered(tmp_path / "clip", 10, 9, 2, 100)
    (tmp_path / "clip" / "README.txt").write_text("not a picture")
    (tmp_path / "clip" / ".hidden.png").write_text("not a picture")
    (tmp_path / "clip" / "folder.png").mkdir()
    clip = tmp_path / "clip"
    assert list(read_frames(clip)[:, 0, 0]) == [2, 9, 10, 100]
    assert list(read_frames(f"{clip}/*")[:, 0, 0]) == [2, 9, 10, 100]
    assert list(read_frames(str(clip / "im1*.png"))[:, 0, 0]) == [10, 100]
    assert list(read_frames(f"{tmp_path}/**/im?.png")[:, 0, 0]) == [2, 9]
    given = [clip / "im9.png", str(clip / "im2.png")]
    assert list(read_frames(given)[:, 0, 0]) == [9, 2]
    assert read_frames(clip / "im9.png").shape == (1, 2, 3)


def test_names_that_look_like_globs(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    numbered(Path("clip[1]"), 3, 4)
    assert list(read_frames("clip[1]")[:, 0, 0]) == [3, 4]
    assert list(read_frames("clip[1]/im3.png")[:, 0, 0]) == [3]
    assert list(read_frames("clip*/im?.png")[:, 0, 0]) == [3, 4]


@pytest.mark.parametrize(
    "other",
    [
        np.zeros((2, 4), np.uint8),
        np.zeros((2, 3), np.uint16),
        np.zeros((2, 3, 3), np.uint8),
    ],
)
def test_frames_that_disagree(tmp_path: Path, other: np.ndarray):
    numbered(tmp_path, 1, 2, 4)
    write_image(tmp_path / "im3.png", other)
    with pytest.raises(ValueError, match="must agree") as caught:
        read_frames(tmp_path)
    message = str(caught.value)
    assert "im3.png" in message
    assert "(2, 3) uint8" in message
    assert f"{other.shape} {other.dtype}" in message


def test_sources_without_pictures(tmp_path: Path):
    (tmp_path / "notes.txt").touch()
    with pytest.raises(ValueError, match=r"source must hold pictures.*notes\.txt"):
        read_frames(tmp_path)
    with pytest.raises(ValueError, match="source must match pictures"):
        read_frames(tmp_path / "*.png")
    with pytest.raises(FileNotFoundError, match=r"none\.png"):
        read_frames(tmp_path / "none.png")
    with pytest.raises(ValueError, match="at least one picture"):
        read_frames([])
    with pytest.raises(TypeError, match="source must be"):
        read_frames(3)
    with pytest.raises(TypeError, match="each item of source"):
        read_frames([np.zeros((2, 2))])


def test_stacks_among_single_pictures(tmp_path: Path):
    write_frames(tmp_path / "a.tif", frames_of(np.uint8, 3, 4, 5))
    with pytest.raises(ValueError, match=r"one picture, got 3.*a\.tif"):
        read_frames(tmp_path)
    with pytest.raises(ValueError, match="one picture, got 3"):
        read_image(tmp_path / "a.tif")


# --- refusals on writing -----------------------------------------------------------


@pytest.mark.parametrize("shape", [(0, 4, 5), (2, 0, 5), (4, 5), (2, 4, 5, 2), (3,)])
def test_wrong_shapes_are_refused(tmp_path: Path, shape: tuple[int, ...]):
    with pytest.raises(ValueError, match=r"frames must have shape \(T, H, W\)"):
        write_frames(tmp_path / "out", np.zeros(shape))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("bad", [np.nan, -0.1, 1.5, np.inf])
def test_floats_an_integer_cannot_say_are_refused(tmp_path: Path, bad: float):
    frames = np.full((2, 3, 5), 0.5)
    frames[1, 2, 3] = bad
    for name in ("out", "a.gif"):
        with pytest.raises(ValueError, match=r"\[0, 1\]"):
            write_frames(tmp_path / name, frames)
    assert not list(tmp_path.iterdir())


def test_a_colour_picture_is_not_a_sequence(tmp_path: Path):
    with pytest.raises(ValueError, match="one colour picture"):
        write_frames(tmp_path / "out", np.zeros((8, 9, 3), np.uint8))


@pytest.mark.parametrize("dtype", [np.int32, np.uint32, np.int8, complex, object])
def test_other_types_are_refused(tmp_path: Path, dtype: type):
    with pytest.raises(TypeError, match="frames must be"):
        write_frames(tmp_path / "out", np.zeros((2, 4, 5), dtype))


def test_left_over_frames_are_not_mixed_in(tmp_path: Path):
    write_frames(tmp_path, frames_of(np.uint8, 5, 4, 6))
    with pytest.raises(ValueError, match=r"frame_0003\.png and 1 more"):
        write_frames(tmp_path, frames_of(np.uint8, 3, 4, 6, seed=1))
    assert_same(read_frames(tmp_path), frames_of(np.uint8, 5, 4, 6))


def test_wrong_targets_and_rates(tmp_path: Path):
    frames = np.zeros((2, 4, 5), np.uint8)
    with pytest.raises(ValueError, match="must be a folder or end in one of"):
        write_frames(tmp_path / "a.xyz", frames)
    with pytest.raises(ValueError, match="fps must be None"):
        write_frames(tmp_path / "out", frames, fps=25)
    for bad in (0, -1, np.nan, np.inf):
        with pytest.raises(ValueError, match="fps must be a positive"):
            write_frames(tmp_path / "a.gif", frames, fps=bad)
    with pytest.raises(TypeError, match="fps"):
        write_frames(tmp_path / "a.gif", frames, fps="25")
    with pytest.raises(ValueError, match="path must end in one of"):
        write_image(tmp_path / "a.gif", frames[0])
