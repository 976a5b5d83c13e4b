"""Join encoded pieces of a video, and the sound of its source: a process that may die.

The sound is copied out of a file that may be hostile, hence the process of its own,
started by `streaming.video_writer`; it imports nothing of this package. Its argument
is a file of JSON:

    pieces      videos of equal format, no frame leaning on a later one
    output      the file to write
    ticks       time of every frame, in units of
    unit        [numerator, denominator] seconds
    rate        [numerator, denominator] frames per second, or null if it varies
    sound       file to copy the audio streams from, or null
    trial       whether to stop behind the header, which shows what does not fit

Standard input is the lifeline: when it ends, so does this process, whoever killed its
parent. An exit status other than 0 is a failure; the last line on standard error is
the error number, or 0, and the reason.
"""

from __future__ import annotations

import heapq
import importlib
import json
import os
import sys
import threading
from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

    Timed = tuple[float, int, Any]

_OPTIONS = {"protocol_whitelist": "file"}
_BITEXACT = {"fflags": "bitexact"}  # no random identifiers in the file


def pictures(av: Any, job: dict[str, Any], stream: Any) -> Iterator[Timed]:
    """Yield time (s), order and packet of every frame."""
    ticks, unit = job["ticks"], Fraction(*job["unit"])
    count = 0
    for piece in job["pieces"]:
        with av.open(piece) as container:
            for packet in container.demux(video=0):
                if packet.size:
                    packet.stream, packet.time_base = stream, unit
                    packet.pts = packet.dts = ticks[count]
                    packet.duration = 0
                    if count + 1 < len(ticks):
                        packet.duration = ticks[count + 1] - ticks[count]
                    yield float(ticks[count] * unit), 0, packet
                    count += 1
    if count != len(ticks):
        raise ValueError(f"the pieces hold {count} frames, not {len(ticks)}")


def sounds(source: Any, streams: dict[int, Any]) -> Iterator[Timed]:
    """Yield time (s), order and packet of all audio."""
    for packet in source.demux(list(source.streams.audio)):
        if packet.size and packet.dts is not None:
            time = float(packet.dts * packet.time_base)
            packet.stream = streams[packet.stream_index]
            yield time, 1, packet


def added(av: Any, output: Any, like: Any, rate: list[int] | None) -> Any:
    """Return a stream for packets of the stream ``like``.

    Only the encoder's own stream carries a frame rate into Matroska's header; FFV1's
    head, unlike that of H.264, is the same in every container.
    """
    given = like.codec_context
    if rate is None or given.name != "ffv1":
        return output.add_stream_from_template(like)
    stream = output.add_stream("ffv1", rate=Fraction(*rate))
    stream.width, stream.height, stream.pix_fmt = like.width, like.height, given.pix_fmt
    context = stream.codec_context
    context.flags |= av.codec.context.Flags.bitexact.value
    context.thread_count = 1
    if like.sample_aspect_ratio:
        context.sample_aspect_ratio = like.sample_aspect_ratio
    context.color_primaries = given.color_primaries
    context.color_trc = given.color_trc
    return stream


def join(job: dict[str, Any]) -> None:
    """Write the file."""
    av = importlib.import_module("av")
    with ExitStack() as stack:
        first = stack.enter_context(av.open(job["pieces"][0]))
        output = stack.enter_context(
            av.open(job["output"], "w", container_options=_BITEXACT)
        )
        output.flags |= av.container.Flags.bitexact.value
        video = added(av, output, first.streams.video[0], job["rate"])
        video.time_base = Fraction(*job["unit"])
        ways = [pictures(av, job, video)]
        if job["sound"]:
            source = stack.enter_context(
                av.open(job["sound"], metadata_errors="ignore", options=_OPTIONS)
            )
            audio = {
                one.index: output.add_stream_from_template(one)
                for one in source.streams.audio
            }
            ways.append(sounds(source, audio))
        output.start_encoding()
        if (
            video.codec_context.extradata
            != first.streams.video[0].codec_context.extradata
        ):
            raise ValueError("the pieces were made by another encoder")
        if not job["trial"]:
            # In order of time, or the container would hold back one of them whole.
            for _, _, packet in heapq.merge(*ways, key=lambda timed: timed[:2]):
                output.mux(packet)


def _end_with_parent() -> None:
    # Unbuffered: a lock on the buffer could not be taken back at the end.
    while os.read(0, 1):
        pass
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        join(json.loads(Path(sys.argv[1]).read_text("utf-8")))
    except Exception as error:
        number = getattr(error, "errno", None) or 0
        sys.exit(f"{number} {error or type(error).__name__}".replace("\n", " "))
