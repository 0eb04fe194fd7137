"""The blueprint: which views there are and where, declared in this one place and embedded in every recording."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.encodings import TimeRange

from logs.recording import paths
from logs.recording.loggers.decisions import COLUMNS
from logs.recording.loggers.lanes import contents
from logs.recording.loggers.plan import FLAG_M
from world_models.building.world import World
from world_models.camera import Camera

ABOVE, SOUTH = 0.56, 0.11
"""The eye stands so high above the building and so far to the south of its middle, in lengths of its diagonal: steeply
enough to look over the walls into a narrow hallway."""

CLOSE_ABOVE_M, CLOSE_SOUTH_M = 6.0, 1.2
"""The second eye hovers over the robot and goes with it."""

PLAYED_PER_S = 10.0
"""Cycles, when the recording plays."""

NEAR_CYCLES = 40
"""Lanes and plots show so many cycles to either side of the cursor."""

POSITION_MM, HEADING_DEG, DEVIATION_PX = 60.0, 2.0, 40.0
"""Reach of the plots: what is beyond is off the scale, and meant to look so."""

TRAILS = (paths.TRUE_TRAIL, paths.BELIEVED_TRAIL)

SINCE_THE_START = rrb.VisibleTimeRange(
    "cycle", start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative())

NEAR = rrb.archetypes.TimeAxis(view_range=TimeRange(
    start=rrb.TimeRangeBoundary.cursor_relative(seq=-NEAR_CYCLES),
    end=rrb.TimeRangeBoundary.cursor_relative(seq=NEAR_CYCLES)))


def blueprint(world: World, camera: Camera) -> Any:
    """All views of a run under one cursor: told to the left, seen above, decided below, measured to the right."""
    told = rrb.Vertical(_why(), _chapters(), _description(), row_shares=[11, 7, 5])
    seen = rrb.Horizontal(_building(world), _picture(camera), column_shares=[13, 9])
    done = rrb.Horizontal(rrb.Tabs(_decisions(), _table()), _sketch(), _close(world), column_shares=[12, 6, 6])
    measured = rrb.Vertical(_lanes(), *_errors(), row_shares=[19, 5, 5])
    return rrb.Blueprint(
        rrb.Horizontal(told, rrb.Vertical(seen, done, row_shares=[11, 10]), measured, column_shares=[10, 30, 8]),
        rrb.TimePanel(timeline="cycle", state="collapsed", fps=PLAYED_PER_S),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )


def _description() -> Any:
    return rrb.TextDocumentView(origin=paths.DESCRIPTION, name="How to read this")


def _why() -> Any:
    return rrb.TextDocumentView(origin=paths.WHY, name="What Harvey thinks now")


def _chapters() -> Any:
    return _log(paths.CHAPTERS, "The story so far: turning points", "loglevel", "body")


def _building(world: World) -> Any:
    return building_view(world, "Where it is: true robot green, believed blue, plan orange")


def building_view(world: World, name: str) -> Any:
    """From above and a little from the south."""
    corners = np.concatenate([world.outline(name) for name in world.rooms])
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=[middle[0], middle[1] - SOUTH * size, FLAG_M + ABOVE * size],
        look_target=[middle[0], middle[1], 0.0], eye_up=[0.0, 0.0, 1.0])
    return _space(name, eye)


def _close(world: World) -> Any:
    """The same from near by, going with the believed robot."""
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=[0.0, -CLOSE_SOUTH_M, CLOSE_ABOVE_M], look_target=[0.0, 0.0, 0.0],
        eye_up=[0.0, 0.0, 1.0], tracking_entity=f"/{paths.BELIEVED_BODY}")
    return _space("Close by", eye, f"- /{paths.NAMES}")


def _space(name: str, eye: Any, *without: str) -> Any:
    return rrb.Spatial3DView(
        origin=paths.WORLD, contents=["$origin/**", *without], name=name, line_grid=False,
        background=rrb.Background(color=[28, 30, 34, 255]),
        overrides={path: rrb.VisibleTimeRanges([SINCE_THE_START]) for path in TRAILS}, eye_controls=eye)


def _picture(camera: Camera) -> Any:
    return rrb.Spatial2DView(
        origin=paths.CAMERA, name="Eye: yellow expected, cyan found, green fits, red not",
        visual_bounds=rrb.VisualBounds2D(x_range=[0, camera.width], y_range=[0, camera.height]))


def _lanes() -> Any:
    return rrb.StateTimelineView(origin="/", contents=contents(), name="Who acts when, by level", time_view=NEAR)


def _decisions() -> Any:
    return _log(paths.TABLE, "What is decided: one decision a cycle", "body")


def _log(origin: str, name: str, *columns: Literal["loglevel", "body"]) -> Any:
    shown = rrb.TextLogColumns(timeline_columns=["cycle"], text_log_columns=columns)
    return rrb.TextLogView(origin=origin, name=name, columns=shown)


def _table() -> Any:
    columns = [f"/{paths.TABLE}:{name}" for name in COLUMNS]
    query = rrb.archetypes.DataframeQuery(timeline="cycle", select=["cycle", *columns])
    return rrb.DataframeView(origin=paths.TABLE, name="Decision table", query=query)


def _sketch() -> Any:
    return rrb.GraphView(
        origin=paths.SKETCH, name="The plan",
        force_link=rrb.archetypes.ForceLink(enabled=False), force_many_body=rrb.archetypes.ForceManyBody(enabled=False),
        force_position=rrb.archetypes.ForcePosition(enabled=False),
        force_collision_radius=rrb.archetypes.ForceCollisionRadius(enabled=False),
        force_center=rrb.archetypes.ForceCenter(enabled=False))


def _errors() -> tuple[Any, Any]:
    place = _plot(paths.POSITION, "Position error of the belief [mm]", -POSITION_MM, POSITION_MM)
    heading = _plot(paths.HEADING, "in heading [°]", -HEADING_DEG, HEADING_DEG)
    return rrb.Tabs(place, heading), _plot(paths.DEVIATION, "Surprise, and what is allowed [px]", 0.0, DEVIATION_PX)


def _plot(origin: str, name: str, low: float, high: float) -> Any:
    legend = rrb.PlotLegend(rrb.Corner2D.LeftBottom if low < 0 else rrb.Corner2D.LeftTop)
    return rrb.TimeSeriesView(
        origin=origin, name=name, plot_legend=legend, axis_x=NEAR, axis_y=rrb.ScalarAxis(range=(low, high)))


DESCRIPTION = """\
Harvey drives from room to room by what its camera shows. Knowledge sources round a blackboard decide,
**one decision a cycle**.
Play, or drag the cursor at the bottom; click the number of a turning point to go there.

**Levels:** *action* (blue) corrects moves, *plan* (orange) checks milestones, *goal* (red) finds a lost robot.
**Ring:** doubt, 1 sigma, 20 times as large; **bands** in plots: ±1 sigma. **Arrows in the picture:** drift, 5 times as
long. **Grey:** done. Ask on with `harvey why`.
"""


def describe(title: str) -> Any:
    """The text beside the views."""
    return rr.TextDocument(f"**{title}**. {DESCRIPTION}", media_type="text/markdown")
