"""Phase-based optical flow and pixel-by-pixel removal of motion blur."""

from __future__ import annotations

from unsmear._unsmear import __version__, get_num_threads, set_num_threads
from unsmear.blur import blur
from unsmear.deblur import DeblurResult, deblur
from unsmear.psf import fspecial_motion, motion_psf

__all__ = [
    "DeblurResult",
    "__version__",
    "blur",
    "deblur",
    "fspecial_motion",
    "get_num_threads",
    "motion_psf",
    "set_num_threads",
]
