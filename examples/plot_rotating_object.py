"""
A turning disc before a still wall
==================================

Five blurred frames, and the exposure, which the camera told. `unsmear.deblur_sequence`
measures the motion, restores what moved along its curved paths and leaves alone what
did not move.
"""

import matplotlib.pyplot as plt
import numpy as np
import unsmear

DEGREES, RADIUS, EXPOSURE = 9.0, 52.0, 0.8  # per frame, px, share of the interval

make = unsmear.synthetic
photograph = unsmear.demo_clip().sharp[2].mean(axis=2)[:140, 60:200] / 255
y, x = np.mgrid[:140, :140] - 69.5
shot = make.layers(
    make.texture((140, 140), seed=5, exponent=1.2),
    photograph,
    np.clip(RADIUS + 0.5 - np.hypot(x, y), 0, 1),
    shape=(128, 128),
    n_frames=5,
    exposure=EXPOSURE,
    n_subframes=24,
    bits=8,
    noise=1.0,
    background_motion=make.translating((0.0, 0.0)),
    foreground_motion=make.rotating(DEGREES),
)

# %%
# One call. The report says in words what was found and done. (The exposure of so small
# a thing, whose blur is different everywhere, is hard to find from the blur: if you
# know it, say it.)

result = unsmear.deblur_sequence(shot.blurred, indices=[2], exposure=EXPOSURE)
print("verdict:", result.reports[0]["verdict"])
flow = result.flows[0]
speed = np.hypot(*np.moveaxis(flow, -1, 0))
print(f"fastest, at the rim: {np.nanmax(speed):.1f} px/frame")

# %%
# The wall comes back as it was, bit for bit, but for the ring that the blur of the disc
# reaches; at the outline two motions mix and the gain is least.

psnr = unsmear.metrics.psnr
restored = result.frames[0]
panels = (
    (f"blurred: {psnr(shot.blurred[2], shot.sharp[2]):.1f} dB", shot.blurred[2]),
    (f"restored: {psnr(restored, shot.sharp[2]):.1f} dB", restored),
    ("truth", shot.sharp[2]),
    ("measured motion", unsmear.plot.flow_to_color(flow)),
)
figure, axes = plt.subplots(2, 2, figsize=(8.4, 8.8), layout="constrained")
for axis, (title, picture) in zip(axes.flat, panels, strict=True):
    axis.imshow(picture, cmap="gray")
    axis.set_title(title)
    axis.set_axis_off()
still = np.hypot(x, y)[6:134, 6:134] > RADIUS + 10
same = (restored == shot.blurred[2])[still].mean()
print(f"of the wall, {same:.1%} of the pixels are untouched")
plt.show()
