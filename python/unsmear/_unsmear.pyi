"""Types of the compiled core; the API is the Python package around it.

Arrays may be strided where they come in and are new where they go out. `progress` is
called with steps done and steps expected; what it raises cancels the call.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias, TypedDict, final

import numpy as np
from numpy.typing import NDArray

_Single: TypeAlias = NDArray[np.float32]
_Double: TypeAlias = NDArray[np.float64]
_Complex: TypeAlias = NDArray[np.complex128]
_Parameters: TypeAlias = Mapping[str, Any]
_Progress: TypeAlias = Callable[[int, int], object]

__all__ = [
    "MotionOperator",
    "__version__",
    "blur_f32",
    "blur_f64",
    "build_info",
    "coarse_to_fine",
    "component_velocities",
    "correlate_separable",
    "dilated",
    "error_map",
    "estimate_exposure",
    "estimate_noise",
    "estimate_turn",
    "fleet_jepson",
    "frame_motion",
    "fspecial_motion",
    "gabor_phase_gradient",
    "gabor_planes",
    "get_num_threads",
    "least_squares",
    "looks_reach",
    "motion_deblur_f32",
    "motion_deblur_f64",
    "motion_psf",
    "optimized",
    "psnr",
    "record_look",
    "regions",
    "restore_looks",
    "sample",
    "set_num_threads",
    "ssim",
    "thesis_bank",
    "thesis_deblur",
    "thesis_flow",
    "thesis_gated_mean",
    "thesis_stages",
    "visibility",
    "wiener_f32",
    "wiener_f64",
]

__version__: str
optimized: bool

# Flow.

# float32 or float64, and the same out.
def component_velocities(
    frames: NDArray[Any],
    index: int,
    parameters: _Parameters,
    *,
    progress: _Progress | None = None,
) -> tuple[NDArray[Any], list[list[float]]]: ...
def gabor_phase_gradient(
    picture: _Double, parameters: _Parameters
) -> tuple[_Complex, _Double, _Double]: ...
def gabor_planes(
    picture: NDArray[Any], parameters: _Parameters
) -> tuple[NDArray[Any], NDArray[Any]]: ...
def correlate_separable(
    volume: _Double, taps: Sequence[Sequence[float]], border: str
) -> _Double: ...
def coarse_to_fine(
    frames: NDArray[np.uint8] | NDArray[np.uint16] | _Single | _Double,
    index: int,
    parameters: _Parameters,
    *,
    mask: NDArray[np.bool_] | None = None,
    progress: _Progress | None = None,
) -> tuple[_Single, _Single, list[tuple[int, int, int, list[float], float, float]]]: ...

# float32 out, or float64 where `double` is asked for.
def least_squares(
    frames: _Double,
    index: int,
    parameters: _Parameters,
    *,
    double: bool = False,
    progress: _Progress | None = None,
) -> tuple[NDArray[Any], NDArray[Any]]: ...
def fleet_jepson(
    frames: _Double,
    index: int,
    parameters: _Parameters,
    *,
    double: bool = False,
    progress: _Progress | None = None,
) -> tuple[NDArray[Any], NDArray[Any]]: ...

# The founding flow method and its stages.

class _ThesisBank(TypedDict):
    sigma: float
    angles: _Double
    temporal_taps: _Double
    windows: _Complex
    kept: NDArray[np.bool_]
    kernels: _Complex

class _ThesisStages(TypedDict):
    moving: _Double
    responses: _Complex
    phi_x: _Double
    phi_y: _Double
    phi_t: _Double
    un: _Double
    vn: _Double

def thesis_bank(
    shape: tuple[int, ...], tuning_frequency: float, bandwidth_octaves: float
) -> _ThesisBank: ...
def thesis_stages(frames: _Double, parameters: _Parameters) -> _ThesisStages: ...
def thesis_gated_mean(
    values: _Double, std_limit: float, distance_limit: float, least_fraction: float
) -> tuple[_Double, _Double]: ...
def thesis_flow(
    frames: _Double, parameters: _Parameters, *, progress: _Progress | None = None
) -> _Double: ...

# Pictures between pixels.

def sample(
    picture: _Double, y: _Double, x: _Double, degree: int, border: str
) -> _Double: ...

# Blur, deblurring and their kernels.

def motion_psf(velocity: Sequence[float], acceleration: Sequence[float]) -> _Double: ...
def fspecial_motion(length: float, angle: float) -> _Double: ...

# The caller picks the function by the type of the picture, which no checker follows.
def blur_f32(
    image: NDArray[Any],
    flow: NDArray[Any],
    exposure: float,
    progress: _Progress | None = None,
) -> _Single: ...
def blur_f64(
    image: NDArray[Any],
    flow: NDArray[Any],
    exposure: float,
    progress: _Progress | None = None,
) -> _Double: ...
def wiener_f32(
    image: NDArray[Any],
    flow: NDArray[Any],
    exposure: float,
    noise: float | None = None,
    regularization: float | None = None,
    progress: _Progress | None = None,
) -> tuple[_Single, dict[str, Any]]: ...
def wiener_f64(
    image: NDArray[Any],
    flow: NDArray[Any],
    exposure: float,
    noise: float | None = None,
    regularization: float | None = None,
    progress: _Progress | None = None,
) -> tuple[_Double, dict[str, Any]]: ...
def motion_deblur_f32(
    image: NDArray[Any],
    flow: NDArray[Any],
    method: str,
    exposure: float,
    *,
    acceleration: NDArray[Any] | None = None,
    weights: _Single | None = None,
    noise: float | None = None,
    regularization: float | None = None,
    ceiling: float | None = None,
    progress: _Progress | None = None,
) -> tuple[_Single, dict[str, Any]]: ...
def motion_deblur_f64(
    image: NDArray[Any],
    flow: NDArray[Any],
    method: str,
    exposure: float,
    *,
    acceleration: NDArray[Any] | None = None,
    weights: _Single | None = None,
    noise: float | None = None,
    regularization: float | None = None,
    ceiling: float | None = None,
    progress: _Progress | None = None,
) -> tuple[_Double, dict[str, Any]]: ...
def thesis_deblur(
    image: _Double,
    flow: _Double,
    degree: int,
    regularization: float,
    progress: _Progress | None = None,
) -> tuple[_Double, int]: ...

# How long the shutter was open.

def estimate_exposure(
    images: _Single,
    velocities: _Single,
    accelerations: _Single | None,
    limits: tuple[float, float],
    noise: float | None,
    seed: int,
    of_content: bool = False,
    turn: bool = False,
    progress: _Progress | None = None,
) -> dict[str, Any]: ...
def estimate_turn(
    images: _Single,
    velocities: _Single,
    accelerations: _Single | None,
    limits: tuple[float, float],
    noise: float | None,
    seed: int,
    progress: _Progress | None = None,
) -> float: ...

# Parts of the restoration of clips.

def looks_reach(looks: Sequence[Mapping[str, Any]]) -> int: ...
def restore_looks(
    looks: Sequence[Mapping[str, Any]],
    pad: int,
    lambdas: Sequence[float],
    noise: float,
    robust: float,
    first: tuple[int, int],
    following: tuple[int, int],
    sharp: bool = False,
    start: _Single | None = None,
    progress: _Progress | None = None,
) -> tuple[list[_Single], list[float]]: ...
def record_look(look: Mapping[str, Any], x: _Single, pad: int) -> _Single: ...
def frame_motion(
    forward: _Single | None = None,
    backward: _Single | None = None,
    acceleration: _Single | None = None,
) -> tuple[_Single, _Single]: ...
def visibility(velocity: _Single, exposure: float) -> _Single: ...
def regions(mask: NDArray[np.bool_]) -> tuple[NDArray[np.uint32], int]: ...
def dilated(mask: NDArray[np.bool_], radius: int) -> NDArray[np.bool_]: ...

@final
class MotionOperator:
    def __new__(
        cls,
        velocity: NDArray[Any],
        exposure: float,
        acceleration: NDArray[Any] | None,
        offset: NDArray[Any] | None,
        taps: str,
        pad: int | None,
    ) -> MotionOperator: ...
    @property
    def unknown_shape(self) -> tuple[int, int]: ...
    @property
    def data_shape(self) -> tuple[int, int]: ...
    @property
    def pad(self) -> int: ...
    def forward(self, x: _Single) -> _Single: ...
    def adjoint(self, b: _Single) -> _Single: ...

# Metrics.

def estimate_noise(image: _Double, flow: _Double, exposure: float) -> float: ...
def error_map(name: str, flow: _Double, truth: _Double) -> _Double: ...
def psnr(a: _Double, b: _Double, data_range: float) -> float: ...
def ssim(a: _Double, b: _Double, data_range: float) -> float: ...

# Threads.

def build_info() -> list[tuple[str, str]]: ...
def set_num_threads(n: int) -> None: ...
def get_num_threads() -> int: ...
