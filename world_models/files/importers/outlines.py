"""Outlines as building files have them: cleaned, kept apart by walls, squared, and where two face each other."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from world_models.building.outlines import is_simple

Floats = NDArray[np.float64]

THIN_WALL_M = 0.05
"""Of the wall that is put between two spaces which have none."""
THICKEST_M = 0.55
SHORTEST_SIDE_M = 0.03
CORNERS, COARSE_M = 24, 0.03
"""An outline of more corners than this is curved: it is drawn with sides that are off it by up to so much."""
SMALLEST_HOLE_M2 = 0.05
COVERED = 0.6
"""A space of which others, no larger, cover more than this part is no room: an area to pay for, or twice told."""
STRAIGHT = math.radians(8.0)


@dataclass(frozen=True, slots=True)
class Stretch:
    """Where a side of room ``a`` has a side of room ``b`` behind it: from ``low_m`` to ``high_m`` along the side."""

    a: str
    side: int
    b: str
    low_m: float
    high_m: float
    gap_m: float


def cleaned(points: Floats) -> Floats | None:
    """(k, 2) a simple outline, counter-clockwise, without needless corners, in millimetres' tenths; None: no area."""
    if len(points) < 3 or not np.isfinite(points).all() or np.abs(points).max() > 5000.0:
        return None
    polygon = shapely.Polygon(points)
    return outline_of(polygon if polygon.is_valid else shapely.make_valid(polygon))


def outline_of(shape: shapely.Geometry) -> Floats | None:
    """(k, 2) the outline of the largest polygon of a shape, as :func:`cleaned` makes it."""
    polygons = [p for p in shapely.get_parts(shape) if p.geom_type == "Polygon" and p.area > 0.05]
    if not polygons:
        return None
    best = without_holes(max(polygons, key=lambda p: p.area))
    for tolerance_m in (0.002, COARSE_M):
        ring = shapely.Polygon(best.exterior).simplify(tolerance_m)
        outline = np.round(shapely.get_coordinates(shapely.orient_polygons(ring).exterior)[:-1], 4)
        outline = _without_short_sides(outline)
        if len(outline) <= CORNERS:
            break
    return outline if len(outline) >= 3 and is_simple(outline) else None


def without_holes(polygon: shapely.Polygon) -> shapely.Polygon:
    """The polygon with a thin wall from each of its holes to its border: a room round a core is drawn as one that ends.

    An outline has no holes, and to fill them would put the room over those that lie in them.
    """
    while holes := [ring for ring in polygon.interiors if shapely.Polygon(ring).area > SMALLEST_HOLE_M2]:
        across = shapely.shortest_line(holes[0], polygon.exterior)
        slit = across.buffer(THIN_WALL_M / 2, cap_style="square") if across.length else across.buffer(THIN_WALL_M)
        parts = [p for p in shapely.get_parts(polygon.difference(slit)) if p.geom_type == "Polygon"]
        best = max(parts, key=lambda p: p.area, default=shapely.Polygon())
        if len(best.interiors) >= len(polygon.interiors):
            return shapely.Polygon(polygon.exterior, [r for r in polygon.interiors if r is not holes[0]])
        polygon = best
    return polygon


def _without_short_sides(outline: Floats) -> Floats:
    while len(outline) > 3:
        lengths = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1)
        at = int(np.argmin(lengths))
        straight = _bends(outline) < 1e-3
        if lengths[at] < SHORTEST_SIDE_M:
            outline = np.delete(outline, (at + 1) % len(outline), axis=0)
        elif straight.any():
            outline = np.delete(outline, int(np.argmax(straight)), axis=0)
        else:
            break
    return outline


def _bends(outline: Floats) -> Floats:
    """(k,) how far each corner lies off the line between its neighbours [m]."""
    before, after = np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0)
    base, arm = after - before, outline - before
    area = np.abs(base[:, 0] * arm[:, 1] - base[:, 1] * arm[:, 0])
    return np.asarray(area / np.maximum(np.linalg.norm(base, axis=1), 1e-9))


def apart(outlines: Mapping[str, Floats]) -> tuple[dict[str, Floats], list[str]]:
    """The outlines of a storey with a thin wall between all that touch or overlap; and the names of those changed.

    What others cover is not among them.
    """
    shapes = _uncovered({name: shapely.Polygon(outline) for name, outline in outlines.items()})
    kept: dict[str, Floats] = {}
    changed = []
    for name, shape in shapes.items():
        near = [other for key, other in shapes.items() if key != name and shape.distance(other) < THIN_WALL_M - 2e-3]
        rest = shape
        for other in near:
            shared = shape.intersection(other).area
            if other.area > shape.area and shared > 0.5 * shape.area:
                continue  # it lies in the other, which makes room for it
            smaller = other.area < shape.area or shared < 0.05
            rest = rest.difference(other.buffer(THIN_WALL_M / 2, join_style="mitre")) if smaller else rest.difference(
                other.buffer(-0.3, join_style="mitre"))
        outline = outline_of(rest) if near else outlines[name]
        if near:
            changed.append(name)
        if outline is not None:
            kept[name] = outline
    return kept, changed


def _uncovered(shapes: Mapping[str, shapely.Polygon]) -> dict[str, shapely.Polygon]:
    """Those of which no others that are smaller, or as large and told before, cover most."""
    kept: dict[str, shapely.Polygon] = {}
    for name, shape in sorted(shapes.items(), key=lambda pair: round(pair[1].area, 1)):
        over = [other.intersection(shape) for other in kept.values() if other.intersects(shape)]
        if not over or shapely.union_all(over).area < COVERED * shape.area:
            kept[name] = shape
    return {name: shape for name, shape in shapes.items() if name in kept}


def squared(outline: Floats) -> Floats:
    """The outline with sides that are nearly along x or y exactly so; as it is where that spoils it."""
    moved = outline.copy()
    ahead = np.roll(outline, -1, axis=0) - outline
    for axis in (0, 1):
        level = np.abs(ahead[:, axis]) < np.abs(ahead[:, 1 - axis]) * math.tan(STRAIGHT)
        for run in _runs(level):
            moved[run, axis] = outline[run, axis].mean()
    done = cleaned(moved)
    return outline if done is None else done


def _runs(level: NDArray[np.bool_]) -> list[list[int]]:
    """The corners that sides in a row join, going round."""
    count = len(level)
    if level.all():
        return []
    runs = []
    for start in range(count):
        if level[start] and not level[start - 1]:
            run = [start]
            while level[run[-1]]:
                run.append((run[-1] + 1) % count)
            runs.append(run)
    return runs


def facing(a: str, outline_a: Floats, b: str, outline_b: Floats, least_m: float = 1e-3,
           most_m: float = THICKEST_M) -> list[Stretch]:
    """The stretches of the sides of one room that have the other behind them, through one wall of so much."""
    found: list[Stretch] = []
    if (outline_a.min(axis=0) > outline_b.max(axis=0) + most_m).any() or (
            outline_b.min(axis=0) > outline_a.max(axis=0) + most_m).any():
        return found
    starts, ends = outline_b, np.roll(outline_b, -1, axis=0)
    for side, (p, q) in enumerate(zip(outline_a, np.roll(outline_a, -1, axis=0), strict=True)):
        length = float(np.linalg.norm(q - p))
        along = (q - p) / length
        inward = np.array([-along[1], along[0]])
        for start, end in zip(starts, ends, strict=True):
            there = (end - start) / np.linalg.norm(end - start)
            behind = [-float((x - p) @ inward) for x in (start, end)]
            if float(there @ along) > -0.9993 or min(behind) < least_m or max(behind) > most_m:
                continue
            s = sorted(float((x - p) @ along) for x in (start, end))
            low, high = max(0.0, s[0]), min(length, s[1])
            if high - low > 0.3:
                found.append(Stretch(a, side, b, low, high, float(np.mean(behind))))
    return found


def side_of(outline: Floats, side: int) -> tuple[Floats, Floats, float]:
    """(2,) start and (2,) direction of a side, and its length [m]."""
    start, end = outline[side], outline[(side + 1) % len(outline)]
    length = float(np.linalg.norm(end - start))
    return start, (end - start) / length, length


def middle(outline: Floats, solid: list[Floats]) -> Floats:
    """(2,) the point of a room with the most room round it."""
    free = shapely.Polygon(outline)
    if solid:
        free = free.difference(shapely.union_all([shapely.Polygon(s).buffer(1e-3) for s in solid]))
    if free.is_empty:
        free = shapely.Polygon(outline)
    circle = shapely.maximum_inscribed_circle(free, tolerance=0.02)
    return np.asarray(shapely.get_coordinates(circle)[0])
