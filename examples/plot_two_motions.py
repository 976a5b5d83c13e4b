"""
Two motions in one place
========================

Through a half-transparent veil two things are seen at once, and at the edge of an
object two things share a neighbourhood. One flow vector per pixel cannot say so;
component velocities can: each allows the velocities on a line, and the lines of each
thing meet in its velocity.
"""

import matplotlib.pyplot as plt
import numpy as np
import unsmear

BACK, FRONT = (1.0, -0.5), (-0.8, 0.9)  # px/frame
SIZE, AROUND, FRAMES = (64, 64), (120, 120), 15
SCALES = (0.25, 0.18)  # cycles/px
REACH = 1.8  # px/frame, half the side of the pictures of votes


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


# %%
# On the left the middle frame, on the right the votes of all lines over the plane of
# velocities. Circles are the truth, crosses what `unsmear.several_motions` finds, which
# is not told where either thing is.

half = np.zeros(AROUND, bool)
half[:, AROUND[1] // 2 :] = True
figure, axes = plt.subplots(2, 2, figsize=(8.4, 7.6), layout="constrained")
for name, opacity, (left, right) in (
    ("veil", np.full(AROUND, 0.5), axes[0]),
    ("edge", half, axes[1]),
):
    frames = sequence(opacity)
    c = unsmear.component_velocities(
        frames, temporal="velocity-tuned", tuning_frequency=SCALES
    )
    votes, axis = unsmear.velocity_votes(c, reach=REACH)
    left.imshow(frames[FRAMES // 2], cmap="gray")
    left.set(title=f"{name}: middle frame", xlabel="x, px", ylabel="y, px")
    image = right.imshow(
        votes, extent=(axis[0], axis[-1], axis[-1], axis[0]), cmap="viridis"
    )
    figure.colorbar(image, label="share of the components", shrink=0.9)
    for velocity in (BACK, FRONT):
        right.plot(*velocity, "o", ms=15, mfc="none", mec="white", mew=1.5)
    for motion in unsmear.several_motions(c):
        u, v = motion.velocity
        right.plot(u, v, "rx", ms=8, mew=2)
        label = f"({u:.2f}, {v:.2f})\n{motion.share:.0%}"
        right.annotate(
            label, (u, v), (0, -30), textcoords="offset points", color="w", ha="center"
        )
        print(f"{name}: ({u:5.2f}, {v:5.2f}) px/frame, {motion.share:.0%} of all")
    right.set(title="votes for each velocity", xlabel="u, px/frame")
    right.set_ylabel("v, px/frame (down)")
print(f"truth: {BACK} and {FRONT}")
plt.show()
