"""The report: one HTML file that shows a clip before and after, and how to repeat it.

The file needs no network and no server: pictures are embedded as PNG, the measured flow
as 16-bit integers q with (u, v) = q * scale px/frame, scale = max |u|, |v| / 32767 per
frame, -32768 standing for unknown, so the reading under the pointer is exact to
scale / 2. The page draws itself from one JSON object (see ``page/page.js``).

What is drawn as the blur kernel of a pixel p is the path x(t), x(0) = p,
dx/dt = exposure * flow(x), t in [-1/2, 1/2]: where its light was gathered if the motion
was steady.
"""

from __future__ import annotations

import base64
import json
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._atomic import write_bytes_atomic
from unsmear._drawing import as_display
from unsmear._plain_data import plain_data
from unsmear._versions import versions
from unsmear.images import encode_picture
from unsmear.plot._report_errors import error_curves, error_tables
from unsmear.plot.flow_pictures import flow_to_color, legend

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

_LARGEST_INTEGER = 32767
_UNKNOWN = -32768
_LEGEND_SIZE = 150  # px
_ROBUST_PERCENTILE = 99


def report(
    path: str | os.PathLike[str],
    frames: ArrayLike,
    *,
    restored: ArrayLike | None = None,
    flows: Sequence[ArrayLike | None] | None = None,
    confidences: Sequence[ArrayLike | None] | None = None,
    sharp: ArrayLike | None = None,
    true_flows: Sequence[ArrayLike | None] | None = None,
    exposure: float = 1.0,
    labels: Sequence[str] | None = None,
    verdicts: Sequence[str] = (),
    parameters: Mapping[str, Any] | None = None,
    command: str | None = None,
    title: str = "unsmear report",
    max_frames: int = 12,
) -> None:
    """Write a page on what was measured and restored, to look at, trust and repeat.

    Parameters
    ----------
    path : path-like
        The HTML file to write; it appears whole or not at all.
    frames : array_like of shape (T, H, W) or (T, H, W, C)
        The frames as they came: integers, or floats in [0, 1].
    restored : array_like like ``frames``, optional
        The frames after; shown against ``frames`` with a slider.
    flows : sequence of T arrays (H, W, 2) or None, optional
        px/frame, u right, v down, NaN = unknown. Shown in colour; the value is read
        under the pointer. Also what the drawn blur kernels follow.
    confidences : sequence of T arrays (H, W) or None, optional
        In [0, 1].
    sharp, true_flows : like ``restored`` and ``flows``, optional
        The truth where it is known: gives tables of errors and the sparsification
        curve (error against density as the least confident pixels are left out).
    exposure : float, default 1.0
        Share of the frame interval the shutter was open: length of drawn kernels.
    labels : sequence of T str, optional
        Names of the frames; by default their numbers.
    verdicts : sequence of str
        What was found, in plain words, one line each.
    parameters : mapping, optional
        Whatever repeats the result: JSON-able plain data. The versions of all that
        computes are added, as ``versions``.
    command : str, optional
        The command line that repeats the result.
    title : str
        Heading of the page.
    max_frames : int, default 12
        Show at most so many frames, evenly chosen, first and last among them: a page
        holds every picture, and pages beyond some ten megabytes open slowly. Errors
        are of all frames.

    Raises
    ------
    ValueError
        If lengths or shapes do not agree, or ``max_frames`` is less than 1.
    """
    before = _clip(frames, "frames")
    count = len(before)
    after = None if restored is None else _clip(restored, "restored", before.shape)
    truth = None if sharp is None else _clip(sharp, "sharp", before.shape)
    flow_list = _planes(flows, "flows", count)
    confidence_list = _planes(confidences, "confidences", count)
    true_list = _planes(true_flows, "true_flows", count)
    names = [f"frame {i}" for i in range(count)] if labels is None else list(labels)
    if len(names) != count:
        raise ValueError(f"labels must be {count} as frames are, got {len(names)}")
    if max_frames < 1:
        raise ValueError(f"max_frames must be at least 1, got {max_frames}")
    shown = np.unique(np.linspace(0, count - 1, min(count, max_frames)).round())
    top = _top_speed(flow_list)
    page = {
        "title": title,
        "facts": _facts(before, len(shown)),
        "size": before.shape[1:3],
        "exposure": float(exposure),
        "verdicts": list(verdicts),
        "legend": _png(legend(_LEGEND_SIZE, max_flow=top)) if top else None,
        "frames": [
            {
                "label": names[i],
                "before": _png(before[i]),
                "after": None if after is None else _png(after[i]),
                "flow": _flow(flow_list[i], top),
                "confidence": _grey(confidence_list[i]),
            }
            for i in shown.astype(int).tolist()
        ],
        "tables": error_tables(names, before, after, truth, flow_list, true_list),
        "curves": error_curves(names, flow_list, confidence_list, true_list),
        "parameters": {"versions": versions(), **(parameters or {})},
        "command": command,
    }
    write_bytes_atomic(path, _html(page).encode())


def _html(page: dict[str, Any]) -> str:
    folder = resources.files("unsmear.plot") / "page"
    html = (folder / "page.html").read_text("utf-8")
    # "<" inside JSON strings would let a file name close the script element.
    data = json.dumps(plain_data(page), allow_nan=False).replace("<", "\\u003c")
    for mark, text in (
        ("/*STYLE*/", (folder / "page.css").read_text("utf-8")),
        ("/*SCRIPT*/", (folder / "page.js").read_text("utf-8")),
        ("/*DATA*/", data),
    ):
        html = html.replace(mark, text, 1)
    return html


def _clip(
    clip: ArrayLike, argument: str, like: tuple[int, ...] | None = None
) -> NDArray[Any]:
    array = np.asarray(clip)
    if array.ndim not in (3, 4) or 0 in array.shape:
        raise ValueError(
            f"{argument} must have shape (T, H, W) or (T, H, W, C) and hold pixels, "
            f"got {array.shape}"
        )
    if like is not None and array.shape != like:
        raise ValueError(
            f"{argument} must have the shape of frames, {like}, got {array.shape}"
        )
    return array


def _planes(
    planes: Sequence[ArrayLike | None] | None, argument: str, count: int
) -> list[NDArray[Any] | None]:
    if planes is None:
        return [None] * count
    if len(planes) != count:
        raise ValueError(f"{argument} must be {count} as frames are, got {len(planes)}")
    return [None if plane is None else np.asarray(plane) for plane in planes]


def _facts(frames: NDArray[Any], shown: int) -> str:
    count, height, width = frames.shape[:3]
    noun = "frame" if count == 1 else "frames"
    text = f"{count} {noun} of {width} x {height}, {frames.dtype}"
    return text if shown == count else f"{text}; {shown} of them shown"


def _top_speed(flows: list[NDArray[Any] | None]) -> float | None:
    """Return one colour scale for all frames, so that they compare."""
    tops = []
    for flow in flows:
        if flow is not None:
            speeds = np.hypot(flow[..., 0], flow[..., 1])
            speeds = speeds[np.isfinite(speeds)]
            if speeds.size:
                tops.append(float(np.percentile(speeds, _ROBUST_PERCENTILE)))
    return (max(tops) or 1.0) if tops else None


def _flow(flow: NDArray[Any] | None, top: float | None) -> dict[str, Any] | None:
    if flow is None:
        return None
    known = np.isfinite(flow).all(axis=-1)
    largest = float(np.abs(flow[known]).max()) if known.any() else 0.0
    scale = largest / _LARGEST_INTEGER or 1.0
    integers = np.full(flow.shape, _UNKNOWN, "<i2")
    integers[known] = np.rint(flow[known] / scale).astype("<i2")
    return {
        "picture": _png(flow_to_color(flow, max_flow=top)),
        "scale": scale,
        "values": base64.b64encode(integers.tobytes()).decode(),
    }


def _grey(confidence: NDArray[Any] | None) -> str | None:
    if confidence is None:
        return None
    return _png(np.clip(np.nan_to_num(confidence.astype(np.float64)), 0, 1))


def _png(picture: NDArray[Any]) -> str:
    data = encode_picture(as_display(picture, "frames"), "PNG")
    return "data:image/png;base64," + base64.b64encode(data).decode()
