r"""
How long the shutter was open
=============================

Flow says how far things move from frame to frame; the blur is that times the share of
the interval during which light was gathered. A blur of :math:`L` px leaves zeros in the
spectrum at :math:`1/L, 2/L, \ldots` cycles/px, and from these the share is read.
"""

import matplotlib.pyplot as plt
import numpy as np
import unsmear

SPEED, EXPOSURE = 16.0, 0.6  # px/frame, share
make = unsmear.synthetic
paint = make.texture((240, 300), seed=3, exponent=1.0)
shot = make.translation(
    paint, (SPEED, 0.0), shape=(192, 224), exposure=EXPOSURE, n_frames=1, noise=0.5
)
picture, flow = shot.blurred[0], shot.velocity[0]

# %%
# The spectrum along the motion: zeros at multiples of 1 / (0.6 · 16 px).

window = np.hanning(picture.shape[1])
rows = (picture - picture.mean()) * window
power = (np.abs(np.fft.rfft(rows, axis=1)) ** 2).mean(axis=0)
frequency = np.fft.rfftfreq(picture.shape[1])
figure, axis = plt.subplots(figsize=(7, 3.6), layout="constrained")
axis.semilogy(frequency[1:], power[1:])
for n in range(1, 5):
    label = "n / (exposure · speed)" if n == 1 else None
    axis.axvline(n / (EXPOSURE * SPEED), color="tab:red", ls="--", lw=1, label=label)
axis.set(xlabel="frequency along the motion, cycles/px", ylabel="power")
axis.legend()

# %%
# `estimate_exposure` fits them, and says how sure it is. A common error in the length
# of the flow is taken up: what it finds is the blur.

for factor in (0.8, 1.0, 1.25):
    found = unsmear.estimate_exposure(picture, factor * flow)
    blur = found.value * factor * SPEED
    print(
        f"flow times {factor:4}: exposure {found.value:.3f} ({found.status}), "
        f"so the blur is {blur:.2f} px (truth {EXPOSURE * SPEED:.2f})"
    )

# %%
# What a wrong one costs. Too short leaves blur, too long rings: doubt shortens.

shares = np.linspace(0.3, 0.9, 13)
quality = [
    unsmear.metrics.psnr(
        unsmear.deblur(picture, flow, exposure=s, method="fast").image, shot.sharp[0]
    )
    for s in shares
]
figure, axis = plt.subplots(figsize=(7, 3.4), layout="constrained")
axis.plot(shares, quality, "o-", label="restored")
blurred = unsmear.metrics.psnr(picture, shot.sharp[0])
axis.axhline(blurred, color="gray", ls="--", label="blurred")
axis.set(xlabel="exposure assumed", ylabel="PSNR, dB")
axis.legend()
plt.show()
