"""The page of the deblurring table: gains per motion, leads on equal terms, times.

A rival may have run on fewer pictures or seeds than our methods; its means then are
over those, and leads compare both on what both have restored.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from deblur_rivals import RIVALS
from unsmear import synthetic

BORDER = 24  # px
# What the mean of the table is over: motions a correct model explains in full.
IN_THE_MEAN = ("T7", "T11", "T22", "Z", "R5", "R12", "SH")
LEADER = "tv"
KEY = ("case", "picture", "noise", "seed")

Record = dict[str, Any]


def markdown(report: dict[str, Any]) -> str:
    """Return the tables: one per noise, the worst single results, leads, and times."""
    records = report["records"]
    methods = list(dict.fromkeys(r["method"] for r in records))
    present = {r["case"] for r in records}
    cases = [case for case in synthetic.BLUR_CASES if case in present]
    head = "| case | blurred | " + " | ".join(methods) + " |"
    rule = "|---" * (len(methods) + 2) + "|"
    lines = [*introduction(report), ""]
    lines += [f"- {case}: {synthetic.BLUR_CASES[case]}" for case in cases]
    for noise in sorted(report["noises"]):
        at_noise = [r for r in records if r["noise"] == noise]
        lines += ["", f"## Noise of {noise:g} grey levels", "", head, rule]
        for case in cases:
            own = [r for r in at_noise if r["case"] == case]
            lines.append(row(case, own, methods))
        counted = [case for case in IN_THE_MEAN if case in cases]
        # A mean over other motions would look better or worse than it is.
        whole = [m for m in methods if covers(at_noise, m, counted)]
        own = [r for r in at_noise if r["case"] in counted and r["method"] in whole]
        lines.append(row("mean of " + " ".join(counted), own, methods))
        gains = [[r["gain"] for r in at_noise if r["method"] == m] for m in methods]
        worst = [f"{min(some):+.1f}" if some else "" for some in gains]
        lines.append("| worst single result | | " + " | ".join(worst) + " |")
    lines += leads(report, cases, methods)
    times = [
        f"{np.mean([r['seconds'] for r in records if r['method'] == m]):.2f}"
        for m in methods
    ]
    lines += ["", "## Time", "", "Mean processor seconds of one setting:", ""]
    lines += ["| | " + " | ".join(methods) + " |", "|---" * (len(methods) + 1) + "|"]
    lines.append("| seconds | " + " | ".join(times) + " |")
    return "\n".join(lines) + "\n"


def covers(records: list[Record], method: str, cases: list[str]) -> bool:
    """Return whether a method ran on all the cases."""
    return set(cases) <= {r["case"] for r in records if r["method"] == method}


def introduction(report: dict[str, Any]) -> list[str]:
    """Return what was measured, and who had less than all of it."""
    records = report["records"]
    most = {tuple(r[k] for k in KEY) for r in records}
    lines = [
        "# Deblurring known motion",
        "",
        f"{report['date']}, {report['processor']}, one thread. Gain in PSNR (dB) over "
        f"the blurred picture / SSIM; means over {', '.join(report['pictures'])} "
        f"({report['size']} x {report['size']} px of each) and {len(report['seeds'])} "
        f"noise seeds; border of {BORDER} px left out. True velocity at mid-exposure; "
        "noise not told. True acceleration where a method takes one. Rivals choose "
        "their settings by the truth, and those with one kernel get the mean one. Made "
        "by `benches/deblur_table.py`.",
    ]
    partial: dict[str, list[str]] = {}
    for method in dict.fromkeys(r["method"] for r in records):
        own = [r for r in records if r["method"] == method]
        if len({tuple(r[k] for k in KEY) for r in own}) < len(most):
            partial.setdefault(extent(own), []).append(method)
    for what, names in partial.items():
        lines += ["", f"Only part of it ran with {', '.join(names)}: {what}."]
    return lines


def extent(own: list[Record]) -> str:
    """Return pictures, seeds and noises of records in words."""
    pictures = ", ".join(dict.fromkeys(r["picture"] for r in own))
    seeds, noises = (
        ", ".join(f"{item:g}" for item in sorted({r[k] for r in own}))
        for k in ("seed", "noise")
    )
    return f"{pictures}; seed {seeds}; noise of {noises} grey levels"


def row(name: str, own: list[Record], methods: list[str]) -> str:
    """Return one line of a table; the blurred picture is described as ours met it."""
    if not own:
        return f"| {name} |" + " |" * (len(methods) + 1)
    first = [r for r in own if r["method"] == methods[0]] or own
    before = [np.mean([r["before"][k] for r in first]) for k in ("psnr", "ssim")]
    cells = [f"{before[0]:.1f}/{before[1]:.2f}"]
    for m in methods:
        some = [r for r in own if r["method"] == m]
        if some:
            gain, ssim = (np.mean([r[k] for r in some]) for k in ("gain", "ssim"))
            cells.append(f"{gain:+.1f}/{ssim:.2f}")
        else:
            cells.append("")
    return f"| {name} | " + " | ".join(cells) + " |"


def leads(report: dict[str, Any], cases: list[str], methods: list[str]) -> list[str]:
    """Return by how much the default is ahead of the best of each kind, on equal terms.

    Per cell the smallest mean lead over any method of the kind, and that method.
    """
    records, noises = report["records"], sorted(report["noises"])
    gains = {(*(r[k] for k in KEY), r["method"]): r["gain"] for r in records}
    kinds = {"scikit-image": [m for m in methods if m.startswith("sk ")]}
    rest = [m for m in methods if m != LEADER and m not in kinds["scikit-image"]]
    kinds["other rivals"] = [m for m in rest if m in RIVALS]
    kinds["ours"] = [m for m in rest if m not in RIVALS]
    if LEADER not in methods:
        return []
    heads = [
        f"{kind}, noise {n:g}" for kind, some in kinds.items() if some for n in noises
    ]
    lines = ["", f"## What {LEADER} leads by", ""]
    lines += ["Smallest mean lead (dB) over a method of the kind, and which it is, on "]
    lines[-1] += "the pictures and seeds that both restored."
    lines += [
        "",
        "| case | " + " | ".join(heads) + " |",
        "|---" * (len(heads) + 1) + "|",
    ]
    for case in cases:
        cells = []
        for some in kinds.values():
            for noise in noises if some else []:
                found = [(lead(gains, case, noise, m), m) for m in some]
                least, method = min(found)
                cells.append(f"{least:+.1f} ({method})" if np.isfinite(least) else "")
        lines.append(f"| {case} | " + " | ".join(cells) + " |")
    return lines


def lead(gains: dict[Any, float], case: str, noise: float, method: str) -> float:
    """Return the mean lead over a method; infinite where nothing is shared."""
    ahead = [
        gains[(*key, LEADER)] - gain
        for (*key, own), gain in gains.items()
        if own == method
        and (key[0], key[2]) == (case, noise)
        and (*key, LEADER) in gains
    ]
    return float(np.mean(ahead)) if ahead else np.inf
