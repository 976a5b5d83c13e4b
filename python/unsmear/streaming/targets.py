"""Which writer a target asks for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from unsmear.images import TIFF_SUFFIXES
from unsmear.sequences import is_folder_name, unknown_suffix
from unsmear.streaming.video_writer import VideoWriter
from unsmear.streaming.writer import FolderWriter, GifWriter, TiffWriter, Writer
from unsmear.video import WRITE_SUFFIXES

if TYPE_CHECKING:
    from unsmear.frame_files import Source
    from unsmear.streaming.clip import Clip

__all__ = ["writer_for"]


def writer_for(clip: Clip, target: Source, *, audio: bool) -> Writer:
    """Return what writes ``target``, sure that it may be written."""
    path = Path(target)
    suffix = path.suffix.lower()
    writer: Writer
    if is_folder_name(target):
        writer = FolderWriter(clip, path)
    elif suffix in TIFF_SUFFIXES:
        writer = TiffWriter(clip)
    elif suffix == ".gif":
        writer = GifWriter(clip)
    elif suffix in WRITE_SUFFIXES:
        writer = VideoWriter(clip, suffix, audio=audio)
    else:
        raise unknown_suffix(path)
    writer.check_target(path)
    timed = isinstance(writer, GifWriter | VideoWriter)
    if clip.has_clock and not timed:
        writer.warnings.append("the target has no clock: the frame rate is lost")
    if (
        audio
        and clip.video
        and clip.video.audio
        and not isinstance(writer, VideoWriter)
    ):
        writer.warnings.append("the target holds no sound: it is left out")
    return writer
