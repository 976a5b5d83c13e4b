"""Results as notebooks show them: a picture or two beside a small table.

One HTML fragment, pictures inside it as PNG, no script, no style sheet, nothing from
elsewhere. It takes its colours from the page around it, so it suits a light and a dark
one; pictures wider or higher than `LARGEST` px are shown by every n-th pixel.
"""

from __future__ import annotations

import base64
import html
from typing import TYPE_CHECKING, Any

import numpy as np

from unsmear._drawing import as_display
from unsmear.images import encode_picture
from unsmear.plot.flow_pictures import flow_figure

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

LARGEST = 320
_COLOURS = (1, 3)
_LINE = "border: 0; padding: .1em .8em .1em 0; text-align: left; vertical-align: top"


def flow_html(
    flow: NDArray[Any], confidence: NDArray[Any], report: Mapping[str, Any]
) -> str:
    """Return a flow field in colour, and what is known of it."""
    speed = np.hypot(flow[..., 0], flow[..., 1])
    known = speed[np.isfinite(speed)]
    rows = {
        "method": report["method"],
        "frames": " x ".join(map(str, report["frames"])),
        "reference frame": report["index"],
        "known": f"{report['density']:.1%} of the pixels",
        "speed": f"median {np.median(known):.2f}, largest {known.max():.2f} px/frame"
        if known.size
        else "unknown",
        "confidence": f"mean {np.mean(confidence):.2f}",
        "time": f"{report['seconds']:.2f} s, {report['threads']} threads",
        "warnings": "; ".join(report["warnings"]),
    }
    return _fragment("Optical flow", {"flow": _flow_picture(flow)}, rows)


def picture_html(image: NDArray[Any], report: Mapping[str, Any]) -> str:
    """Return a restored picture, and how it was made."""
    rows = {
        "method": report["method"],
        "exposure": f"{report['exposure']:.3g} x the frame interval",
        "noise": _number(report.get("noise")),
        "strength of the prior": _number(report.get("regularization")),
        "residual over noise": _number(report.get("mismatch")),
        "warnings": "; ".join(report["warnings"]),
    }
    return _fragment("Deblurred picture", {"restored": _picture(image)}, rows)


def clip_html(
    frames: NDArray[Any], flows: NDArray[Any], reports: list[dict[str, Any]]
) -> str:
    """Return the first restored frame and its flow, and the verdicts on all."""
    if not reports:
        return _fragment("Deblurred clip", {}, {"frames": 0})
    verdicts = [str(report["verdict"]) for report in reports]
    exposures = [report["exposure"] for report in reports]
    rows = {
        "frames": len(frames),
        "exposure": f"{np.mean(exposures):.3g} x the frame interval",
        "verdict": "; ".join(
            f"{verdicts.count(text)} x {text}" for text in dict.fromkeys(verdicts)
        ),
        "warnings": "; ".join(
            sorted({text for report in reports for text in report.get("warnings", ())})
        ),
    }
    pictures = {"first frame": _picture(frames[0]), "its flow": _flow_picture(flows[0])}
    return _fragment("Deblurred clip", pictures, rows)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"


def _flow_picture(flow: NDArray[Any]) -> NDArray[np.uint8]:
    return flow_figure(_thinned(flow))


def _picture(image: NDArray[Any]) -> NDArray[np.uint8] | None:
    """Return what can be shown: colour on the last or the first axis."""
    if image.ndim == 3 and image.shape[2] not in _COLOURS:
        image = np.moveaxis(image, 0, -1)
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] not in _COLOURS):
        return None
    return as_display(_thinned(image), "image")


def _thinned(image: NDArray[Any]) -> NDArray[Any]:
    step = -(-max(image.shape[:2]) // LARGEST)
    return image[::step, ::step]


def _fragment(
    title: str,
    pictures: Mapping[str, NDArray[np.uint8] | None],
    rows: Mapping[str, Any],
) -> str:
    """Compose; empty rows and missing pictures are left out."""
    figures = "".join(
        f'<figure style="margin: 0"><img alt="{label}" src="{_uri(picture)}" '
        f'style="max-width: 100%; background: #fff; border-radius: 3px">'
        f'<figcaption style="opacity: .7">{label}</figcaption></figure>'
        for label, picture in pictures.items()
        if picture is not None
    )
    lines = "".join(
        f'<tr style="background: none"><th style="{_LINE}; opacity: .7">{name}</th>'
        f'<td style="{_LINE}">{html.escape(str(value))}</td></tr>'
        for name, value in rows.items()
        if value != ""
    )
    return (
        '<div class="unsmear-result" style="display: flex; flex-wrap: wrap; '
        'gap: 1em; align-items: flex-start; color: inherit">'
        f"{figures}<div><strong>{title}</strong>"
        f'<table style="border: 0; color: inherit">{lines}</table></div></div>'
    )


def _uri(picture: NDArray[np.uint8]) -> str:
    code = base64.b64encode(encode_picture(picture, "PNG")).decode("ascii")
    return f"data:image/png;base64,{code}"
