"""
How far to trust a flow
=======================

`unsmear.optical_flow` returns a confidence for every pixel. It is worth something when
the error falls as the least confident pixels are left out: the sparsification curve,
beside what leaving out by the true error would give, which nobody has.
"""

import matplotlib.pyplot as plt
import numpy as np
import unsmear

clip = unsmear.demo_clip()
truth = clip.flow[2]
result = unsmear.optical_flow(clip.blurred, index=2, channel_axis=3)
error = unsmear.metrics.endpoint_error(result.flow, truth)

# %%
# The frame, its error, and the confidence, which knows of the error without the truth:
# it is low at the outline of the disc, where things come and go, and on flat ground.

figure, axes = plt.subplots(1, 3, figsize=(12, 3.2), layout="constrained")
axes[0].imshow(clip.blurred[2])
axes[0].set_title("blurred frame")
image = axes[1].imshow(error, cmap="inferno", vmax=2)
axes[1].set_title("endpoint error, px")
figure.colorbar(image, shrink=0.8)
image = axes[2].imshow(result.confidence, cmap="viridis", vmin=0, vmax=1)
axes[2].set_title("confidence")
figure.colorbar(image, shrink=0.8)
for axis in axes:
    axis.set_axis_off()

# %%
# The curve. Half of the pixels have a fraction of the error of all.

densities = np.linspace(0.05, 1, 39)
by_confidence, by_error = (
    unsmear.metrics.sparsification(result.flow, order, truth, densities=densities)
    for order in (result.confidence, -error)
)
figure, axis = plt.subplots(figsize=(6.5, 4), layout="constrained")
axis.plot(by_confidence["density"], by_confidence["epe"], label="by confidence")
axis.plot(by_error["density"], by_error["epe"], "--", label="by the true error")
axis.axhline(error.mean(), color="gray", lw=1, label="at random")
axis.set(xlabel="share of the pixels kept", ylabel="mean endpoint error, px")
axis.set_ylim(bottom=0)
axis.legend()
half = np.interp(0.5, by_confidence["density"], by_confidence["epe"])
print(f"all {error.mean():.2f} px, the more confident half {half:.2f} px")
plt.show()
