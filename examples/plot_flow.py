"""
Optical flow in one call
========================

Frames in, the motion of every pixel out: colour says where to and how fast, white is at
rest, black is unknown. The scene is made by a ray caster, so the truth is exact.
"""

import matplotlib.pyplot as plt
import unsmear

scene = unsmear.synthetic.thesis_scene("office", shape=(132, 176), n_frames=5, bits=8)
truth = scene.flow[2]

# %%
# The default takes two frames. The camera walks into the room: everything flows away
# from the middle, near things faster than far ones.

result = unsmear.optical_flow(scene.sharp, index=2)
errors = unsmear.metrics.flow_errors(result.flow, truth)
print(
    f"mean endpoint error {errors['epe']:.3f} px, angular {errors['aae']:.2f} degrees"
)
print(f"known: {result.valid.mean():.0%} of the pixels, {result.report['method']}")

# %%
# Pictures come as arrays, ready for `unsmear.write_image` or matplotlib.

figure, axes = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
axes[0].imshow(unsmear.plot.arrows(result.flow, scene.sharp[2], step=14))
axes[0].set_title("frame and measured flow")
axes[1].imshow(unsmear.plot.flow_to_color(result.flow, max_flow=4))
axes[1].set_title("measured, full colour at 4 px/frame")
axes[2].imshow(unsmear.plot.flow_to_color(truth, max_flow=4))
axes[2].set_title("truth")
for axis in axes:
    axis.set_axis_off()

# %%
# Every method on the same frames. "fleet-jepson" would rather be silent than wrong,
# "thesis" is the founding method: its speeds are far too low, by its construction.

names = ("fast", "balanced", "steady", "least-squares", "fleet-jepson", "thesis")
figure, axes = plt.subplots(2, 3, figsize=(11, 6), layout="constrained")
for name, axis in zip(names, axes.flat, strict=True):
    flow = unsmear.optical_flow(scene.sharp, index=2, method=name).flow
    e = unsmear.metrics.flow_errors(flow, truth)
    axis.imshow(unsmear.plot.flow_to_color(flow, max_flow=4))
    axis.set_title(f"{name}: {e['epe']:.2f} px at {e['density']:.0%}")
    axis.set_axis_off()
plt.show()
