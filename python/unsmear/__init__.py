"""Phase-based optical flow and pixel-by-pixel removal of motion blur."""

from __future__ import annotations

from unsmear import convert, metrics, noise, plot, synthetic
from unsmear._unsmear import __version__, get_num_threads, set_num_threads
from unsmear.blur import blur
from unsmear.component_velocity import ComponentVelocities, component_velocities
from unsmear.deblur import DeblurResult, deblur
from unsmear.demo_clip import DemoClip, demo_clip
from unsmear.exposure import ExposureEstimate, estimate_exposure
from unsmear.flow import FlowResult, optical_flow
from unsmear.flow_files import FlowFileError, read_flow, write_flow
from unsmear.images import read_image, write_image
from unsmear.motion_operator import MotionOperator
from unsmear.motions import Motion, several_motions, velocity_votes
from unsmear.psf import fspecial_motion, motion_psf
from unsmear.sequence import SequenceResult, deblur_sequence
from unsmear.sequences import read_frames, write_frames
from unsmear.streaming.clip import Clip, open_clip
from unsmear.streaming.deblur_clip import deblur_clip
from unsmear.streaming.results import ClipResult

__all__ = [
    "Clip",
    "ClipResult",
    "ComponentVelocities",
    "DeblurResult",
    "DemoClip",
    "ExposureEstimate",
    "FlowFileError",
    "FlowResult",
    "Motion",
    "MotionOperator",
    "SequenceResult",
    "__version__",
    "blur",
    "component_velocities",
    "convert",
    "deblur",
    "deblur_clip",
    "deblur_sequence",
    "demo_clip",
    "estimate_exposure",
    "fspecial_motion",
    "get_num_threads",
    "metrics",
    "motion_psf",
    "noise",
    "open_clip",
    "optical_flow",
    "plot",
    "read_flow",
    "read_frames",
    "read_image",
    "set_num_threads",
    "several_motions",
    "synthetic",
    "velocity_votes",
    "write_flow",
    "write_frames",
    "write_image",
]
