"""Videos written piece by piece, depth, clock, colours and sound kept.

Pieces of `LENGTH` frames are encoded each by a fresh encoder with one thread and no
frame that leans on a later one; at the end their packets are joined without encoding
again. So the bytes of the whole depend on the frames alone, not on where an earlier
run was broken off or on the number of processors.

.mkv .avi   FFV1 (RFC 9043), lossless, of 8, 10, 12, 14 or 16 bit like the source
.mp4 .mov   H.264 (ITU-T H.264) of 8 bit, of 10 for every deeper source; chroma like
            the source's, where the size allows; constant rate factor `QUALITY`

Colour range, matrix, primaries, transfer (ITU-T H.273) and shape of pixels are those
of the source. .avi has no varying frame rate.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._video_stream import CONVERSION, require_pyav
from unsmear.images import as_integers
from unsmear.streaming.clock import LARGEST_DENOMINATOR
from unsmear.streaming.writer import Writer, in_unit_range, require_unit_range
from unsmear.video import H264_QUALITY, LOSSLESS_SUFFIXES, SMPTE_170M

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from unsmear.streaming.clip import Clip

__all__ = ["VideoWriter"]

LENGTH = 48
"""Frames per piece: two seconds of film; fewer cost key frames, more cost work that
is done again after a break."""
DEPTHS = (8, 10, 12, 14, 16)
DEEP_H264 = 10
LIMITED = 1
MATRICES = (1, 4, 5, 6, 7, 9)
"""Matrices of YCbCr that can be computed, by their numbers in H.273; 6 otherwise."""
CHROMA = {(2, 2): "420", (2, 1): "422", (1, 1): "444"}
MUX_CHILD = Path(__file__).parents[1] / "_mux_child.py"


class VideoWriter(Writer):
    """Writes .mkv, .avi, .mp4 and .mov."""

    length = LENGTH

    def __init__(self, clip: Clip, suffix: str, *, audio: bool) -> None:
        super().__init__()
        self._av = require_pyav()
        self._clip = clip
        require_unit_range(clip)
        self._rate = clip.clock.rate.limit_denominator(LARGEST_DENOMINATOR)
        self._final = suffix
        self.suffix = ".mkv"
        height, width = clip.shape[1:3]
        self._grey = len(clip.shape) == 3
        self._lossless = suffix in LOSSLESS_SUFFIXES
        bits = clip.bits or 16
        colour = clip.video.colour if clip.video else {}
        self._range = colour.get("range", 0) or LIMITED
        self._primaries = colour.get("primaries", 2)
        self._transfer = colour.get("transfer", 2)
        matrix = colour.get("matrix", SMPTE_170M)
        self._matrix = matrix if matrix in MATRICES else SMPTE_170M
        if self._lossless:
            self._bits = next(depth for depth in DEPTHS if depth >= bits)
            self._format = _lossless_format(self._bits, grey=self._grey)
        else:
            self._bits = 8 if bits == 8 else DEEP_H264
            chroma = CHROMA.get((clip.video and clip.video.chroma) or (2, 2), "420")
            if (chroma == "420" and height % 2) or (chroma != "444" and width % 2):
                chroma = "444"
            self._format = f"yuv{chroma}p" + ("10le" if self._bits > 8 else "")
        has_sound = bool(clip.video and clip.video.audio)
        self._sound = str(clip.path.absolute()) if audio and has_sound else None
        if suffix == ".avi" and clip.clock.stamps is not None:
            self.warnings.append(
                f"the frame rate varies, which .avi cannot: {float(clip.clock.rate):g} "
                "frames per second throughout"
            )

    def describe(self) -> dict[str, Any]:
        """Return what decides the bytes, beside the frames."""
        return {
            "suffix": self._final,
            "format": self._format,
            "range": self._range,
            "matrix": self._matrix,
            "sound": self._sound is not None,
        }

    def prepared(self, picture: NDArray[Any]) -> NDArray[Any]:
        """Return the samples that are encoded, uint8 or uint16."""
        eight = 8 if self._bits == 8 else None
        return as_integers(in_unit_range(picture), "frames", eight)

    def write_piece(self, path: Path, frames: Iterable[NDArray[Any]]) -> None:
        """Write a piece."""
        av = self._av
        rate = self._rate
        options = {"fflags": "bitexact"}
        with av.open(str(path), "w", container_options=options) as container:
            container.flags |= av.container.Flags.bitexact.value
            stream = container.add_stream(
                "ffv1" if self._lossless else "libx264", rate=rate
            )
            self._configure(stream)
            try:
                for number, picture in enumerate(frames):
                    frame = self._frame(self.prepared(picture))
                    frame.pts, frame.time_base = number, 1 / rate
                    container.mux(stream.encode(frame))
                container.mux(stream.encode(None))
            except av.FFmpegError as error:
                if isinstance(error, OSError):
                    raise
                height, width = self._clip.shape[1:3]
                raise ValueError(
                    f"frames of {width} x {height} pixels at {float(rate):g} per "
                    f"second must suit the encoder of {self._final}, got {error}"
                ) from error

    def assemble(self, pieces: Sequence[Path], target: Path) -> None:
        """Make the whole out of its pieces."""
        if self._final == ".avi":
            unit = 1 / self._rate
            ticks = list(range(len(self._clip)))
        else:
            unit, ticks = self._clip.clock.ticks(len(self._clip))
        self._join(pieces, target, unit, ticks, trial=False)

    def try_out(self, folder: Path) -> None:
        """Encode the first frame, so that what does not fit shows at once."""
        piece = folder / f".tmp-trial{self.suffix}"
        whole = folder / f".tmp-trial-whole{self._final}"
        self.write_piece(piece, [self._clip[0]])
        sound, self._sound = self._sound, None
        self._join([piece], whole, 1 / self._rate, [0], trial=True)
        self._sound = sound
        if sound:
            try:
                self._join([piece], whole, 1 / self._rate, [0], trial=True)
            except OSError as error:
                raise ValueError(
                    f"the sound of {str(self._clip.path)!r} must suit {self._final}, "
                    f"got {error}; write .mkv, or leave the sound out"
                ) from error
        piece.unlink()
        whole.unlink(missing_ok=True)

    def _configure(self, stream: Any) -> None:
        height, width = self._clip.shape[1:3]
        context = stream.codec_context
        stream.width, stream.height, stream.pix_fmt = width, height, self._format
        context.flags |= self._av.codec.context.Flags.bitexact.value
        # The number of threads changes the bytes.
        context.thread_count = 1
        if self._clip.video:
            context.sample_aspect_ratio = self._clip.video.pixel_aspect
        if not self._lossless:
            stream.options = {"crf": H264_QUALITY, "bf": "0"}
            context.colorspace = self._matrix
            context.color_range = self._range
        context.color_primaries = self._primaries
        context.color_trc = self._transfer

    def _frame(self, samples: NDArray[Any]) -> Any:
        """Return the encoder's frame of uint8 or uint16 samples."""
        if self._lossless and self._bits > 8:
            top = 2**self._bits - 1
            wide = samples.astype(np.uint32) * np.uint32(top) + np.uint32(2**15 - 1)
            scaled = (wide // np.uint32(2**16 - 1)).astype(np.uint16)
            return self._av.VideoFrame.from_ndarray(scaled, format=self._format)
        if self._grey:
            given = "gray" if samples.dtype == np.uint8 else "gray16le"
        else:
            given = "rgb24" if samples.dtype == np.uint8 else "rgb48le"
        frame = self._av.VideoFrame.from_ndarray(samples, format=given)
        if self._lossless:
            return frame.reformat(format=self._format, interpolation=CONVERSION)
        return frame.reformat(
            format=self._format,
            dst_colorspace=self._matrix,
            dst_color_range=self._range,
            interpolation=CONVERSION,
        )

    def _join(
        self,
        pieces: Sequence[Path],
        target: Path,
        unit: Fraction,
        ticks: list[int],
        *,
        trial: bool,
    ) -> None:
        rate = None
        if self._clip.clock.stamps is None or self._final == ".avi":
            rate = [self._rate.numerator, self._rate.denominator]
        job = {
            "rate": rate,
            "pieces": [str(piece) for piece in pieces],
            "output": str(target),
            "ticks": ticks,
            "unit": [unit.numerator, unit.denominator],
            "sound": self._sound,
            "trial": trial,
        }
        plan = target.with_name(".tmp-plan.json")
        plan.write_text(json.dumps(job), "utf-8")
        command = [sys.executable, "-P", str(MUX_CHILD), str(plan)]
        with (
            tempfile.TemporaryFile() as complaints,
            subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stderr=complaints,
                start_new_session=True,  # Ctrl-C is for us, who end it
            ) as child,
        ):
            try:
                status = child.wait()
            finally:
                child.kill()
            complaints.seek(0)
            text = complaints.read().decode(errors="replace").strip()
        plan.unlink()
        if status != 0:
            _complain(status, text)


def _lossless_format(bits: int, *, grey: bool) -> str:
    if bits == 8:
        return "gray" if grey else "bgr0"
    return f"gray{bits}le" if grey else f"gbrp{bits}le"


def _complain(status: int, text: str) -> None:
    """Raise what the child that joins the pieces died of."""
    if status < 0:
        raise ValueError(f"the video could not be joined: crashed (signal {-status})")
    last = (text.splitlines() or ["0 no reason given"])[-1]
    number, _, reason = last.partition(" ")
    if number.isdigit() and int(number):
        raise OSError(int(number), reason)
    raise OSError(reason or last)
