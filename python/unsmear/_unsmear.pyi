"""Private core; the API is the package around it."""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

_Progress: TypeAlias = Callable[[int, int], object] | None

__version__: str
optimized: bool

def get_num_threads() -> int: ...
def set_num_threads(n: int) -> None: ...
def motion_psf(
    velocity: tuple[float, float], acceleration: tuple[float, float]
) -> NDArray[np.float64]: ...
def fspecial_motion(length: float, angle: float) -> NDArray[np.float64]: ...
def blur_f32(
    image: NDArray[Any],
    flow: NDArray[Any],
    exposure: float,
    progress: _Progress = None,
) -> NDArray[np.float32]: ...
def blur_f64(
    image: NDArray[Any],
    flow: NDArray[Any],
    exposure: float,
    progress: _Progress = None,
) -> NDArray[np.float64]: ...
def wiener_f32(
    image: NDArray[Any],
    flow: NDArray[Any],
    exposure: float,
    noise: float | None = None,
    regularization: float | None = None,
    progress: _Progress = None,
) -> tuple[NDArray[np.float32], dict[str, Any]]: ...
def wiener_f64(
    image: NDArray[Any],
    flow: NDArray[Any],
    exposure: float,
    noise: float | None = None,
    regularization: float | None = None,
    progress: _Progress = None,
) -> tuple[NDArray[np.float64], dict[str, Any]]: ...
def thesis_deblur(
    image: NDArray[Any],
    flow: NDArray[Any],
    degree: int,
    regularization: float,
    progress: _Progress = None,
) -> tuple[NDArray[np.float64], int]: ...
