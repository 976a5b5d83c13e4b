"""Files that appear whole or not at all.

A file is written under a hidden temporary name in the folder of its target and then
renamed with ``os.replace``. A rename inside one file system is atomic (POSIX.1-2017,
``rename``; Windows ``MoveFileEx``), hence a reader, or a user after a crash, finds
the old file or the new one and never half of either.

The temporary name starts with a dot, so that folder readers skip a file left behind
by a killed process, and keeps the suffix of the target, from which encoders derive
the format.
"""

from __future__ import annotations

import os
import secrets
import shutil
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

_NEW_FILE_MODE = 0o666
"""Permissions asked for; the process's umask takes its share away as usual."""


@contextmanager
def atomic_path(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Lend a temporary path whose file becomes ``target`` when the block succeeds.

    Parameters
    ----------
    target : path-like
        The file to write. A symbolic link is followed: the file it points to is
        replaced, not the link. An existing file lends its permissions.

    Yields
    ------
    pathlib.Path
        An existing empty file in the same folder with the same suffix. If the block
        raises, it is removed and ``target`` stays as it was.

    Raises
    ------
    FileNotFoundError
        If the folder of ``target`` does not exist.
    ValueError
        If ``target`` exists and is not a regular file (a folder, a device).
    """
    final = replaceable(target)
    temporary = final.with_name(f".tmp-{secrets.token_hex(8)}{final.suffix}")
    flags = os.O_CREAT | os.O_EXCL | os.O_WRONLY
    # os.open honours the umask, which tempfile.mkstemp (always 0600) does not.
    os.close(os.open(temporary, flags, _NEW_FILE_MODE))
    try:
        yield temporary
        put_in_place(temporary, final)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


def replaceable(target: str | os.PathLike[str]) -> Path:
    """Return the file to write for ``target``, links followed, checked as above."""
    final = Path(os.path.realpath(target))
    if final.exists() and not final.is_file():
        raise ValueError(
            f"target: expected a file that may be replaced, got {str(target)!r}, "
            "which is a folder or a device"
        )
    if not final.parent.is_dir():
        raise FileNotFoundError(
            f"target: the folder {str(final.parent)!r} does not exist; "
            "create it before writing"
        )
    return final


def put_in_place(temporary: Path, final: Path) -> None:
    """Give a file that is whole its name, and the permissions of the one it follows."""
    if final.exists():
        shutil.copymode(final, temporary)
    os.replace(temporary, final)  # noqa: PTH105 -- the atomic rename itself


def write_bytes_atomic(target: str | os.PathLike[str], data: bytes) -> None:
    """Write ``data`` to ``target`` whole or not at all; see `atomic_path`."""
    with atomic_path(target) as temporary:
        temporary.write_bytes(data)
