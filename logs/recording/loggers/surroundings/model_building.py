"""The building as the robot's model has it, and where it truly differs from that: what is there besides, and what is
gone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from logs.recording.logger import BACKGROUND, Logger, Moment, Panel
from logs.recording.palette import DOOR, NAME, REJECTED, TRUE, Colour
from logs.recording.paths import BELIEVED_TRAIL, BUILDING, DOORWAYS, NAMES, TRUE_ADDED, TRUE_GONE, TRUE_TRAIL, WORLD
from logs.recording.stream import RecordingStream, viewable
from world_models.building.geometry.faces import LAMP, Face, Region, area_vectors
from world_models.building.geometry.scene import stack_regions
from world_models.building.locales import Doorway
from world_models.building.world import World

Strip = NDArray[np.float32]
"""(n, 3) points one after the other [m, world]."""
HEAD_HIGH_M = 1.8
"""A surface that faces down and hangs higher than this is a ceiling, and left out: one looks in from above."""
STOREY_M = 0.5
"""Rooms whose floors differ by less are of one storey."""
UNKNOWN_GREY = 0.5
"""A surface of unknown colour is drawn so bright."""
SOFT_LIGHT, LAMP_LIGHT = 0.75, 0.35
ABOVE, SOUTH = 0.56, 0.11
"""The eye stands so high above the building and so far to the south of its middle, in lengths of its diagonal: steeply
enough to look over the walls into a narrow hallway."""
EYE_HEIGHT_M = 3.0
"""Added to the eye's height."""
EDGE_M = 0.015
"""Half the width of an outline."""
SINCE_THE_START = rrb.VisibleTimeRange(
    "cycle", start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative())


def strip(points: Any, height_m: float) -> Strip:
    """Points (n, 2) of the plan at a height [m, world]."""
    return np.insert(np.asarray(points, float), 2, height_m, axis=1).astype(np.float32)


def across(door: Doorway) -> NDArray[np.float64]:
    """(2, 2) from jamb to jamb of a doorway, half-way through the wall [m, world]."""
    here, there = door.thresholds_world
    return np.asarray((here + there[::-1]) / 2)


class ModelBuilding(Logger):
    """Logs the world model once."""

    def panels(self) -> Sequence[Panel]:
        name = "Where it is: true robot green, believed blue, plan orange"
        return (Panel(building_view(self.subject.world, name), "world", 1, 13),)

    def begin(self, stream: RecordingStream) -> None:
        log_building(stream, self.subject.world)

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        """Buildings do not change."""


def log_building(stream: RecordingStream, world: World) -> None:
    """Surfaces, room names and doorways."""
    stream.fix(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    for path, mesh in _meshes(world):
        stream.fix(path, mesh)
    stream.fix(NAMES, _names(world))
    stream.fix(DOORWAYS, _doorways(world))


def record_building(world: World, out: Path, title: str | None = None) -> None:
    """Write a recording of nothing but the building: surfaces by storey, doorways, room names. Raises RecordingError.

    ``title``: of the recording, the world's name by default; a viewer keeps recordings with different titles apart.
    """
    name = title or world.name
    look = rrb.Blueprint(building_view(world, world.name), rrb.TimePanel(state="hidden"), auto_views=False)
    stream = RecordingStream(out, f"building of {name}", name, look)
    try:
        log_building(stream, world)
    finally:
        stream.close()


def building_view(world: World, name: str) -> Any:
    """The building from above and a little from the south."""
    corners = np.concatenate([world.outline(room) for room in world.rooms])
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=[middle[0], middle[1] - SOUTH * size, EYE_HEIGHT_M + ABOVE * size],
        look_target=[middle[0], middle[1], 0.0], eye_up=[0.0, 0.0, 1.0])
    return space_view(name, eye)


def space_view(name: str, eye: Any, *without: str) -> Any:
    """The world with both robots and their ways since the start, but for the paths ``without``."""
    return rrb.Spatial3DView(
        origin=WORLD, contents=["$origin/**", *without], name=name, line_grid=False,
        background=BACKGROUND, eye_controls=eye,
        overrides={path: rrb.VisibleTimeRanges([SINCE_THE_START]) for path in (TRUE_TRAIL, BELIEVED_TRAIL)})


def _meshes(world: World) -> Iterator[tuple[str, Any]]:
    """A mesh for each storey, so that one can take the upper ones off; they are one where there is only one."""
    regions = _regions(world.faces)  # not those of the world's scene, which would find the corners of all landmarks
    polygons, normals = stack_regions(regions)
    colours = np.nan_to_num([region.colour for region in regions], nan=UNKNOWN_GREY)
    floors = {name: world.floor_m(name) for name in world.rooms}
    levels = np.array([floors.get(face.locale, 0.0) for face in world.faces for _ in (*face.front, *face.back)])
    storeys = np.unique(np.round(levels, 1))
    for number, level_m in enumerate(storeys):
        of_storey = np.abs(levels - level_m) < STOREY_M
        path = BUILDING if len(storeys) == 1 else f"{BUILDING}/storey-{number}"
        yield path, _mesh(polygons[of_storey], normals[of_storey], colours[of_storey], float(level_m))


def _mesh(
    polygons: NDArray[np.float64], normals: NDArray[np.float64], colours: NDArray[np.float64], floor_m: float
) -> Any:
    """Surfaces (m, k, 3) of a storey as a mesh that shows from their visible sides only: no wall is in one's way."""
    shown = (normals[:, 2] > -0.5) | (polygons[..., 2].min(axis=1) < floor_m + HEAD_HIGH_M)
    lit = light_colours(colours, normals)[shown]
    corners = polygons.shape[1]
    return rr.Mesh3D(
        vertex_positions=polygons[shown].reshape(-1, 3), vertex_colors=np.repeat(lit, corners, axis=0),
        triangle_indices=triangles(len(lit), corners), face_rendering=rr.components.MeshFaceRendering.Front,
    )


def light_colours(colours: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.uint8]:
    """(n, 3) what is shown of colours (n, 3), 0..1, on surfaces with unit normals (n, 3)."""
    light = SOFT_LIGHT + LAMP_LIGHT * normals @ (LAMP / np.linalg.norm(LAMP))
    return np.asarray(np.clip(255.0 * light[:, None] * colours, 0, 255), np.uint8)


def triangles(count: int, corners: int) -> NDArray[np.int64]:
    """(count * (corners - 2), 3) fans for convex polygons that lie one after the other."""
    rest = np.arange(1, corners - 1)
    fan = np.stack([np.zeros_like(rest), rest, rest + 1], axis=1)
    return (fan[None] + corners * np.arange(count)[:, None, None]).reshape(-1, 3)


def _names(world: World) -> Any:
    middles = [[*world.outline(name).mean(axis=0), world.floor_m(name) + 0.05] for name in world.rooms]
    labels = [viewable(name) for name in world.rooms]
    return rr.Points3D(middles, labels=labels, show_labels=True, radii=0.02, colors=[NAME])


def _doorways(world: World) -> Any:
    strips = [strip(door.thresholds_world.reshape(4, 2)[[0, 1, 2, 3, 0]], world.floor_m(door.between[0]) + 0.02)
              for door in world.doorways]
    return rr.LineStrips3D(strips, colors=[DOOR], radii=0.03)


class TrueDifferences(Logger):
    """Logs the differences, where somebody knows them, when they change: solid with green edges, or red edges only."""

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        for difference in moment.differences[-1:]:
            regions = _regions(difference.added)
            _log_outlines(stream, f"{TRUE_ADDED}/edges", regions, TRUE)
            _log_outlines(stream, TRUE_GONE, _regions(difference.gone), REJECTED)
            _log_surfaces(stream, regions)


def _regions(faces: Sequence[Face]) -> list[Region]:
    return [region for face in faces for region in (*face.front, *face.back)]


def _log_outlines(stream: RecordingStream, path: str, regions: Sequence[Region], colour: Colour) -> None:
    strips = [np.concatenate([r.polygon_world, r.polygon_world[:1]]).astype(np.float32) for r in regions]
    stream.log(path, rr.LineStrips3D, strips=strips, colors=[colour] * len(strips), radii=[EDGE_M] * len(strips))


def _log_surfaces(stream: RecordingStream, regions: Sequence[Region]) -> None:
    corners = [len(region.polygon_world) for region in regions]
    faces = [triangles(1, k) + start for k, start in zip(corners, np.cumsum([0, *corners])[:-1], strict=True)]
    normals = area_vectors([region.polygon_world for region in regions])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    colours = light_colours(np.array([region.colour for region in regions]).reshape(-1, 3), normals)
    stream.log(
        TRUE_ADDED, rr.Mesh3D,
        vertex_positions=np.concatenate([np.zeros((0, 3)), *(r.polygon_world for r in regions)]).astype(np.float32),
        vertex_colors=np.repeat(colours, corners, axis=0),
        triangle_indices=np.concatenate([np.zeros((0, 3), np.uint32), *faces]).astype(np.uint32))


LOGGERS = (ModelBuilding, TrueDifferences)
