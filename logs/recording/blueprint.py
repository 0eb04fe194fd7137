"""The blueprint: the panels of all loggers in one window, embedded in every recording."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

import rerun.blueprint as rrb

from logs.recording.logger import Area, Logger, Panel

PLAYED_PER_S = 10.0
"""Cycles, when the recording plays."""

SHARES = (11, 29, 8)
"""Of the window's width: words to the left, world and decisions in the middle, measurements to the right."""
MIDDLE_SHARES = (11, 10)
"""Of the window's height: the world above, decisions below."""


def blueprint(loggers: Sequence[Logger]) -> Any:
    """All panels of some loggers under one cursor."""
    panels = [panel for logger in loggers for panel in logger.panels()]
    middle = _join(rrb.Vertical, [_area(panels, "world", rrb.Horizontal), _area(panels, "decisions", rrb.Horizontal)],
                     MIDDLE_SHARES, "row_shares")
    columns = [_area(panels, "words", rrb.Vertical), middle, _area(panels, "measurements", rrb.Vertical)]
    return rrb.Blueprint(
        _join(rrb.Horizontal, columns, SHARES, "column_shares") or rrb.Vertical(),
        rrb.TimePanel(timeline="cycle", state="collapsed", fps=PLAYED_PER_S),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )


def _area(panels: Sequence[Panel], area: Area, container: Any) -> Any:
    """The panels of an area in their order, those of equal order as tabs; None where there are none."""
    inside = sorted((panel for panel in panels if panel.area == area), key=lambda panel: (panel.order, -panel.share))
    groups = [list(group) for _, group in groupby(inside, key=lambda panel: panel.order)]
    parts = [group[0].view if len(group) == 1 else rrb.Tabs(*(panel.view for panel in group)) for group in groups]
    shares = [max(panel.share for panel in group) for group in groups]
    return _join(container, parts, shares, "row_shares" if container is rrb.Vertical else "column_shares")


def _join(container: Any, parts: Sequence[Any], shares: Sequence[float], name: str) -> Any:
    """The parts that there are in a container; None where there are none."""
    there = [(part, share) for part, share in zip(parts, shares, strict=True) if part is not None]
    if not there:
        return None
    return container(*(part for part, _ in there), **{name: [share for _, share in there]})
