"""What ``unsmear --version`` says: enough to tell two installations apart."""

from __future__ import annotations

import json
import shutil
import subprocess
from importlib import metadata
from pathlib import Path
from typing import Any
from urllib.parse import urlparse
from urllib.request import url2pathname

from unsmear import get_num_threads
from unsmear._versions import versions

_PATIENCE = 5  # seconds for git


def about() -> str:
    """Return name and version on the first line, then what runs under what."""
    known = versions()
    first = f"unsmear {known.pop('unsmear')}"
    lines = {
        "commit": _commit() or "unknown",
        **known,
        "threads": str(get_num_threads()),
    }
    return "\n".join([first, *(f"{k:<8} {v}" for k, v in lines.items())])


def _commit() -> str | None:
    """Return the commit that was installed, as the installer recorded it (PEP 610)."""
    try:
        text = metadata.distribution("unsmear").read_text("direct_url.json")
        record: dict[str, Any] = json.loads(text) if text else {}
    except (metadata.PackageNotFoundError, json.JSONDecodeError):
        return None
    version_control = record.get("vcs_info", {})
    if "commit_id" in version_control:
        return str(version_control["commit_id"])
    if record.get("dir_info", {}).get("editable"):
        return _commit_of(Path(url2pathname(urlparse(record["url"]).path)))
    return None


def _commit_of(folder: Path) -> str | None:
    """Return the commit of a working copy, marked if files differ from it."""
    git = shutil.which("git")
    if git is None:
        return None
    command = [git, "-C", str(folder), "describe", "--always", "--dirty", "--abbrev=12"]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_PATIENCE, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() or None if done.returncode == 0 else None
