"""Panel: a view of the viewer and its place in the window. Each logger brings its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import rerun.blueprint as rrb
from rerun.encodings import TimeRange

Area = Literal["words", "world", "decisions", "measurements"]
"""``words``: the column to the left; ``world``: the middle, above; ``decisions``: the middle, below;
``measurements``: the column to the right."""

NEAR_CYCLES = 40
"""Lanes and plots show so many cycles to either side of the cursor."""

NEAR = rrb.archetypes.TimeAxis(view_range=TimeRange(
    start=rrb.TimeRangeBoundary.cursor_relative(seq=-NEAR_CYCLES),
    end=rrb.TimeRangeBoundary.cursor_relative(seq=NEAR_CYCLES)))


@dataclass(frozen=True, slots=True)
class Panel:
    """A view and its place.

    Attributes:
        view: a view of rerun's blueprint.
        area: the part of the window.
        order: the place in its area, counted from the top or from the left; panels of the same order are tabs,
            that of the largest share in front.
        share: of the area's length.
    """

    view: Any
    area: Area = "measurements"
    order: int = 100
    share: float = 5.0


def log_view(origin: str, name: str, *columns: Literal["loglevel", "body"]) -> Any:
    """Lines of text by cycle."""
    shown = rrb.TextLogColumns(timeline_columns=["cycle"], text_log_columns=columns)
    return rrb.TextLogView(origin=origin, name=name, columns=shown)
