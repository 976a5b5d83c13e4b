r"""
What single filters see
=======================

A Gabor filter answers a moving pattern with a phase that moves along. One filter tells
only the motion along its phase gradient, its component velocity
:math:`v_n = -\phi_t \nabla\phi / |\nabla\phi|^2`; where several meet is the flow.
"""

import matplotlib.pyplot as plt
import numpy as np
import unsmear

VELOCITY = (1.4, -0.8)  # px/frame

make = unsmear.synthetic
paint = make.texture((120, 120), seed=4, exponent=0.8)
frames = make.translation(paint, VELOCITY, shape=(72, 72), n_frames=3).sharp
c = unsmear.component_velocities(frames)

# %%
# Amplitude and phase of the six filters. Where the amplitude goes through zero phase
# has no meaning; such pixels fail the tests of amplitude and frequency.

figure, axes = plt.subplots(2, 6, figsize=(12, 4.6), layout="constrained")
for n, angle in enumerate(np.degrees(c.orientation)):
    axes[0, n].imshow(c.amplitude[n], cmap="magma")
    axes[0, n].set_title(f"{angle:.0f}°")
    passed = np.isfinite(c.velocity[n, ..., 0])
    axes[1, n].imshow(np.hypot(*np.moveaxis(c.velocity[n], -1, 0)), vmin=0, vmax=2)
    axes[1, n].set_title(f"{passed.mean():.0%} pass")
for axis in axes.flat:
    axis.set(xticks=[], yticks=[])
axes[0, 0].set_ylabel("amplitude")
axes[1, 0].set_ylabel("speed along\nthe phase gradient")

# %%
# All component velocities of all filters lie on a circle through the origin and the
# true velocity, for each is the true one's projection. Their mean, which the founding
# method took, is the circle's centre: half of the motion.

u, v = c.velocity[np.isfinite(c.velocity).all(-1)].T
figure, axis = plt.subplots(figsize=(5.5, 5), layout="constrained")
axis.plot(u[::40], v[::40], ".", ms=3, alpha=0.4, label="component velocities")
axis.plot(*VELOCITY, "r*", ms=16, label="true velocity")
axis.plot(u.mean(), v.mean(), "kx", ms=10, mew=2, label="their mean")
axis.plot(0, 0, "k+", ms=10)
axis.set(xlabel="u, px/frame", ylabel="v, px/frame (down)", aspect="equal")
axis.set(xlim=(-0.8, 2.2), ylim=(0.9, -1.7))
axis.legend(loc="lower left")
print(f"mean of the components: ({u.mean():.2f}, {v.mean():.2f}) px/frame")
flow = unsmear.optical_flow(frames, method="least-squares").flow
print("least squares:", np.nanmedian(flow, axis=(0, 1)).round(2), "px/frame")
plt.show()
