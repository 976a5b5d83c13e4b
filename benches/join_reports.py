"""Reports of one bench, run in slices, joined into one page.

    python benches/join_reports.py deblur_table PART [PART ...] [--output docs]

A bench that takes an hour can be run by picture, seed or motion, each slice into a
folder of its own. Reads ``PART/<bench>.json`` in the order given; of records of the
same case the last one counts, so that a slice measured again takes the place of the
old one. Writes ``<bench>.md`` and ``.json``.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from pathlib import Path
from typing import Any

# What is measured, as against what tells records apart.
KEYS = ("clip", "case", "picture", "noise", "seed", "method")
BENCHES = ("deblur_table", "deblur_mismatch", "deblur_video")


def united(values: list[Any]) -> Any:
    """Return one value for all: lists united, single values that differ all named."""
    if isinstance(values[0], list):
        return list(dict.fromkeys(item for some in values for item in some))
    different = list(dict.fromkeys(values))
    return different[0] if len(different) == 1 else " and ".join(map(str, different))


def joined(reports: list[dict[str, Any]]) -> dict[str, Any]:
    """Return one report; versions and sizes must agree."""
    for name in ("version", "size", "joint"):
        if len({report.get(name) for report in reports}) > 1:
            raise ValueError(f"reports differ in {name} and cannot be joined")
    records = {
        tuple(record.get(key) for key in KEYS): record
        for report in reports
        for record in report["records"]
    }
    names = [name for name in reports[-1] if name != "records"]
    whole = {name: united([r[name] for r in reports if name in r]) for name in names}
    return whole | {"records": list(records.values())}


def main() -> int:
    """Read, join, write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("bench", choices=BENCHES)
    parser.add_argument("parts", nargs="+", type=Path)
    parser.add_argument("--output", type=Path, default=Path("docs"))
    given = parser.parse_args()
    name = given.bench
    texts = [(part / f"{name}.json").read_text("utf-8") for part in given.parts]
    report = joined([json.loads(text) for text in texts])
    page = importlib.import_module(name).markdown(report)
    given.output.mkdir(parents=True, exist_ok=True)
    text = json.dumps(report, indent=1)
    (given.output / f"{name}.json").write_text(text + "\n", "utf-8")
    (given.output / f"{name}.md").write_text(page, "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
