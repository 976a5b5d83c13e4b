"""Pictures and pages: flow in colour, arrows, panels, and the report.

`flow_to_color`, `legend`, `arrows`, `side_by_side` and `flow_figure` return pictures as
arrays; `report` writes one self-contained page that shows what was done to a clip.
"""

from __future__ import annotations

from unsmear.plot.flow_pictures import (
    arrows,
    flow_figure,
    flow_to_color,
    legend,
    side_by_side,
)
from unsmear.plot.report import report

__all__ = [
    "arrows",
    "flow_figure",
    "flow_to_color",
    "legend",
    "report",
    "side_by_side",
]
