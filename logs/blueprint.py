"""The blueprint: which views there are and where, declared in this one place and embedded in every recording."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from logs import paths
from logs.loggers.decisions import COLUMNS
from logs.loggers.plan import FLAG_M
from world_models.camera import Camera
from world_models.world import World

ABOVE, SOUTH = 0.54, 0.11
"""The eye stands so high above the building and so far to the south of its middle, in lengths of its diagonal: steeply
enough to look over the walls into a narrow hallway."""

PLAYED_PER_S = 10.0
"""Cycles, when the recording plays."""

TRAILS = (paths.TRUE_TRAIL, paths.BELIEVED_TRAIL)

SINCE_THE_START = rrb.VisibleTimeRange(
    "cycle", start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative())


def blueprint(world: World, camera: Camera) -> Any:
    """All views of a run under one cursor: the building and the picture large, the reasons beside, time below."""
    words = rrb.Vertical(_description(), _why(), row_shares=[4, 7])
    decisions = rrb.Tabs(_decisions(), _table())
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(words, _building(world), _picture(camera), column_shares=[4, 9, 6]),
            rrb.Horizontal(decisions, _lanes(), _sketch(), _errors(), column_shares=[13, 8, 7, 7]),
            row_shares=[11, 10],
        ),
        rrb.TimePanel(timeline="cycle", state="collapsed", fps=PLAYED_PER_S),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )


def _description() -> Any:
    return rrb.TextDocumentView(origin=paths.DESCRIPTION, name="How to read this")


def _why() -> Any:
    return rrb.TextDocumentView(origin=paths.WHY, name="What Harvey thinks now")


def _building(world: World) -> Any:
    """From above and a little from the south."""
    corners = np.concatenate([world.outline(name) for name in world.rooms])
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    return rrb.Spatial3DView(
        origin=paths.WORLD, name="Where: true (green) and believed (blue) robot, plan (orange)",
        background=rrb.Background(color=[28, 30, 34, 255]), line_grid=False,
        overrides={path: rrb.VisibleTimeRanges([SINCE_THE_START]) for path in TRAILS},
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=[middle[0], middle[1] - SOUTH * size, FLAG_M + ABOVE * size],
            look_target=[middle[0], middle[1], 0.0], eye_up=[0.0, 0.0, 1.0]),
    )


def _picture(camera: Camera) -> Any:
    return rrb.Spatial2DView(
        origin=paths.CAMERA, name="Eye: expected (yellow), found (cyan), matched (green), rejected (red)",
        visual_bounds=rrb.VisualBounds2D(x_range=[0, camera.width], y_range=[0, camera.height]))


def _lanes() -> Any:
    return rrb.StateTimelineView(origin=paths.LANES, name="Who acts; which level is in focus")


def _decisions() -> Any:
    return rrb.TextLogView(
        origin=paths.TABLE, name="Decisions: one a cycle",
        columns=rrb.TextLogColumns(timeline_columns=["cycle"], text_log_columns=["loglevel", "body"]))


def _table() -> Any:
    columns = [f"/{paths.TABLE}:{name}" for name in COLUMNS]
    query = rrb.archetypes.DataframeQuery(timeline="cycle", select=["cycle", *columns])
    return rrb.DataframeView(origin=paths.TABLE, name="Decision table", query=query)


def _sketch() -> Any:
    return rrb.GraphView(
        origin=paths.SKETCH, name="Plan sketches",
        force_link=rrb.archetypes.ForceLink(enabled=False), force_many_body=rrb.archetypes.ForceManyBody(enabled=False),
        force_position=rrb.archetypes.ForcePosition(enabled=False),
        force_collision_radius=rrb.archetypes.ForceCollisionRadius(enabled=False),
        force_center=rrb.archetypes.ForceCenter(enabled=False))


def _errors() -> Any:
    return rrb.Vertical(
        rrb.Tabs(_plot(paths.POSITION, "Position error [mm]"), _plot(paths.HEADING, "Heading error [deg]")),
        _plot(paths.DEVIATION, "Discrepancies and their bounds [px]"))


def _plot(origin: str, name: str) -> Any:
    return rrb.TimeSeriesView(origin=origin, name=name, plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop))


DESCRIPTION = """\
Harvey drives from room to room by what his camera shows. Experts round a blackboard decide, **one decision a cycle**.
Drag the cursor at the bottom, or play.

**Green**: the true robot (known in simulation only); lines that match. **Blue**: where Harvey believes he is, with an
ellipse of doubt (1 sigma, 20 times as large). **Orange**: goal, plan, leg; in the picture: drift of a point, 5 times as
long. **Yellow**: expected. **Cyan**: found. **Red**: missed or rejected. **Grey**: done.
"""


def describe(title: str) -> Any:
    """The text beside the views."""
    return rr.TextDocument(f"**{title}**. {DESCRIPTION}", media_type="text/markdown")
