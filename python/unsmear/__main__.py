"""``python -m unsmear``."""

from unsmear.cli import entry

# A process that another one spawns imports this module under another name.
if __name__ == "__main__":
    entry()
