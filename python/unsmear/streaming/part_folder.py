"""What is finished of an unfinished job, on disk beside its target.

The folder ``TARGET.part`` holds

    job.json                what is made: source, parameters, format, version
    frame_000012            a frame not yet in a piece: digest, report, samples
    piece_000000.*, .json   a finished piece of the target; its digest and reports
    sample_000012.npz       flow and restored frame, of the few that a report shows

Every file appears whole or not at all, and its BLAKE2b digest (RFC 7693) is checked
before it is used; what does not match is made again. A lock keeps two runs apart where
the system has locks. The folder is removed when the target is in place, and after a
failure or an interruption unless it is to be resumed.
"""

from __future__ import annotations

import hashlib
import importlib
import json
import shutil
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from unsmear.streaming.writer import Writer

__all__ = ["AtWorkError", "PartFolder", "discard_part"]

JOB, LOCK = "job.json", "lock"
DIGEST_BYTES = 16
CHUNK = 1 << 20


class AtWorkError(OSError):
    """Another process is at work on the target."""


class PartFolder:
    """The unfinished parts of ``target``; a context manager.

    Parameters
    ----------
    target : pathlib.Path
        The file or folder to make.
    job : dict
        Plain data that decides every byte of it; an unfinished job with other data is
        not gone on with.
    writer : Writer
        Makes the pieces.
    resume : bool
        Go on with what is there, and keep it when this run is broken off too.

    Raises
    ------
    ValueError
        If an unfinished job differs, or ``TARGET.part`` is something else.
    OSError
        If the folder cannot be made, or another process is at work in it.
    """

    def __init__(
        self, target: Path, job: dict[str, Any], writer: Writer, *, resume: bool
    ) -> None:
        self._target = target
        self._writer = writer
        self._keep = resume
        self._job = job
        self.path = _part_of(target)
        self._lock: Any = None
        self.pieces: list[Path] = []
        self.done = 0
        self._in_pieces = 0

    def __enter__(self) -> PartFolder:
        if self.path.is_dir() and not (self.path / JOB).is_file():
            foreign = {entry.name for entry in self.path.iterdir()} - {LOCK}
            if any(not name.startswith(".tmp-") for name in foreign):
                msg = f"{str(self.path)!r} must be an unfinished job, or not be there"
                raise ValueError(msg)
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            msg = (
                "output must be in a folder that can be written to, got "
                f"{str(self._target)!r}: {error.strerror}"
            )
            raise type(error)(msg) from error
        self._take_lock()
        try:
            self._take_up()
        except BaseException:
            self._end(remove=not self._keep)
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._end(remove=kind is None or not self._keep)

    def add(self, picture: NDArray[Any], report: dict[str, Any]) -> None:
        """Keep the next frame."""
        if self._writer.length > 1:
            self._write(_record(self.done), _packed(picture, report))
        self.done += 1
        if self._writer.length == 1:
            self._finish_piece([report], iter([picture]))
        else:
            self.finish_pieces(last=False)

    def finish_pieces(self, *, last: bool) -> None:
        """Make pieces of the frames that fill one, or, at the ``last``, of the rest."""
        while (count := self.done - self._in_pieces) > 0:
            if count < self._writer.length and not last:
                return
            chosen = range(self._in_pieces, self._in_pieces + count)
            chosen = chosen[: self._writer.length]
            kept = [self._frame(index) for index in chosen]
            reports = [report for _, report in kept]
            self._finish_piece(reports, (picture() for picture, _ in kept))
            for index in chosen:
                (self.path / _record(index)).unlink()

    def add_sample(
        self, index: int, *, restored: NDArray[Any], flow: NDArray[np.float32]
    ) -> None:
        """Keep a restored frame and its velocity for a report."""
        temporary = self.path / ".tmp-sample.npz"
        np.savez(temporary, restored=restored, flow=flow)
        temporary.replace(self.path / f"sample_{index:06d}.npz")

    def sample(self, index: int) -> dict[str, NDArray[Any]]:
        """Return what `add_sample` kept."""
        with np.load(self.path / f"sample_{index:06d}.npz") as arrays:
            return {name: arrays[name] for name in arrays.files}

    def reports(self) -> Iterator[dict[str, Any]]:
        """Yield the reports of all frames in pieces."""
        for number in range(len(self.pieces)):
            yield from json.loads(self._notes(number).read_text("utf-8"))["reports"]

    def _finish_piece(
        self, reports: list[dict[str, Any]], frames: Iterator[NDArray[Any]]
    ) -> None:
        number = len(self.pieces)
        name = f"piece_{number:06d}{self._writer.suffix}"
        temporary = self.path / f".tmp-{name}"
        self._writer.write_piece(temporary, frames)
        notes = {"digest": _digest(temporary), "reports": reports}
        self._write(self._notes(number).name, json.dumps(notes).encode())
        temporary.replace(self.path / name)
        self.pieces.append(self.path / name)
        self._in_pieces += len(reports)

    def _notes(self, number: int) -> Path:
        return self.path / f"piece_{number:06d}.json"

    def _write(self, name: str, data: bytes) -> None:
        temporary = self.path / f".tmp-{name}"
        temporary.write_bytes(data)
        temporary.replace(self.path / name)

    def _take_up(self) -> None:
        """Find what is done, or start anew."""
        plan = self.path / JOB
        if plan.is_file() and self._keep:
            self._require_same(json.loads(plan.read_text("utf-8")))
        elif plan.is_file():
            for entry in self.path.iterdir():
                if entry.name != LOCK:
                    _remove(entry)
        for entry in self.path.glob(".tmp-*"):
            _remove(entry)
        self._write(JOB, json.dumps(self._job, indent=1).encode())
        while (piece := self._found_piece(len(self.pieces))) is not None:
            path, count = piece
            self.pieces.append(path)
            self._in_pieces += count
        self.done = self._in_pieces
        while self._is_frame(self.done):
            self.done += 1

    def _require_same(self, other: dict[str, Any]) -> None:
        job = json.loads(json.dumps(self._job))
        for name in sorted({*job, *other}):
            if job.get(name) != other.get(name):
                raise ValueError(
                    "resume must go on with the same source and parameters, got "
                    f"{name} = {job.get(name)!r} where the unfinished job in "
                    f"{str(self.path)!r} has {other.get(name)!r}; give what it has, or "
                    "start anew without resume"
                )

    def _found_piece(self, number: int) -> tuple[Path, int] | None:
        name = f"piece_{number:06d}{self._writer.suffix}"
        try:
            notes = json.loads(self._notes(number).read_text("utf-8"))
        except (OSError, ValueError):
            return None
        places = self._writer.places(number, self._target, self.path)
        for place in (self.path / name, *places):
            with suppress(OSError):
                if _digest(place) == notes["digest"]:
                    return place, len(notes["reports"])
        return None

    def _is_frame(self, index: int) -> bool:
        try:
            data = (self.path / _record(index)).read_bytes()
        except OSError:
            return False
        return _sum(data[DIGEST_BYTES:]) == data[:DIGEST_BYTES]

    def _frame(self, index: int) -> tuple[Any, dict[str, Any]]:
        """Return a way to a frame's samples, and its report."""

        def unpacked() -> tuple[dict[str, Any], bytes]:
            data = (self.path / _record(index)).read_bytes()[DIGEST_BYTES:]
            head, _, samples = data.partition(b"\n")
            return json.loads(head), samples

        def picture() -> NDArray[Any]:
            head, samples = unpacked()
            return np.frombuffer(samples, head["dtype"]).reshape(head["shape"])

        return picture, unpacked()[0]["report"]

    def _take_lock(self) -> None:
        self._lock = _locked(self.path)

    def _end(self, *, remove: bool) -> None:
        self._lock.close()
        if remove:
            shutil.rmtree(self.path, ignore_errors=True)


def discard_part(target: Path) -> None:
    """Remove what is finished of a job nobody is at work on; other folders stay."""
    part = _part_of(target)
    with suppress(OSError):
        if (part / JOB).is_file():
            with _locked(part):
                shutil.rmtree(part, ignore_errors=True)


def _part_of(target: Path) -> Path:
    return target.with_name(f"{target.name}.part")


def _locked(part: Path) -> Any:
    """Return the open file that locks a folder until it is closed."""
    lock = (part / LOCK).open("w")
    # A system without such locks leaves it to the user to run one at a time.
    with suppress(ImportError):
        fcntl = importlib.import_module("fcntl")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            msg = f"another process is at work in {str(part)!r}"
            raise AtWorkError(msg) from None
    return lock


def _record(index: int) -> str:
    return f"frame_{index:06d}"


def _packed(picture: NDArray[Any], report: dict[str, Any]) -> bytes:
    head = {"shape": picture.shape, "dtype": picture.dtype.name, "report": report}
    data = json.dumps(head).encode() + b"\n" + np.ascontiguousarray(picture).tobytes()
    return _sum(data) + data


def _sum(data: bytes) -> bytes:
    return hashlib.blake2b(data, digest_size=DIGEST_BYTES).digest()


def _digest(path: Path) -> str:
    digest = hashlib.blake2b(digest_size=DIGEST_BYTES)
    with path.open("rb") as file:
        while chunk := file.read(CHUNK):
            digest.update(chunk)
    return digest.hexdigest()


def _remove(entry: Path) -> None:
    if entry.is_dir():
        shutil.rmtree(entry)
    else:
        entry.unlink()
