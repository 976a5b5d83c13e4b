"""A long clip from file to file: memory, kills, Ctrl-C. What it prints stands in docs.

A clip of moving texture is made, with sound and an NTSC frame rate, and restored by
`unsmear deblur` in processes of their own:

    memory      the peak for half of the frames and for all of them, of the process
                and of it with its children: equal within 5 %
    kill        SIGKILL at three random moments, each time taken up with --resume: the
                same bytes as unbroken
    interrupt   SIGINT: seconds to the end, and what is left beside the source

The method is "wiener", the noise and the motion are given, the latter of a band of the
picture only: the quickest there is, as what is tested does not depend on it.
`--automatic` measures memory with nothing given, the default.

Example: python benches/long_clip.py memory --frames 600 --size 640x360
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import unsmear

RATE = Fraction(30000, 1001)
SPEED, EXPOSURE = 8, 0.75  # px/frame to the left and back
BAND = 4  # px: rows whose motion is given, the others are copied
SOUND_RATE = 44100
MOST_GROWTH = 1.05
POLL = 0.02  # s
KILLS = 3
MEBI = 2**20


def make_clip(path: Path, count: int, size: tuple[int, int]) -> None:
    """Write a panning clip with sound."""
    width, height = size
    reach = 40 * SPEED
    planes = [
        unsmear.synthetic.texture((height, width + reach + SPEED), seed=seed)
        for seed in range(3)
    ]
    light = np.stack(planes, axis=-1).clip(0, 1)
    taps = round(SPEED * EXPOSURE)
    blurred = sum(light[:, k : k + width + reach + 1] for k in range(taps)) / taps
    wide = np.rint(255 * blurred).astype(np.uint8)
    rng = np.random.default_rng(0)
    with av.open(str(path), "w") as container:
        video = container.add_stream("libx264", rate=RATE)
        video.width, video.height, video.pix_fmt = width, height, "yuv420p"
        video.options = {"crf": "12", "preset": "veryfast"}
        sound = container.add_stream("aac", rate=SOUND_RATE, layout="mono")
        for t in range(count):
            step = t % 80
            left = SPEED * (step if step <= 40 else 80 - step)
            noisy = wide[:, left : left + width] + rng.normal(0, 1, (height, width, 1))
            picture = np.rint(noisy).clip(0, 255).astype(np.uint8)
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts = t
            container.mux(video.encode(frame))
        container.mux(video.encode(None))
        samples = np.sin(np.arange(int(SOUND_RATE * count / RATE)) / 20)
        tone = av.AudioFrame.from_ndarray(
            samples.astype(np.float32)[np.newaxis], format="fltp", layout="mono"
        )
        tone.sample_rate, tone.pts = SOUND_RATE, 0
        container.mux(sound.encode(tone))
        container.mux(sound.encode(None))


def command(clip: Path, target: Path, *more: str, automatic: bool = False) -> list[str]:
    start = [sys.executable, "-m", "unsmear", "deblur", str(clip), "-o", str(target)]
    if automatic:
        return [*start, *more]
    flow = clip.with_suffix(".flo")
    quick = ["--method=wiener", "--noise=1", f"--exposure={EXPOSURE}"]
    return [*start, *quick, f"--flow={flow}", *more]


def memory_of(process: int) -> int:
    """Resident bytes of a process and those below it."""
    total = 0
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            status = (folder / "status").read_text()
        except OSError:
            continue
        fields = dict(line.split(":", 1) for line in status.splitlines() if ":" in line)
        number, parent = int(fields["Pid"]), int(fields["PPid"])
        if process in (number, parent) and "VmRSS" in fields:
            total += 1024 * int(fields["VmRSS"].split()[0])
    return total


def measured(arguments: list[str]) -> dict[str, float]:
    """Run to the end: seconds, and peak bytes of the process and of all together."""
    started = time.perf_counter()
    child = subprocess.Popen(arguments, stdout=subprocess.DEVNULL)
    together = 0
    while True:
        # WNOWAIT is not offered for usage, hence the poll by wait4 itself.
        number, status, usage = os.wait4(child.pid, os.WNOHANG)
        if number:
            break
        together = max(together, memory_of(child.pid))
        time.sleep(POLL)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        sys.exit(f"{arguments} ended with {child.returncode}")
    return {
        "seconds": time.perf_counter() - started,
        "cpu": usage.ru_utime + usage.ru_stime,
        "alone": 1024 * usage.ru_maxrss,
        "together": together,
    }


def memory(
    folder: Path, counts: list[int], size: tuple[int, int], *, automatic: bool
) -> bool:
    """Compare the peaks of clips of different length."""
    peaks = []
    for frames in counts:
        clip = prepared(folder, frames, size)
        target = folder / f"out{frames}.mp4"
        found = measured(command(clip, target, automatic=automatic))
        print(
            f"{frames} frames: {found['seconds']:.0f} s, {found['cpu']:.0f} s of "
            f"processor, peak {found['alone'] / MEBI:.1f} MiB, with children "
            f"{found['together'] / MEBI:.1f} MiB",
            flush=True,
        )
        peaks.append(found)
    growth = [peaks[-1][name] / peaks[0][name] for name in ("alone", "together")]
    print(f"growth: {growth[0]:.3f} alone, {growth[1]:.3f} with children")
    return max(growth) < MOST_GROWTH


def kill(folder: Path, count: int, size: tuple[int, int], seed: int) -> bool:
    """Kill three times, take up, compare with the unbroken run."""
    clip = prepared(folder, count, size)
    whole = folder / f"out{count}.mp4"
    if not whole.exists():
        measured(command(clip, whole))
    target = folder / "killed.mp4"
    moments = sorted(random.Random(seed).sample(range(1, count), KILLS))
    for moment in moments:
        child = subprocess.Popen(command(clip, target, "--resume"))
        while finished(target) < moment and child.poll() is None:
            time.sleep(POLL)
        child.kill()
        child.wait()
        print(f"killed with {finished(target)} of {count} frames done", flush=True)
    measured(command(clip, target, "--resume"))
    same = target.read_bytes() == whole.read_bytes()
    print(f"{whole.stat().st_size} bytes, {'the same' if same else 'NOT THE SAME'}")
    return same and not target.with_name("killed.mp4.part").exists()


def finished(target: Path) -> int:
    """Frames that a run has finished, by the highest number it has kept."""
    part = target.with_name(f"{target.name}.part")
    names = [path.name for path in part.glob("frame_*")] if part.is_dir() else []
    if names:
        return 1 + max(int(name.rpartition("_")[2]) for name in names)
    pieces = len(list(part.glob("piece_*.json"))) if part.is_dir() else 0
    return pieces * 48


def interrupt(folder: Path, count: int, size: tuple[int, int], times: int) -> bool:
    """Interrupt at random moments and measure how long the end takes."""
    # A shell ignores interrupts for what it starts in the background.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    clip = prepared(folder, count, size)
    chance = random.Random(1)
    delays = []
    for turn in range(times):
        target = folder / "interrupted.mp4"
        automatic = turn % 2 == 1
        child = subprocess.Popen(
            command(clip, target, automatic=automatic), stderr=subprocess.PIPE
        )
        while not target.with_name("interrupted.mp4.part").exists():
            time.sleep(POLL)
        time.sleep(chance.uniform(0.2, 6))
        started = time.perf_counter()
        child.send_signal(signal.SIGINT)
        child.communicate()
        delays.append(time.perf_counter() - started)
        left = sorted(path.name for path in folder.glob("*interrupted*"))
        print(
            f"{'automatic' if automatic else 'wiener'}: {delays[-1]:.3f} s, status "
            f"{child.returncode}, left behind: {left or 'nothing'}",
            flush=True,
        )
        if left:
            return False
    print(f"longest {max(delays):.3f} s, median {np.median(delays):.3f} s")
    return True


def prepared(folder: Path, count: int, size: tuple[int, int]) -> Path:
    """Return the clip, made if it is not there, with its flow beside it."""
    clip = folder / f"clip{count}.mp4"
    if not clip.exists():
        make_clip(clip, count, size)
        flow = np.full((size[1], size[0], 2), np.nan, np.float32)
        flow[:BAND] = (-SPEED, 0)
        unsmear.write_flow(clip.with_suffix(".flo"), flow)
    return clip


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["memory", "kill", "interrupt", "all"])
    parser.add_argument("--frames", type=int, default=600)
    parser.add_argument("--counts", type=int, nargs="+", help="default half and all")
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--seed", type=int, default=0, help="of the moments to kill at")
    parser.add_argument("--times", type=int, default=6, help="interruptions")
    parser.add_argument("--automatic", action="store_true")
    parser.add_argument("--work", help="folder to keep clips in; default temporary")
    options = parser.parse_args()
    width, height = map(int, options.size.split("x"))
    size = (width, height)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(options.work or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        good = True
        if options.what in ("memory", "all"):
            counts = options.counts or [options.frames // 2, options.frames]
            good &= memory(folder, counts, size, automatic=options.automatic)
        if options.what in ("kill", "all"):
            good &= kill(folder, options.frames, size, options.seed)
        if options.what in ("interrupt", "all"):
            good &= interrupt(folder, options.frames, size, options.times)
    sys.exit(not good)


if __name__ == "__main__":
    main()
