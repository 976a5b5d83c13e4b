"""Phase-based optical flow and pixel-by-pixel removal of motion blur."""

from __future__ import annotations

from unsmear._unsmear import __version__, get_num_threads, set_num_threads

__all__ = ["__version__", "get_num_threads", "set_num_threads"]
