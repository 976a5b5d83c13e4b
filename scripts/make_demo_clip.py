"""Make the bundled demo clip: blurred frames, sharp frames, true flow.

Two pictures that ship inside scikit-image, both free of rights (see the README beside
the clip), become a scene: a camera pans and turns over the first while a disc cut from
the second crosses it. Each blurred frame integrates 96 pictures over the whole frame
interval, gets noise of one grey level and is rounded to 8 bits. The same versions give
the same files.

    python scripts/make_demo_clip.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from skimage import data
from skimage.transform import resize
from unsmear import synthetic, write_flow, write_image

FOLDER = Path(__file__).parent.parent / "python" / "unsmear" / "data" / "demo"
SHAPE = (216, 288)  # H, W
FRAMES = 5
PAN = (4.6, 1.4)  # px/frame
TURN = 0.35  # degrees/frame
OBJECT_PATH = (-3.2, 2.2)  # px/frame
DISC_RADIUS = 46.0  # px
DISC_CENTER = (62.0, 30.0)  # px right of and below the middle, at the middle frame


def disc(size: int, radius: float) -> np.ndarray:
    """Return an anti-aliased disc (size, size): opacity in [0, 1]."""
    y, x = np.mgrid[:size, :size] - (size - 1) / 2
    return np.clip(radius + 0.5 - np.hypot(x, y), 0.0, 1.0)


def scene() -> synthetic.Scene:
    """Return the portrait under a moving camera, and the cat crossing it."""
    portrait = resize(data.astronaut(), (400, 400), order=3, anti_aliasing=True)
    cat = data.chelsea()[20:260, 105:345]
    size = int(2 * DISC_RADIUS + 8)
    cat = resize(cat, (size, size), order=3, anti_aliasing=True)
    opacity = disc(size, DISC_RADIUS)
    # A pale rim, so that the outline is seen against any ground.
    rim = opacity - disc(size, DISC_RADIUS - 3)
    cat = cat + rim[..., None] * (np.array([0.96, 0.93, 0.85]) - cat)

    pan, turn = synthetic.translating(PAN), synthetic.rotating(TURN)
    drift = synthetic.translating(OBJECT_PATH)

    def camera(t: float) -> tuple[np.ndarray, np.ndarray]:
        matrix, offset = turn(t)
        # The portrait's upper middle, with its face, is what the camera looks at.
        return matrix, offset + pan(t)[1] + matrix @ np.array([0.0, 62.0])

    def crossing(t: float) -> tuple[np.ndarray, np.ndarray]:
        matrix, offset = drift(t)
        return matrix, offset + np.array(DISC_CENTER)

    layers = (
        synthetic.Layer(np.clip(portrait, 0, 1), camera),
        synthetic.Layer(np.clip(cat, 0, 1), crossing, opacity),
    )
    return synthetic.Scene(layers, SHAPE)


def main(folder: Path) -> None:
    """Write the clip."""
    clip = synthetic.record(
        scene(),
        n_frames=FRAMES,
        exposure=1.0,
        n_subframes=96,
        noise=1.0,
        bits=8,
        seed=7,
    )
    for name in ("blurred", "sharp"):
        (folder / name).mkdir(parents=True, exist_ok=True)
        for number, frame in enumerate(getattr(clip, name)):
            write_image(folder / name / f"frame_{number:04d}.png", frame)
    (folder / "flow").mkdir(exist_ok=True)
    for number, flow in enumerate(clip.flow):
        # KITTI's format: steps of 1/64 px, finer than any estimate of this clip.
        write_flow(folder / "flow" / f"frame_{number:04d}.png", flow)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
