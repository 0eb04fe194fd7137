"""Small places for tests: a furnished room as faces, and houses of a few rooms as world files; and what bars ways."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from experiments.generated.scenes import Patch, PatchFace
from world_models.building.building import Building
from world_models.building.world import World
from world_models.camera import Camera
from world_models.frames import Pose
from world_models.visibility.culling import hidden_points
from world_models.visibility.lines_and_points import _CameraView


def box_faces(low: Any, high: Any, name: str, *, inside: bool = False, **appearance: Any) -> tuple[PatchFace, ...]:
    """The six faces of an axis-aligned box from corner ``low`` (3,) to ``high`` (3,) [m], seen from out- or inside."""
    return tuple(
        PatchFace((Patch(f"{name}-{side}", polygon, seed=index, **appearance),))
        for index, (side, polygon) in enumerate(_sides(np.asarray(low, float), np.asarray(high, float), inside))
    )


def _sides(low: NDArray[np.float64], high: NDArray[np.float64], inside: bool) -> list[tuple[str, NDArray[np.float64]]]:
    out = []
    for axis, (minus, plus) in enumerate((("west", "east"), ("south", "north"), ("bottom", "top"))):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        for side, level, outward in ((minus, low, False), (plus, high, True)):
            polygon = np.empty((4, 3))
            polygon[:, axis] = level[axis]
            polygon[:, b] = [low[b], high[b], high[b], low[b]]
            polygon[:, c] = [low[c], low[c], high[c], high[c]]
            out.append((side, polygon if outward != inside else polygon[::-1]))
    return out


def box_room(length_m: float = 6.0, width_m: float = 4.0, height_m: float = 2.6) -> tuple[PatchFace, ...]:
    """A closed room from (0, 0, 0), with a brick wall, a poster, a desk and a cabinet."""
    walls = box_faces((0, 0, 0), (length_m, width_m, height_m), "room", inside=True, texture="speckle",
                      texture_scale_m=0.06, colour=(0.78, 0.76, 0.70))
    floor = Patch("carpet", walls[4].front[0].polygon_world, (0.42, 0.40, 0.38), "carpet", 0.03, 5)
    bricks = Patch("bricks", walls[1].front[0].polygon_world, (0.62, 0.50, 0.44), "brick", 0.24, 6)
    x = length_m
    poster = Patch("poster", [(x, 2.6, 1.0), (x, 2.0, 1.0), (x, 2.0, 1.8), (x, 2.6, 1.8)], (0.6, 0.5, 0.4), "poster",
                   0.15, 7)
    return (
        *(walls[i] for i in (0, 2, 3, 5)),
        PatchFace((bricks, poster)),
        PatchFace((floor,)),
        *box_faces((3.6, 0.3, 0.0), (4.8, 1.0, 0.75), "desk", texture="wood", texture_scale_m=0.03,
                   colour=(0.52, 0.34, 0.2)),
        *box_faces((4.6, 3.3, 0.0), (5.4, 3.9, 1.9), "cabinet", colour=(0.35, 0.42, 0.45)),
    )


def generate_house(rng: np.random.Generator) -> str:
    """Generate a world file: two or three rooms in a row, with open doors, boxes and boards."""
    text = ['name = "house"\nunits = "metres"', "[finishes]\nplain = { colour = [0.6, 0.6, 0.6] }",
            '[defaults]\nheight = 2.6\nwalls = "plain"\nbaseboard = "plain"\nframe = "plain"', "[parts]"]
    for part in range(3):
        x, y, z = rng.uniform(0.2, 0.6), rng.uniform(0.3, 0.8), rng.uniform(0.4, 2.0)
        text.append(f'p{part} = [ {{ x = [{-x:.3f}, {x:.3f}], y = [0.0, {y:.3f}], z = [0.0, {z:.3f}],'
                    ' finish = "plain" },'
                    f' {{ x = [{-x:.3f}, {x / 2:.3f}], y = [0.0, {y / 2:.3f}], z = [{z:.3f}, {z + 0.3:.3f}],'
                    ' finish = "plain" } ]')
    rooms, doors, at = int(rng.integers(2, 4)), [], 0.0
    for room in range(rooms):
        width, depth = rng.uniform(3.5, 6.0), rng.uniform(3.5, 5.0)
        things = [f'{{ part = "p{rng.integers(3)}", at = [{rng.uniform(1.0, width - 1.0):.3f},'
                  f' {rng.uniform(0.8, depth - 1.0):.3f}], turn = {rng.uniform(-30, 30):.2f} }}']
        things += [f'{{ part = "p{rng.integers(3)}", wall = "north", along = {width * part:.3f} }}'
                   for part in (0.25, 0.75)]
        text.append(f"[locales.r{room}]\nkind = 'room'\nat = [{at:.3f}, 0]\nsize = [{width:.3f}, {depth:.3f}]\n"
                    f"things = [ {', '.join(things)} ]")
        if room:
            doors.append(f"d{room} = {{ between = ['r{room - 1}', 'r{room}'], wall = 'east',"
                         f" along = {rng.uniform(0.8, 2.6):.3f}, open = true }}")
        at += width + rng.uniform(0.1, 0.4)
    return "\n".join([*text, "[doors]", *doors])


def barriers(world: World, rooms: Sequence[str]) -> shapely.Geometry:
    """The floor lines of the walls of rooms, with the doorways taken out, and the footprints of what stands there."""
    outlines = shapely.union_all([shapely.LinearRing(world.outline(room)) for room in rooms])
    openings = [shapely.Polygon(np.concatenate([*d.thresholds_world])).convex_hull.buffer(1e-6)
                for room in rooms for d in world.doorways_of(room)]
    things = [shapely.Polygon(f) for room in rooms for f in world.obstacles(room)]
    return shapely.union_all([outlines.difference(shapely.union_all(openings)), *things])


def find_hidden(building: Building, camera: Camera, camera_from_world: Pose, points_world: Any) -> NDArray[np.bool_]:
    """(n,) which of the points (n, 3) [m, world] in front of the camera are hidden by surfaces of the model."""
    view = _CameraView(building, camera, camera_from_world)
    return hidden_points(camera_from_world.apply(points_world), view.shadows())
