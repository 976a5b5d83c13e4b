"""
The founding deblurring: r and interpolation
============================================

Repeats in kind figures 5-22 to 5-24 of C. Texin's thesis (MIT, 2007): three averaged
frames, deblurred with the true motion, for several strengths ``r`` of the
regularisation and degrees of interpolation.
"""

import matplotlib.pyplot as plt
import numpy as np
import unsmear

shot = unsmear.synthetic.thesis_scene(
    "office", shape=(84, 112), n_frames=1, exposure=3.0, bits=8, n_subframes=32
)
blurred, sharp, flow = shot.blurred[0], shot.sharp[0], shot.velocity[0]
inside = (slice(10, -10), slice(10, -10))  # the founding method leaves a black frame


def restored(**options: object) -> np.ndarray:
    """Deblur over three frame intervals, as the thesis averaged three frames."""
    return unsmear.deblur(blurred, flow, exposure=3.0, **options).image


def show(pictures: dict[str, np.ndarray]) -> None:
    """Draw pictures with their distance from the truth, borders left out."""
    _, axes = plt.subplots(1, len(pictures), figsize=(12, 3), layout="constrained")
    for axis, (name, picture) in zip(axes, pictures.items(), strict=True):
        quality = unsmear.metrics.psnr(picture[inside], sharp[inside])
        axis.imshow(picture[inside], cmap="gray", vmin=0, vmax=255)
        axis.set_title(f"{name}: {quality:.1f} dB")
        axis.set_axis_off()


# %%
# Small values of r amplify noise and the wrap-around of the founding inverse, large
# ones hold the picture back. None comes nearer to the truth than the blurred picture.

strengths = (0.1, 0.02, 0.001)
show(
    {"blurred": blurred}
    | {f"r = {r}": restored(method="thesis", regularization=r) for r in strengths}
)

# %%
# Interpolation shrinks the distortion around the focus of expansion, where lengths
# round to 0 or 1, and costs four times the work for each degree.

show(
    {f"degree {n}": restored(method="thesis", degree=n) for n in (1, 2, 3)}
    | {"tv (default)": restored(noise=0.3)}
)

# %%
# The whole curve: the best of the founding method is to change as little as it can.

values = np.geomspace(1e-3, 1, 8)
figure, axis = plt.subplots(figsize=(7, 3.8), layout="constrained")
for n in (1, 2, 3):
    quality = [
        unsmear.metrics.psnr(
            restored(method="thesis", regularization=r, degree=n)[inside], sharp[inside]
        )
        for r in values
    ]
    axis.semilogx(values, quality, "o-", label=f"thesis, degree {n}")
before = unsmear.metrics.psnr(blurred[inside], sharp[inside])
axis.axhline(before, color="gray", ls="--", label="blurred")
axis.set(xlabel="r", ylabel="PSNR, dB")
axis.legend()
plt.show()
