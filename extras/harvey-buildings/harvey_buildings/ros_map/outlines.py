"""Outlines of the rooms of a grid: straight walls, with each doorway's wall between its two rooms."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from harvey_buildings.building_plan import Floats
from harvey_buildings.polygons import clean_outline, square_outline
from harvey_buildings.ros_map.gaps import Gap, Mask
from harvey_buildings.ros_map.rooms import Labels

SMOOTH_M = 0.12
"""Notches and spurs of walls narrower than twice this are smoothed."""
STRAIGHT_CELLS = 1.6
"""Corners nearer than this to a straight wall are taken for noise."""
MIN_WALL_M, MAX_WALL_M = 0.06, 0.5
"""Thickness of the wall between two rooms at a gap."""
STEP_M = 0.2
"""Depth of the floor that is sure to be before a gap."""
JAMB_M = 0.06
"""Wall at either side of a gap that is kept straight."""


def room_shape(room: Mask, gaps: list[tuple[Gap, int]], cell_m: float) -> shapely.Polygon | None:
    """The outline of a room's cells, as a polygon in columns and rows; None where nothing is left.

    ``gaps``: those beside it, each with the side on which the room is: 1 or -1, as ``rooms_beside`` has them.
    """
    bounds = ndimage.find_objects(room.astype(np.int8))[0]
    margin = round(SMOOTH_M / cell_m) + 2
    part = np.pad(room[bounds], margin)
    smooth = _smooth(part, SMOOTH_M / cell_m)
    corner = np.array([bounds[1].start - margin, bounds[0].start - margin])
    shape = _largest(shapely.transform(_trace(smooth), lambda points: points + corner))
    if shape is None:
        return None
    outline = clean_outline(shapely.get_coordinates(shape.simplify(STRAIGHT_CELLS).exterior) * cell_m)
    if outline is None:
        return None
    squared = shapely.Polygon(square_outline(outline) / cell_m)
    holes = [shapely.Polygon(ring) for ring in shape.interiors]
    squared = squared.difference(shapely.union_all([h.simplify(STRAIGHT_CELLS) for h in holes if h.area > 4]))
    before = shapely.union_all([_step(gap, side, cell_m) for gap, side in gaps])
    return _largest(squared.union(before).difference(shapely.union_all([_throat(gap, cell_m) for gap, _ in gaps])))


def _throat(gap: Gap, cell_m: float) -> shapely.Polygon:
    """The wall in which a gap is, from a little before the one jamb to a little behind the other: columns, rows."""
    middle, half, thick = _axes(gap, cell_m)
    half = half * (1 + 2 * JAMB_M / (gap.width * cell_m))
    return shapely.Polygon([middle - half - thick, middle + half - thick, middle + half + thick, middle - half + thick])


def _step(gap: Gap, side: int, cell_m: float) -> shapely.Polygon:
    """The floor before a gap on one side: columns, rows."""
    middle, half, thick = _axes(gap, cell_m)
    far = side * (thick + thick / np.linalg.norm(thick) * STEP_M / cell_m)
    return shapely.Polygon([middle - half, middle + half, middle + half + far, middle - half + far])


def _axes(gap: Gap, cell_m: float) -> tuple[Floats, Floats, Floats]:
    """The middle of a gap, half of its width along the wall, and half of the wall's thickness: columns, rows."""
    start, end = np.array(gap.start[::-1], float), np.array(gap.end[::-1], float)
    along = (end - start) / np.linalg.norm(end - start)
    thick = min(max(gap.depth, MIN_WALL_M / cell_m), MAX_WALL_M / cell_m)
    return np.array(gap.middle[::-1]), gap.width / 2 * along, thick / 2 * np.array([-along[1], along[0]])


def _smooth(room: Mask, radius: float) -> NDArray[np.bool_]:
    """The cells opened and closed by a disc."""
    inner = ndimage.distance_transform_edt(room) > radius
    opened = ndimage.distance_transform_edt(~inner) <= radius if inner.any() else room
    outer = ndimage.distance_transform_edt(~opened) > radius
    return np.asarray(ndimage.distance_transform_edt(~outer) > radius, dtype=bool)


def _trace(room: Mask) -> shapely.Geometry:
    """The border of cells, as polygons in columns and rows; the middle of a cell is a whole number."""
    edge = np.diff(np.pad(room, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, first = np.nonzero(edge == 1)
    last = np.nonzero(edge == -1)[1]
    return shapely.union_all(shapely.box(first - 0.5, rows - 0.5, last - 0.5, rows + 0.5))


def _largest(shape: shapely.Geometry) -> shapely.Polygon | None:
    parts = [part for part in shapely.get_parts(shape) if part.geom_type == "Polygon" and part.area > 0]
    return max(parts, key=lambda part: part.area, default=None)


def gap_on_map(gap: Gap) -> tuple[Floats, Floats]:
    """(2,) middle and (2,) direction of a gap, in rows and columns."""
    along = np.array(gap.end, float) - np.array(gap.start, float)
    return np.array(gap.middle), along / np.linalg.norm(along)


def fill_to_walls(labels: Labels, open_floor: Mask, cells: int) -> Labels:
    """The rooms grown by up to so many cells into floor that was opened away at corners and jambs."""
    distance, nearest = ndimage.distance_transform_edt(labels == 0, return_indices=True)
    near = labels[nearest[0], nearest[1]]
    return np.where(open_floor & (labels == 0) & (distance <= cells), near, labels)
