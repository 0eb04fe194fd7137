"""The overview's views: a table of outcomes, a lane a run twice, their errors and their ways."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun.blueprint as rrb
from numpy.typing import NDArray

from logs.recording import paths

MOST_MM = 150.0

ABOVE, SOUTH, LEAST_M = 1.15, 0.3, 8.0
"""The eye's height and way to the south, in lengths of the diagonal of all places, which counts as so much at least."""


def overview_blueprint(places: Sequence[Sequence[float]]) -> Any:
    """Outcomes and map to the left, one row a run to the right, errors below; ``places`` (x, y, z) are to be seen."""
    busy = rrb.StateTimelineView(
        origin=f"/{paths.MOODS_OF}", name="Drives blue, looks yellow, plans orange, doubts violet, lost red")
    milestones = rrb.StateTimelineView(
        origin=f"/{paths.MILESTONES}", name="Milestones: verified green, refuted red, found itself blue")
    off = rrb.TimeSeriesView(
        origin=f"/{paths.OFF}", name="How far the belief is from the truth [mm]",
        axis_y=rrb.ScalarAxis(range=(0.0, MOST_MM)), plot_legend=rrb.PlotLegend(visible=False))
    table = rrb.TextDocumentView(origin=f"/{paths.SUMMARY}", name="How they ended")
    where = rrb.Spatial3DView(
        origin=f"/{paths.WORLD}", name="All robots, and their ways", line_grid=False,
        contents=["$origin/**", f"- /{paths.NAMES}"], background=rrb.Background(color=[28, 30, 34, 255]),
        eye_controls=_eye(np.array([*places] or [(0.0, 0.0, 0.0)], float)))
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(table, where, row_shares=[5, 4]),
            rrb.Vertical(rrb.Horizontal(busy, milestones), off, row_shares=[3, 1]),
            column_shares=[4, 7]),
        rrb.TimePanel(timeline="cycle", state="collapsed", fps=20.0),
        rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed"), auto_views=False)


def _eye(places: NDArray[np.float64]) -> Any:
    """Above the middle of all places, a little to the south."""
    low, high = places.min(axis=0), places.max(axis=0)
    (x, y, _), size = (low + high) / 2, max(LEAST_M, float(np.linalg.norm(high - low)))
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=[x, y - SOUTH * size, ABOVE * size], look_target=[x, y, 0.0],
        eye_up=[0.0, 0.0, 1.0])
