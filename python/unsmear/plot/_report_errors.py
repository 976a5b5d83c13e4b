"""Errors against the truth, as the tables and curves of a report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear import metrics

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Planes = Sequence[NDArray[Any] | None]


def error_tables(
    names: Sequence[str],
    before: NDArray[Any],
    after: NDArray[Any] | None,
    sharp: NDArray[Any] | None,
    flows: Planes,
    true_flows: Planes,
) -> list[dict[str, Any]]:
    """Return a table of picture errors and one of flow errors, each if known."""
    tables = []
    if sharp is not None:
        tables.append(_picture_table(names, before, after, sharp))
    rows = []
    for name, flow, truth in zip(names, flows, true_flows, strict=True):
        if flow is not None and truth is not None:
            error = metrics.flow_errors(flow, truth)
            values = (error["aae"], error["epe"], 100 * error["density"])
            rows.append([name, *(f"{value:.3f}" for value in values)])
    if rows:
        columns = ["frame", "angular error (deg)", "endpoint error (px)", "density (%)"]
        tables.append({"title": "Flow", "columns": columns, "rows": rows})
    return tables


def _picture_table(
    names: Sequence[str],
    before: NDArray[Any],
    after: NDArray[Any] | None,
    sharp: NDArray[Any],
) -> dict[str, Any]:
    columns = ["frame", "PSNR before (dB)"]
    if after is not None:
        columns += ["PSNR after (dB)", "gain (dB)"]
    rows = []
    for i, name in enumerate(names):
        values = [metrics.psnr(before[i], sharp[i])]
        if after is not None:
            values.append(metrics.psnr(after[i], sharp[i]))
            values.append(values[1] - values[0])
        rows.append([name, *(f"{value:.2f}" for value in values)])
    return {"title": "Pictures", "columns": columns, "rows": rows}


def error_curves(
    names: Sequence[str], flows: Planes, confidences: Planes, true_flows: Planes
) -> list[dict[str, Any]]:
    """Return the sparsification curve of the first frame that has all it needs."""
    for name, flow, confidence, truth in zip(
        names, flows, confidences, true_flows, strict=True
    ):
        if flow is None or confidence is None or truth is None:
            continue
        curve = metrics.sparsification(flow, confidence, truth)
        known = np.isfinite(curve["epe"])
        if not known.any():
            continue
        return [
            {
                "title": f"Sparsification, {name}: the error falls as the least "
                "confident pixels are left out",
                "x": np.asarray(curve["density"])[known].tolist(),
                "y": np.asarray(curve["epe"])[known].tolist(),
                "x_label": "density",
                "y_label": "mean endpoint error (px)",
            }
        ]
    return []
