"""The bundled clip: what it says it is, and made by its script."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import unsmear

ROOT = Path(__file__).parent.parent


def test_clip_is_small_blurred_and_true() -> None:
    clip = unsmear.demo_clip()
    assert clip.blurred.shape == clip.sharp.shape == (5, 216, 288, 3)
    assert clip.flow.shape == (5, 216, 288, 2) and np.isfinite(clip.flow).all()
    folder = ROOT / "python" / "unsmear" / "data" / "demo"
    size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    assert size < 1.5e6
    assert "public domain" in (folder / "README.md").read_text()


def test_the_flow_carries_each_sharp_frame_into_the_next() -> None:
    clip = unsmear.demo_clip()
    y, x = np.mgrid[:216, :288].astype(float)
    luma = clip.sharp.mean(axis=-1)
    u, v = clip.flow[2][..., 0], clip.flow[2][..., 1]
    back = unsmear._unsmear.sample(luma[3], y + v, x + u, 3, "replicate")
    error = np.abs(back - luma[2])[12:-12, 12:-12]
    # All but the few per cent that the disc hides or uncovers; unmoved: 6 levels.
    assert np.median(error) < 1.0 < np.median(np.abs(luma[3] - luma[2]))


def test_the_script_makes_the_same_pictures(tmp_path: Path) -> None:
    pytest.importorskip("skimage", reason="the script reads scikit-image's pictures")
    script = runpy.run_path(str(ROOT / "scripts" / "make_demo_clip.py"))
    script["main"](tmp_path)
    clip = unsmear.demo_clip()
    for name in ("blurred", "sharp"):
        made = unsmear.read_frames(tmp_path / name)
        np.testing.assert_array_equal(made, getattr(clip, name))
    assert (tmp_path / "flow" / "frame_0002.png").read_bytes() == (
        ROOT / "python/unsmear/data/demo/flow/frame_0002.png"
    ).read_bytes()
