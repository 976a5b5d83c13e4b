r"""
The founding method against bandwidth and number of frames
==========================================================

Repeats in kind figures 5-15 to 5-17 of C. Texin's thesis (MIT, 2007): the direction
error against the bandwidth :math:`\beta`, and against the frequency with 3, 5 and
7 frames. Beside it, what the default method and "steady" make of the same frames.
"""

import matplotlib.pyplot as plt
import numpy as np
import unsmear

BANDWIDTHS = (0.4, 0.6, 0.8, 1.0, 1.2)  # octaves
FREQUENCIES = (0.04, 0.06, 0.1, 0.15)  # cycles/px
SCENES = ("sphere", "office", "street", "blocks", "vcbox", "simple")

scenes = {
    name: unsmear.synthetic.thesis_scene(name, shape=(72, 96), n_frames=7, bits=8)
    for name in SCENES
}


def direction_error(name: str, frames: int = 3, **options: object) -> float:
    """Mean over the moving part of the middle frame, degrees."""
    s = scenes[name]
    around = s.sharp[3 - frames // 2 : 4 + frames // 2]
    flow = unsmear.optical_flow(around, index=frames // 2, **options).flow
    moving = np.hypot(*np.moveaxis(s.flow[3], -1, 0)) > 0.1
    return unsmear.metrics.flow_errors(flow, s.flow[3], mask=moving)["direction"]


# %%
# The bandwidth hardly matters, as the thesis found.

figure, axis = plt.subplots(figsize=(7.5, 4), layout="constrained")
for name in SCENES:
    errors = [
        direction_error(name, method="thesis", bandwidth_octaves=b) for b in BANDWIDTHS
    ]
    axis.plot(BANDWIDTHS, errors, "o-", label=name)
axis.set(xlabel="bandwidth, octaves", ylabel="mean direction error, degrees")
axis.set_ylim(bottom=0)
axis.legend(loc="center left", bbox_to_anchor=(1, 0.5))

# %%
# More frames are averaged, whether the motion is steady or not: that helps a little
# where it is, and harms where it changes from frame to frame ("blocks", "vcbox").

figure, axes = plt.subplots(2, 3, figsize=(11, 5.6), sharex=True, layout="constrained")
for name, axis in zip(SCENES, axes.flat, strict=True):
    for frames, style in ((3, "o-"), (5, "s--"), (7, "^:")):
        errors = [
            direction_error(name, frames, method="thesis", tuning_frequency=f)
            for f in FREQUENCIES
        ]
        axis.plot(FREQUENCIES, errors, style, label=f"thesis, {frames} frames")
    for method, style in (("balanced", "k-"), ("steady", "r--")):
        error = direction_error(name, 7, method=method)
        axis.plot(FREQUENCIES, [error] * 4, style, lw=1.2, label=method)
    axis.set(title=name, ylim=(0, None))
for axis in axes[1]:
    axis.set_xlabel("tuning frequency, cycles/px")
for axis in axes[:, 0]:
    axis.set_ylabel("direction error, degrees")
figure.legend(
    *axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5
)
plt.show()
