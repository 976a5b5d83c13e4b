"""Two motions in one place.

    python examples/plot_two_motions.py [PICTURE]

Through a half-transparent veil two things are seen at once, and at the edge of an
object two things share a neighbourhood. One flow vector per pixel cannot say so;
component velocities can: each allows the velocities on a line, and the lines of each
thing meet in its velocity. Prints what `unsmear.several_motions` finds beside the truth
and draws the votes of all lines over the plane of velocities, u to the right, v down;
red crosses are the truth.
"""

import sys

import numpy as np
import unsmear

BACK, FRONT = (1.0, -0.5), (-0.8, 0.9)  # px/frame
SIZE, AROUND, FRAMES = (64, 64), (120, 120), 15
SCALES = (0.25, 0.18)  # cycles/px
REACH = 1.8  # px/frame, half the side of the pictures of votes
ZOOM = 5
CROSS, RED = 3, (255, 40, 40)  # px


def sequence(opacity: np.ndarray) -> np.ndarray:
    """Frames of one texture moving before another."""
    make = unsmear.synthetic
    paint = [make.texture(AROUND, seed=seed, exponent=0.6) for seed in (1, 2)]
    return make.layers(
        *paint,
        opacity,
        shape=SIZE,
        n_frames=FRAMES,
        background_motion=make.translating(BACK),
        foreground_motion=make.translating(FRONT),
    ).sharp


def large(panel: np.ndarray, side: int) -> np.ndarray:
    """Return values 0..1 as 8 bits, ``side`` px wide."""
    rows, columns = (np.arange(side) * n // side for n in panel.shape)
    return np.rint(255 * np.clip(panel[np.ix_(rows, columns)], 0, 1)).astype(np.uint8)


def main() -> None:
    """Make both sequences, look at them, draw."""
    half = np.zeros(AROUND, bool)
    half[:, AROUND[1] // 2 :] = True
    side, rows = ZOOM * SIZE[0], []
    for name, opacity in (("veil", np.full(AROUND, 0.5)), ("edge", half)):
        frames = sequence(opacity)
        c = unsmear.component_velocities(
            frames, temporal="velocity-tuned", tuning_frequency=SCALES
        )
        for motion in unsmear.several_motions(c):
            u, v = motion.velocity
            print(f"{name}: ({u:5.2f}, {v:5.2f}) px/frame, {motion.share:.0%} of all")
        votes, axis = unsmear.velocity_votes(c, reach=REACH)
        panel = np.stack([large(votes / votes.max(), side)] * 3, axis=-1)
        for u, v in (BACK, FRONT):
            x, y = (round((s / axis[-1] + 1) / 2 * (side - 1)) for s in (u, v))
            panel[y - CROSS : y + CROSS + 1, x] = panel[
                y, x - CROSS : x + CROSS + 1
            ] = (
                255,
                40,
                40,
            )
        picture = np.stack([large(frames[FRAMES // 2], side)] * 3, axis=-1)
        rows.append(np.concatenate([picture, panel], axis=1))
    print(f"truth: {BACK} and {FRONT}")
    if sys.argv[1:]:
        unsmear.write_image(sys.argv[1], np.concatenate(rows))


if __name__ == "__main__":
    main()
