"""
Deblurring beside other methods
===============================

Repeats in kind figure 5-25 of C. Texin's thesis (MIT, 2007): blurred scenes restored by
the founding method, by blind deconvolution, by Lucy-Richardson with the mean of the
local kernels, and by the default. Motion over three frames is integrated, as there.
"""

import matplotlib.pyplot as plt
import numpy as np
import unsmear
from scipy.signal import fftconvolve

SCENES = ("sphere", "office", "street", "simple")
SHAPE, EXPOSURE, TURNS = (72, 96), 3.0, 10  # MATLAB makes 10 turns by default
PAD, CUT = 24, 10  # px: border continued for kernels, border left out of figures


def corrected(picture: np.ndarray, kernel: np.ndarray, data: np.ndarray) -> np.ndarray:
    """Make one turn of Lucy-Richardson: a factor for the picture."""
    ratio = data / np.maximum(fftconvolve(picture, kernel, "same"), 1e-3)
    return fftconvolve(ratio, kernel[::-1, ::-1], "same")


def lucy_richardson(
    data: np.ndarray, kernel: np.ndarray, blind: bool = False
) -> np.ndarray:
    """Restore; blind: improve the kernel in turn with the picture."""
    data = picture = np.pad(data / 255.0, PAD, mode="edge")
    half = kernel.shape[0] // 2
    middle = tuple(slice(n // 2 - half, n // 2 + half + 1) for n in data.shape)
    for _ in range(TURNS):
        picture = np.maximum(picture * corrected(picture, kernel, data), 0)
        if blind:
            ratio = data / np.maximum(fftconvolve(picture, kernel, "same"), 1e-3)
            change = fftconvolve(ratio, picture[::-1, ::-1], "same")[middle]
            kernel = np.maximum(kernel * change, 0)
            kernel /= kernel.sum()
    return 255 * picture[PAD:-PAD, PAD:-PAD]


def mean_kernel(flow: np.ndarray, side: int = 31) -> np.ndarray:
    """Return the mean of the local motion kernels."""
    total = np.zeros((side, side))
    for velocity in flow[::6, ::6].reshape(-1, 2):
        k = unsmear.motion_psf(*velocity)
        top, left = (side - k.shape[0]) // 2, (side - k.shape[1]) // 2
        total[top : top + k.shape[0], left : left + k.shape[1]] += k
    return total / total.sum()


# %%
# Beside each picture, the gain in dB over the blurred one. "street" gains from nothing:
# a car whose wheels turn passes before a wall, and their motions mix.

known = {"exposure": EXPOSURE}  # frame intervals
figure, axes = plt.subplots(len(SCENES), 6, figsize=(14, 8), layout="constrained")
for name, row in zip(SCENES, axes, strict=True):
    world = unsmear.synthetic.THESIS_SCENES[name](SHAPE)
    shot = unsmear.synthetic.record(world, n_frames=1, bits=8, n_subframes=24, **known)
    blurred, sharp = shot.blurred[0], shot.sharp[0]
    flow = world.velocity(0.0, EXPOSURE / 2)  # its mean over the exposure
    founding = unsmear.deblur(blurred, flow, method="thesis", degree=2, **known)
    panels = {
        "sharp": sharp,
        "blurred": blurred,
        "thesis": founding.image,
        "blind": lucy_richardson(blurred, np.full((7, 7), 1 / 49), blind=True),
        "mean kernel": lucy_richardson(blurred, mean_kernel(EXPOSURE * flow)),
        "default": unsmear.deblur(blurred, flow, **known).image,
    }
    cut = {k: np.clip(p, 0, 255)[CUT:-CUT, CUT:-CUT] for k, p in panels.items()}
    quality = [unsmear.metrics.psnr(p / 255, cut["sharp"] / 255) for p in cut.values()]
    for n, (title, picture) in enumerate(cut.items()):
        gain = "" if n < 2 else f": {quality[n] - quality[1]:+.1f}"
        row[n].imshow(picture, cmap="gray", vmin=0, vmax=255)
        row[n].set(title=title + gain, xticks=[], yticks=[])
    row[0].set_ylabel(name)
plt.show()
