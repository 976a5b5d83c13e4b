"""The result of a suite as Markdown: one table per figure, methods by sequences.

Means run over the sequences of one folder: ``set/name`` counts to ``set``. A method
that cannot do a sequence shows a dash and is left out of that mean, so is its mean.
"""

from __future__ import annotations

import math
from typing import Any

__all__ = ["markdown"]

# Heading, key, format, whether means make sense.
_TABLES = (
    ("Mean endpoint error, px", "epe", ".3f", True),
    ("Mean angular error, degrees", "aae", ".2f", True),
    ("Density: share of pixels whose flow is told", "density", ".3f", False),
    ("Processor seconds", "seconds", ".2f", False),
    ("Peak memory beyond the frames, bytes per pixel", "bytes_per_pixel", ".0f", False),
)
_PART_TABLES = _TABLES[:2]
_DASH = "–"


def markdown(result: dict[str, Any]) -> str:
    """Return the tables of an `evaluate_suite` result, a text that ends in a newline.

    The least of each column of errors is bold, among methods that tell every pixel.
    """
    sequences, results = result["sequences"], result["results"]
    names = list(sequences)
    lines = [*_head(result), ""]
    for title, key, form, averaged in _TABLES:
        columns = {name: [(name, None)] for name in names}
        if averaged:
            columns |= {f"{group} (mean)": list(m) for group, m in _groups(names)}
        lines += [f"## {title}", "", *_table(results, columns, key, form), ""]
    parts = _parts(results)
    for title, key, form, _ in _PART_TABLES if parts else ():
        lines += [f"## {title}: parts of pictures", ""]
        lines += [*_table(results, parts, key, form), ""]
    failed = [
        f"- {method}, {name}: {entry['error']}"
        for method, entries in results.items()
        for name, entry in entries.items()
        if "error" in entry
    ]
    if failed:
        lines += ["## Not measured", "", *failed, ""]
    return "\n".join(lines[:-1]) + "\n"


def _head(result: dict[str, Any]) -> list[str]:
    machine, versions = result["machine"], result["versions"]
    libraries = ", ".join(f"{name} {version}" for name, version in versions.items())
    sizes = ", ".join(
        f"{name} {s['width']} x {s['height']} ({s['frames']})"
        for name, s in result["sequences"].items()
    )
    return [
        "# Accuracy and cost of optical flow",
        "",
        f"Measured on {result['date']}, {machine['processor']}, {machine['cores']} "
        f"cores, {machine['threads']} thread; {libraries}.",
        "",
        "All pixels of known truth, no border cropped; each method has one set of "
        "parameters for all sequences. Methods of two frames get the frame of the "
        "truth and the next, the others what they take of all. Seconds are those of "
        f"one processor{_least_of(result['runs'])}.",
        "",
        f"Sequences and frames: {sizes}.",
    ]


def _least_of(runs: int) -> str:
    return f", the least of {runs} runs" if runs > 1 else ""


def _groups(names: list[str]) -> list[tuple[str, list[tuple[str, None]]]]:
    """Folders with at least two sequences."""
    groups: dict[str, list[tuple[str, None]]] = {}
    for name in names:
        groups.setdefault(name.partition("/")[0], []).append((name, None))
    return [(group, members) for group, members in groups.items() if len(members) > 1]


def _parts(results: dict[str, Any]) -> dict[str, list[tuple[str, str | None]]]:
    columns: dict[str, list[tuple[str, str | None]]] = {}
    for entries in results.values():
        for name, entry in entries.items():
            for part in entry.get("parts", {}):
                columns[f"{name}, {part}"] = [(name, part)]
    return columns


def _table(
    results: dict[str, Any],
    columns: dict[str, Any],
    key: str,
    form: str,
) -> list[str]:
    values = {
        method: [_mean(entries, cells, key) for cells in columns.values()]
        for method, entries in results.items()
    }
    dense = {
        method: [_mean(entries, cells, "density") for cells in columns.values()]
        for method, entries in results.items()
    }
    judged = key in ("epe", "aae")
    rows = []
    for method, row in values.items():
        cells = [method]
        for column, value in enumerate(row):
            text = _DASH if math.isnan(value) else format(value, form)
            rivals = [
                values[other][column]
                for other in values
                if dense[other][column] >= 1 and not math.isnan(values[other][column])
            ]
            best = judged and rivals and value <= min(rivals)
            cells.append(f"**{text}**" if best and dense[method][column] >= 1 else text)
        rows.append("| " + " | ".join(cells) + " |")
    heads = [column.replace("/", "/ ") for column in columns]
    return [
        "| method | " + " | ".join(heads) + " |",
        "|---" * (len(columns) + 1) + "|",
        *rows,
    ]


def _mean(entries: dict[str, Any], cells: list[Any], key: str) -> float:
    found = []
    for name, part in cells:
        entry = entries.get(name, {})
        if part is not None:
            entry = entry.get("parts", {}).get(part, {})
        value = entry.get(key)
        found.append(math.nan if value is None else float(value))
    return sum(found) / len(found)
