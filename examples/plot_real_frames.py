"""
Flow on real frames
===================

Photographs in motion: RubberWhale of the Middlebury set where it is at hand (the
environment variable ``UNSMEAR_TEST_DATA`` names the folder that holds
``middlebury/RubberWhale``; the pictures are not ours to ship), else the demo clip,
which is cut from photographs and blurred as a camera would have.
"""

import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import unsmear

folder = Path(os.environ.get("UNSMEAR_TEST_DATA", "nowhere"), "middlebury/RubberWhale")
if folder.is_dir():
    frames = unsmear.read_frames(sorted(folder.glob("*.png")))
    truth = unsmear.read_flow(folder / "flow_10.flo")
    index, name = 3, "RubberWhale"
else:
    clip = unsmear.demo_clip()
    frames, truth, index, name = (
        clip.blurred,
        clip.flow[2],
        2,
        "demo clip (no set here)",
    )
print(f"{name}: {frames.shape}, {frames.dtype}")

# %%
# Two frames, and then finer steps for twice the time.

top = float(np.nanpercentile(np.hypot(*np.moveaxis(truth, -1, 0)), 99))
channel_axis = 3 if frames.ndim == 4 else None
pictures, titles = [unsmear.plot.flow_to_color(truth, max_flow=top)], ["truth"]
for method in ("balanced", "accurate"):
    r = unsmear.optical_flow(
        frames, index=index, method=method, channel_axis=channel_axis
    )
    e = unsmear.metrics.flow_errors(r.flow, truth)
    pictures.append(unsmear.plot.flow_to_color(r.flow, max_flow=top))
    titles.append(f"{method}: {e['epe']:.2f} px, {e['aae']:.1f} degrees")

figure, axes = plt.subplots(2, 2, figsize=(9, 7), layout="constrained")
for axis, picture, title in zip(
    axes.flat, (frames[index], *pictures), (name, *titles), strict=True
):
    axis.imshow(picture, cmap="gray")
    axis.set_title(title)
    axis.set_axis_off()

# %%
# Where the error lies: at the outlines of things, which pass in front of each other.

error = unsmear.metrics.endpoint_error(r.flow, truth)
figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
image = axis.imshow(error, cmap="inferno", vmax=1)
figure.colorbar(image, label="endpoint error, px")
axis.set_axis_off()
plt.show()
