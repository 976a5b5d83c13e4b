"""
Several frames for one
======================

Neighbouring frames of a clip show the same scene with other noise, and where the motion
changes, with other gaps in the spectrum. ``joint=3``, the default, restores from three
frames at once; where a neighbour does not show what the restoration predicts, it is
left out.
"""

import matplotlib.pyplot as plt
import unsmear

psnr = unsmear.metrics.psnr
photograph = unsmear.demo_clip().sharp[2].mean(axis=2) / 255
shot = unsmear.synthetic.blur_clip(
    "SH", photograph, shape=(112, 144), noise=2.0, n_subframes=24
)
truth = shot.sharp[2]

# %%
# An affine shake of 7 px and more, noise of two grey levels, nothing else known: both
# find motion and exposure by themselves.

pictures = {"blurred": shot.blurred[2]}
for joint, name in ((1, "from one frame"), (3, "from three frames")):
    result = unsmear.deblur_sequence(shot.blurred, indices=[2], joint=joint)
    pictures[name] = result.frames[0]
    exposure = result.reports[0]["exposure"]
    print(f"{name}: exposure {exposure:.2f}, {result.reports[0]['verdict']}")
pictures["truth"] = truth

figure, axes = plt.subplots(2, 2, figsize=(9, 7.4), layout="constrained")
for axis, (name, picture) in zip(axes.flat, pictures.items(), strict=True):
    axis.imshow(picture, cmap="gray", vmin=0, vmax=255)
    quality = "" if name == "truth" else f": {psnr(picture, truth):.1f} dB"
    axis.set_title(name + quality)
    axis.set_axis_off()
plt.show()
