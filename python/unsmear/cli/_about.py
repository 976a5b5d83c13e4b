"""What ``unsmear --version`` says: enough to tell two installations apart."""

from __future__ import annotations

import json
import platform
import shutil
import subprocess
from importlib import metadata
from pathlib import Path
from typing import Any
from urllib.parse import urlparse
from urllib.request import url2pathname

import numpy as np

from unsmear import __version__, _unsmear, get_num_threads

_PATIENCE = 5  # seconds for git


def about() -> str:
    """Return name and version on the first line, then what runs under what."""
    commit = _commit()
    lines = {
        "commit": commit or "unknown",
        "core": "optimised" if _unsmear.optimized else "built without optimisation",
        "threads": str(get_num_threads()),
        "vectors": _vectors(),
        "python": f"{platform.python_version()} ({platform.python_implementation()})",
        "numpy": np.__version__,
        "machine": f"{platform.machine()}, {platform.system()}",
    }
    return "\n".join(
        [f"unsmear {__version__}", *(f"{k:<8} {v}" for k, v in lines.items())]
    )


def _vectors() -> str:
    """Return the processor's vector extensions as NumPy sees them.

    The core chooses among AVX-512, AVX2 and SSE2 by the same processor's word.
    """
    found: dict[str, Any] = dict(np.show_config(mode="dicts") or {})
    extensions = found.get("SIMD Extensions", {})
    names = [*extensions.get("baseline", ()), *extensions.get("found", ())]
    return " ".join(names) or "unknown"


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
