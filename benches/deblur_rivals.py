"""Other people's ways to remove a known, space-varying motion blur.

Each takes a `Problem` and returns a picture. Where a method has a knob, it runs with
several settings and the best is kept **by the truth**, which no user has: the rivals
are given what they could reach at most.

* scikit-image's Richardson-Lucy, Wiener and unsupervised Wiener, with the one kernel
  they can take: the mean of the local ones; the founding work compared itself so.
* Blind deconvolution, alternating Richardson-Lucy for picture and kernel from a flat
  kernel (D. A. Fish et al., JOSA A 12, 1995, doi:10.1364/JOSAA.12.000058), likewise.
* Richardson-Lucy tile by tile, each with its own kernel, blended.
* PyLops' split Bregman total variation (T. Goldstein, S. Osher, SIAM J. Imaging Sci. 2,
  2009, doi:10.1137/080725891) on the exact operator, as a sparse matrix, with the
  pixels beyond the border as unknowns.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import unsmear
from numpy.typing import NDArray
from path_matrix import path_matrix
from scipy import fft
from skimage import restoration

Array = NDArray[np.float64]

KERNEL_STEP = 8  # px between the places whose kernels are averaged
RL_ITERATIONS = (10, 30, 100)
BALANCES = (0.003, 0.01, 0.03, 0.1, 0.3)
BLIND_ITERATIONS = 10  # as many as MATLAB's deconvblind and deconvlucy make
TILE, TILE_STEP = 64, 32  # px
TILE_ITERATIONS = (10, 30)
# Against noise of 1 grey level; it grows with the noise to the power 3/2.
PYLOPS_STRENGTHS = (0.03, 0.1)
PYLOPS_OUTER, PYLOPS_INNER = 20, 10


@dataclass(frozen=True)
class Problem:
    """A blurred picture (H, W), 0..255, its motion, its noise, and the truth.

    ``matrix`` returns the motion's sparse operator and the shape of its unknowns.
    """

    blurred: Array
    velocity: Array
    acceleration: Array
    noise: float
    truth: Array
    matrix: Callable[[], tuple[Any, tuple[int, int]]] | None = None

    def best(self, candidates: Iterable[Array]) -> Array:
        """Return the candidate nearest to the truth."""
        return min(candidates, key=lambda x: float(((x - self.truth) ** 2).mean()))

    @cached_property
    def kernel(self) -> Array:
        """The mean of the local kernels."""
        return mean_kernel(self.velocity[::KERNEL_STEP, ::KERNEL_STEP].reshape(-1, 2))

    @property
    def reach(self) -> int:
        """Border that makes room for the kernel, px."""
        return max(self.kernel.shape) // 2 + 8


def mean_kernel(velocities: Array) -> Array:
    """Return the mean of the exact motion kernels of velocities (N, 2)."""
    kernels = [unsmear.motion_psf(u, v) for u, v in velocities]
    rows, columns = (max(k.shape[axis] for k in kernels) for axis in (0, 1))
    total = np.zeros((rows, columns))
    for k in kernels:
        top, left = (rows - k.shape[0]) // 2, (columns - k.shape[1]) // 2
        total[top : top + k.shape[0], left : left + k.shape[1]] += k
    return total / len(kernels)


def framed(work: Callable[[Array], Array], problem: Problem) -> Array:
    """Do ``work`` on the picture in 0..1, its border mirrored, and cut that off."""
    n = problem.reach
    padded = np.pad(problem.blurred / 255, n, mode="symmetric")
    return np.asarray(work(padded)[n:-n, n:-n]) * 255


def richardson_lucy(problem: Problem) -> Array:
    """scikit-image's, the best of several iteration counts."""
    return problem.best(
        framed(
            lambda p, n=n: restoration.richardson_lucy(p, problem.kernel, n), problem
        )
        for n in RL_ITERATIONS
    )


def wiener(problem: Problem) -> Array:
    """scikit-image's, the best of several balances."""
    return problem.best(
        framed(lambda p, b=b: restoration.wiener(p, problem.kernel, b), problem)
        for b in BALANCES
    )


def unsupervised_wiener(problem: Problem) -> Array:
    """scikit-image's, which finds its balance itself."""
    return framed(
        lambda p: restoration.unsupervised_wiener(p, problem.kernel, rng=0)[0], problem
    )


class Convolution:
    """Circular convolution of pictures of one shape with a centred kernel."""

    def __init__(self, shape: tuple[int, ...], kernel: Array) -> None:
        self.shape = shape
        placed = np.zeros(shape)
        placed[: kernel.shape[0], : kernel.shape[1]] = kernel
        half = [-(n // 2) for n in kernel.shape]
        self.otf = fft.rfft2(np.roll(placed, half, axis=(0, 1)))

    def __call__(self, picture: Array) -> Array:
        return np.asarray(fft.irfft2(fft.rfft2(picture) * self.otf, s=self.shape))

    def correlate(self, picture: Array) -> Array:
        """Apply the transpose."""
        spectrum = fft.rfft2(picture) * self.otf.conj()
        return np.asarray(fft.irfft2(spectrum, s=self.shape))


def lucy_steps(blurred: Array, picture: Array, convolve: Convolution) -> Array:
    """Return the picture after one step of Richardson and Lucy."""
    ratio = blurred / np.maximum(convolve(picture), 1e-6)
    return np.maximum(picture * convolve.correlate(ratio), 0)


def blind(problem: Problem) -> Array:
    """Alternate the two steps from a flat kernel of the true one's size."""

    def work(blurred: Array) -> Array:
        size = problem.kernel.shape
        kernel = np.full(size, 1 / problem.kernel.size)
        picture = blurred.copy()
        for _ in range(BLIND_ITERATIONS):
            ratio = blurred / np.maximum(
                Convolution(blurred.shape, kernel)(picture), 1e-6
            )
            spectrum = fft.rfft2(ratio) * fft.rfft2(picture).conj()
            gain = fft.irfft2(spectrum, s=blurred.shape) / picture.sum()
            centred = np.roll(gain, [n // 2 for n in size], axis=(0, 1))
            kernel = np.maximum(kernel * centred[: size[0], : size[1]], 0)
            kernel /= kernel.sum()
            picture = lucy_steps(blurred, picture, Convolution(blurred.shape, kernel))
        return picture

    return framed(work, problem)


def tiled_richardson_lucy(problem: Problem) -> Array:
    """Each tile with the mean kernel of its pixels, blended by Hann windows."""
    height, width = problem.blurred.shape
    n, half = problem.reach, TILE // 2
    padded = np.pad(problem.blurred, n + half, mode="symmetric")
    speed = np.pad(problem.velocity, ((half, half), (half, half), (0, 0)), mode="edge")
    window = np.sin(np.pi * (np.arange(TILE) + 0.5) / TILE) ** 2
    window = np.outer(window, window)
    totals = {count: np.zeros(padded.shape) for count in TILE_ITERATIONS}
    weights = np.zeros(padded.shape)
    for y in range(0, height + TILE - TILE_STEP, TILE_STEP):
        for x in range(0, width + TILE - TILE_STEP, TILE_STEP):
            own = speed[y : y + TILE : KERNEL_STEP, x : x + TILE : KERNEL_STEP]
            if own.size == 0:
                continue
            tile = padded[y : y + TILE + 2 * n, x : x + TILE + 2 * n]
            convolve = Convolution(tile.shape, mean_kernel(own.reshape(-1, 2)))
            place = np.s_[n + y : n + y + TILE, n + x : n + x + TILE]
            rows, columns = totals[TILE_ITERATIONS[0]][place].shape
            weight = window[:rows, :columns]
            weights[place] += weight
            picture = tile.copy()
            for count in range(1, max(TILE_ITERATIONS) + 1):
                picture = lucy_steps(tile, picture, convolve)
                if count in totals:
                    inner = picture[n : n + rows, n : n + columns]
                    totals[count][place] += weight * inner
    inside = np.s_[n + half : n + half + height, n + half : n + half + width]
    return problem.best((t[inside] / weights[inside]) for t in totals.values())


def pylops_tv(problem: Problem) -> Array:
    """Split Bregman on the exact operator, the best of two strengths."""
    import pylops
    from pylops.optimization.sparsity import splitbregman

    assert problem.matrix is not None
    matrix, shape = problem.matrix()
    n = (shape[0] - problem.blurred.shape[0]) // 2
    start = np.pad(problem.blurred, n, mode="edge").ravel()
    operator = pylops.MatrixMult(matrix)
    slopes = [pylops.FirstDerivative(shape, axis=a, kind="forward") for a in (0, 1)]

    def solved(strength: float) -> Array:
        weight = strength * max(problem.noise, 0.3) ** 1.5
        x, *_ = splitbregman(
            operator,
            problem.blurred.ravel(),
            slopes,
            x0=start.copy(),
            niter_outer=PYLOPS_OUTER,
            niter_inner=1,
            mu=1 / weight,
            epsRL1s=[1.0, 1.0],
            tol=1e-4,
            iter_lim=PYLOPS_INNER,
            damp=0,
        )
        return np.asarray(x).reshape(shape)[n:-n, n:-n]

    return problem.best(solved(s) for s in PYLOPS_STRENGTHS)


def path_problem_matrix(velocity: Array, acceleration: Array) -> tuple[Any, Any]:
    """Return the sparse operator of a motion and the shape of its unknowns."""
    reach = math.ceil(float(np.linalg.norm(velocity, axis=-1).max()) / 2) + 4
    return path_matrix(velocity, acceleration, reach)


RIVALS: dict[str, Callable[[Problem], Array]] = {
    "sk RL": richardson_lucy,
    "sk Wiener": wiener,
    "sk unsupervised": unsupervised_wiener,
    "blind RL": blind,
    "tiled RL": tiled_richardson_lucy,
    "PyLops TV": pylops_tv,
}
# Settings a rival tries, to tell the time of one.
SETTINGS = {"sk RL": len(RL_ITERATIONS), "sk Wiener": len(BALANCES)}
SETTINGS |= {"PyLops TV": len(PYLOPS_STRENGTHS)}
# Too slow to repeat for every picture and noise seed; our own form of the founding
# method among them.
SLOW = ("PyLops TV", "thesis")
