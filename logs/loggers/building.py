"""The building: its surfaces without ceilings, its doorways and the names of its rooms."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from logs.mirror import Moment
from logs.palette import DOOR, NAME
from logs.paths import BUILDING, DOORWAYS, NAMES, WORLD
from logs.tape import Tape
from world_models.faces import area_vector
from world_models.regions import LAMP, Region
from world_models.world import World

HEAD_HIGH_M = 1.8
"""A surface that faces down and hangs higher than this is a ceiling, and left out: one looks in from above."""

SOFT_LIGHT = 0.75
LAMP_LIGHT = 0.35


class Building:
    """Logs the world model once."""

    def __init__(self, world: World) -> None:
        self._world = world

    def begin(self, tape: Tape) -> None:
        tape.fix(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        regions = [region for face in self._world.faces for region in (*face.front, *face.back)]
        tape.fix(BUILDING, _mesh(region for region in regions if not _is_ceiling(region)))
        tape.fix(NAMES, _names(self._world))
        tape.fix(DOORWAYS, _doorways(self._world))

    def log(self, tape: Tape, moment: Moment) -> None:
        """Buildings do not change."""


def _is_ceiling(region: Region) -> bool:
    up = area_vector(region.polygon_world)[2]
    return bool(up < 0 and region.polygon_world[:, 2].min() > HEAD_HIGH_M)


def _mesh(regions: Iterable[Region]) -> Any:
    """All regions as one mesh that shows from their visible sides only, so that no wall stands in one's way."""
    points, triangles, colours, count = [], [], [], 0
    for region in regions:
        corners = len(region.polygon_world)
        points.append(region.polygon_world)
        triangles.append(count + _fan(corners))
        colours.append(np.tile(_lit(region), (corners, 1)))
        count += corners
    return rr.Mesh3D(
        vertex_positions=np.concatenate(points), triangle_indices=np.concatenate(triangles),
        vertex_colors=np.concatenate(colours), face_rendering=rr.components.MeshFaceRendering.Front,
    )


def _fan(corners: int) -> NDArray[np.int64]:
    """(corners - 2, 3) the triangles of a convex polygon."""
    rest = np.arange(1, corners - 1)
    return np.stack([np.zeros_like(rest), rest, rest + 1], axis=1)


def _lit(region: Region) -> NDArray[np.uint8]:
    normal = area_vector(region.polygon_world)
    facing = normal @ LAMP / (np.linalg.norm(normal) * np.linalg.norm(LAMP))
    light = SOFT_LIGHT + LAMP_LIGHT * facing
    return np.asarray(np.clip(255.0 * light * np.array(region.colour), 0, 255), np.uint8)


def _names(world: World) -> Any:
    middles = [[*world.outline(name).mean(axis=0), 0.05] for name in world.rooms]
    return rr.Points3D(middles, labels=list(world.rooms), show_labels=True, radii=0.02, colors=[NAME])


def _doorways(world: World) -> Any:
    strips = []
    for doorway in world.doorways:
        (a, b), (c, d) = doorway.thresholds_world
        strips.append([[*corner, 0.02] for corner in (a, b, c, d, a)])
    return rr.LineStrips3D(strips, colors=[DOOR], radii=0.03)
