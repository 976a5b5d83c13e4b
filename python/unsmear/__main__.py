"""``python -m unsmear``."""

from unsmear.cli import entry

entry()
