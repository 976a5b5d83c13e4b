"""
Deblurring a known motion
=========================

When the motion is known, or measured, its blur can be taken out pixel by pixel, each
along its own curved path. A photograph turns by 12 degrees while the shutter is open.
"""

import matplotlib.pyplot as plt
import numpy as np
import unsmear

photograph = unsmear.demo_clip().sharp[2].mean(axis=2).astype(np.uint8)
case = unsmear.synthetic.blur_case("R12", photograph, shape=(176, 176))
psnr = unsmear.metrics.psnr

# %%
# Four methods on one picture. All of them are told the motion, none of them the noise.

names = ("tv", "fast", "wiener", "richardson-lucy")
pictures = {"sharp": case.sharp, "blurred": case.blurred}
for name in names:
    result = unsmear.deblur(
        case.blurred, case.velocity, acceleration=case.acceleration, method=name
    )
    pictures[name] = result.image
    print(f"{name:16} noise {result.report['noise'] or np.nan:.1f} grey levels")

figure, axes = plt.subplots(2, 3, figsize=(10, 7), layout="constrained")
for axis, (name, picture) in zip(axes.flat, pictures.items(), strict=True):
    axis.imshow(picture, cmap="gray", vmin=0, vmax=255)
    quality = "" if name == "sharp" else f": {psnr(picture, case.sharp):.1f} dB"
    axis.set_title(name + quality)
    axis.set_axis_off()

# %%
# The kernels that were inverted: how light was spread at a few places. `motion_psf`
# gives them exactly; the operator in `deblur` never forms them.

figure, axes = plt.subplots(1, 4, figsize=(10, 2.8), layout="constrained")
for axis, (y, x) in zip(axes, ((20, 20), (20, 150), (88, 60), (160, 88)), strict=True):
    velocity = case.velocity[y, x]
    kernel = unsmear.motion_psf(*velocity)
    rows, columns = ((25 - n) // 2 for n in kernel.shape)
    axis.imshow(np.pad(kernel, ((rows, rows), (columns, columns))), cmap="magma")
    axis.set_title(f"at ({x}, {y}): {np.hypot(*velocity):.1f} px")
    axis.set_axis_off()
plt.show()
