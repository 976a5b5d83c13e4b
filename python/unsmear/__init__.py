"""Phase-based optical flow and pixel-by-pixel removal of motion blur."""

from __future__ import annotations

from unsmear import metrics, plot
from unsmear._unsmear import __version__, get_num_threads, set_num_threads
from unsmear.component_velocity import ComponentVelocities, component_velocities
from unsmear.flow import FlowResult, optical_flow
from unsmear.flow_files import FlowFileError, read_flow, write_flow
from unsmear.images import read_image, write_image
from unsmear.sequences import read_frames, write_frames

__all__ = [
    "ComponentVelocities",
    "FlowFileError",
    "FlowResult",
    "__version__",
    "component_velocities",
    "get_num_threads",
    "metrics",
    "optical_flow",
    "plot",
    "read_flow",
    "read_frames",
    "read_image",
    "set_num_threads",
    "write_flow",
    "write_frames",
    "write_image",
]
