"""Outlines of building files: cleaned, separated by walls, squared, and the stretches where two face each other."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from world_models.building.checks import Watched, pass_on
from world_models.building.geometry.outlines import is_simple

Floats = NDArray[np.float64]

THIN_WALL_M = 0.05
"""Thickness of the wall that is put between two spaces without one."""
MAX_WALL_M = 0.55
MIN_SIDE_M = 0.03
MAX_CORNERS, FINE_TOLERANCE_M, COARSE_TOLERANCE_M = 24, 0.002, 0.03
"""Outlines are simplified (Douglas-Peucker) to the fine tolerance; one that keeps more corners is curved, and is
simplified to the coarse one."""
MIN_HOLE_M2 = 0.05
MOST_HOLES = 200
"""A room with more pillars and rooms within it is none that a robot could be told of; to cut them open takes hours."""
MIN_AREA_M2 = 0.05
MAX_COORDINATE_M = 5000.0
MOST_CROSSINGS = 200
"""An outline whose sides cross one another more often is no room's, and would take hours to repair."""
MAX_COVERED = 0.6
"""A space of which others, no larger, cover more than this part is no room: a zone, or described twice."""
MAX_SKEW_RAD = math.radians(8.0)
"""Sides within this angle of an axis are made parallel to it."""
MIN_TURN_RAD = math.radians(0.2)
"""A building turned by less is left as it is."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """The part, ``low_m`` to ``high_m``, of a side of room ``a`` with a side of room ``b`` ``gap_m`` behind it."""

    a: str
    side: int
    b: str
    low_m: float
    high_m: float
    gap_m: float


def clean_outline(points: Floats) -> Floats | None:
    """A simple counter-clockwise outline (k, 2) from points (n, 2), simplified, rounded to 0.1 mm; None: no area."""
    if len(points) < 3 or not np.isfinite(points).all() or np.abs(points).max() > MAX_COORDINATE_M:
        return None
    return extract_outline(repair(shapely.Polygon(points)))


def repair(shape: shapely.Geometry) -> shapely.Geometry:
    """A valid shape that covers the same; an empty one where its sides cross more than MOST_CROSSINGS times."""
    if shape.is_valid:
        return shape
    rings = [shapely.get_coordinates(ring) for ring in shapely.get_rings(shape)]
    sides = shapely.linestrings(np.concatenate([np.zeros((0, 2, 2)), *(
        np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings)]))
    tree, crossings = shapely.STRtree(sides), 0
    for first in range(0, len(sides), 100):
        crossings += tree.query(sides[first : first + 100], "crosses").shape[1]
        if crossings > 2 * MOST_CROSSINGS:
            return shapely.Polygon()
    return shapely.make_valid(shape)


def extract_outline(shape: shapely.Geometry, is_simplified: bool = False) -> Floats | None:
    """The outline (k, 2) of the largest polygon of a shape, simplified; None where it has none.

    ``is_simplified``: it was made of simplified outlines. The coarse tolerance would close the thin wall between them.
    """
    polygons = [p for p in shapely.get_parts(shape) if p.geom_type == "Polygon" and p.area > MIN_AREA_M2]
    if not polygons:
        return None
    largest = max(polygons, key=lambda p: p.area)
    if sum(shapely.Polygon(ring).area > MIN_HOLE_M2 for ring in largest.interiors) > MOST_HOLES:
        return None
    best = cut_holes_open(largest)
    for tolerance_m in (FINE_TOLERANCE_M,) if is_simplified else (FINE_TOLERANCE_M, COARSE_TOLERANCE_M):
        ring = shapely.Polygon(best.exterior).simplify(tolerance_m)
        outline = np.round(shapely.get_coordinates(shapely.orient_polygons(ring).exterior)[:-1], 4)
        outline = next((o for o in (_remove_short_sides(outline), _remove_short_sides(outline, False))
                        if len(o) >= 3 and is_simple(o)), outline[:0])
        if len(outline) <= MAX_CORNERS:
            break
    return outline if len(outline) >= 3 else None


def cut_holes_open(polygon: shapely.Polygon) -> shapely.Polygon:
    """The polygon with a slit from each hole to its border, as outlines have no holes.

    To fill the holes would put the room over the rooms that lie in them.
    """
    while holes := [ring for ring in polygon.interiors if shapely.Polygon(ring).area > MIN_HOLE_M2]:
        across = shapely.shortest_line(holes[0], polygon.exterior)
        slit = across.buffer(THIN_WALL_M / 2, cap_style="square") if across.length else across.buffer(THIN_WALL_M)
        parts = [p for p in shapely.get_parts(polygon.difference(slit)) if p.geom_type == "Polygon"]
        best = max(parts, key=lambda p: p.area, default=shapely.Polygon())
        if len(best.interiors) >= len(polygon.interiors):
            return shapely.Polygon(polygon.exterior, [r for r in polygon.interiors if r is not holes[0]])
        polygon = best
    return polygon


def _remove_short_sides(outline: Floats, with_steps: bool = True) -> Floats:
    while len(outline) > 3:
        lengths = np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1)
        at = int(np.argmin(lengths))
        straight = _corner_heights(outline) < 1e-3
        if lengths[at] < MIN_SIDE_M:
            outline = _remove_side(outline, at, with_steps)
        elif straight.any():
            outline = np.delete(outline, int(np.argmax(straight)), axis=0)
        else:
            break
    return outline


def _remove_side(outline: Floats, at: int, with_steps: bool) -> Floats:
    """The outline without a short side: of a step, the shorter side beside it moves onto the line of the longer."""
    before, start, end, after = (outline[(at + k) % len(outline)] for k in (-1, 0, 1, 2))
    one, other = start - before, after - end
    are_along = float(one @ other) > 0.99 * float(np.linalg.norm(one) * np.linalg.norm(other))
    if not (with_steps and are_along and len(outline) > 5):
        return np.asarray(np.delete(outline, (at + 1) % len(outline), axis=0))
    moved = outline.copy()
    if float(one @ one) >= float(other @ other):
        moved[(at + 2) % len(outline)] = after + (start - end)
    else:
        moved[at - 1] = before + (end - start)
    return np.asarray(np.delete(moved, [at, (at + 1) % len(outline)], axis=0))


def _corner_heights(outline: Floats) -> Floats:
    """(k,) distance of each corner from the line between its neighbours [m]."""
    before, after = np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0)
    base, arm = after - before, outline - before
    area = np.abs(base[:, 0] * arm[:, 1] - base[:, 1] * arm[:, 0])
    return np.asarray(area / np.maximum(np.linalg.norm(base, axis=1), 1e-9))


def separate_outlines(
    outlines: Mapping[str, Floats], watched: Watched = pass_on,
) -> tuple[dict[str, Floats], list[str]]:
    """The outlines of a storey with a thin wall between those that touch or overlap, and the names of those changed.

    Outlines that others cover are left out.
    """
    shapes = _drop_covered({name: shapely.Polygon(outline) for name, outline in outlines.items()})
    kept: dict[str, Floats] = {}
    changed = []
    drawn = list(shapes.values())
    tree = shapely.STRtree(drawn)
    for at, (name, shape) in enumerate(watched(list(shapes.items()), "rooms kept apart")):
        near = [drawn[i] for i in sorted(tree.query(shape.buffer(THIN_WALL_M)).tolist())
                if i != at and shape.distance(drawn[i]) < THIN_WALL_M - 2e-3]
        rest = shape
        for other in near:
            shared = shape.intersection(other).area
            if other.area > shape.area and shared > 0.5 * shape.area:
                continue  # it lies in the other, which is cut instead
            smaller = other.area < shape.area or shared < 0.05
            rest = rest.difference(other.buffer(THIN_WALL_M / 2, join_style="mitre")) if smaller else rest.difference(
                other.buffer(-0.3, join_style="mitre"))
        outline = extract_outline(rest, is_simplified=True) if near else outlines[name]
        if near:
            changed.append(name)
        if outline is not None:
            kept[name] = outline
    return kept, changed


def _drop_covered(shapes: Mapping[str, shapely.Polygon]) -> dict[str, shapely.Polygon]:
    """The shapes that smaller ones, and equal ones listed before, do not cover mostly."""
    kept: set[int] = set()
    by_size = sorted(shapes.items(), key=lambda pair: round(pair[1].area, 1))
    tree = shapely.STRtree([shape for _, shape in by_size])
    for at, (_, shape) in enumerate(by_size):
        meets = sorted(tree.query(shape, "intersects").tolist())
        over = [by_size[i][1].intersection(shape) for i in meets if i in kept]
        if not over or shapely.union_all(over).area < MAX_COVERED * shape.area:
            kept.add(at)
    names = {by_size[at][0] for at in kept}
    return {name: shape for name, shape in shapes.items() if name in names}


def square_outline(outline: Floats) -> Floats:
    """The outline with sides nearly parallel to x or y made exactly so; unchanged where that breaks it."""
    moved = outline.copy()
    ahead = np.roll(outline, -1, axis=0) - outline
    for axis in (0, 1):
        level = np.abs(ahead[:, axis]) < np.abs(ahead[:, 1 - axis]) * math.tan(MAX_SKEW_RAD)
        for run in _find_runs(level):
            moved[run, axis] = outline[run, axis].mean()
    done = clean_outline(moved)
    return outline if done is None else done


def _find_runs(level: NDArray[np.bool_]) -> list[list[int]]:
    """Chains of corner indices joined by consecutive marked sides."""
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


def find_turn(sides: Floats) -> float:
    """The angle [rad], within 45 degrees, between most of these sides (n, 2) and the axes; 0 where none prevails."""
    quarter = math.pi / 2
    length, angle = np.linalg.norm(sides, axis=1), np.mod(np.arctan2(sides[:, 1], sides[:, 0]), quarter)
    order, near_rad = np.argsort(angle, kind="stable"), math.radians(1.0)
    upward = angle[order]
    around = np.concatenate([upward - quarter, upward, upward + quarter])
    before = np.concatenate([[0.0], np.cumsum(np.tile(length[order], 3))])
    within = before[np.searchsorted(around, upward + near_rad)] - before[
        np.searchsorted(around, upward - near_rad, "right")]
    best = upward[int(np.argmax(np.round(within, 9)))]
    off = np.mod(angle - best + quarter / 2, quarter) - quarter / 2
    alike = np.abs(off) < near_rad
    if length[alike].sum() < 0.25 * length.sum():
        return 0.0
    turn = float(np.average(off[alike], weights=length[alike]) + best)
    turn = (turn + quarter / 2) % quarter - quarter / 2
    return turn if abs(turn) > MIN_TURN_RAD else 0.0


def find_facing_stretches(a: str, outline_a: Floats, b: str, outline_b: Floats, min_gap_m: float = 1e-3,
           max_gap_m: float = MAX_WALL_M) -> list[Stretch]:
    """The stretches of room a's sides that have room b behind a wall of ``min_gap_m`` to ``max_gap_m``."""
    found: list[Stretch] = []
    if (outline_a.min(axis=0) > outline_b.max(axis=0) + max_gap_m).any() or (
            outline_b.min(axis=0) > outline_a.max(axis=0) + max_gap_m).any():
        return found
    starts, ends = outline_b, np.roll(outline_b, -1, axis=0)
    for side, (p, q) in enumerate(zip(outline_a, np.roll(outline_a, -1, axis=0), strict=True)):
        length = float(np.linalg.norm(q - p))
        along = (q - p) / length
        inward = np.array([-along[1], along[0]])
        for start, end in zip(starts, ends, strict=True):
            there = (end - start) / np.linalg.norm(end - start)
            behind = [-float((x - p) @ inward) for x in (start, end)]
            if float(there @ along) > -0.9993 or min(behind) < min_gap_m or max(behind) > max_gap_m:
                continue
            s = sorted(float((x - p) @ along) for x in (start, end))
            low, high = max(0.0, s[0]), min(length, s[1])
            if high - low > 0.3:
                found.append(Stretch(a, side, b, low, high, float(np.mean(behind))))
    return found


def side_of(outline: Floats, side: int) -> tuple[Floats, Floats, float]:
    """(2,) start and (2,) unit direction of a side, and its length [m]."""
    start, end = outline[side], outline[(side + 1) % len(outline)]
    length = float(np.linalg.norm(end - start))
    return start, (end - start) / length, length


def find_center(outline: Floats, solid: list[Floats]) -> Floats:
    """(2,) the point with the largest clearance: centre of the maximum inscribed circle outside ``solid``."""
    free = shapely.Polygon(outline)
    if solid:
        free = free.difference(shapely.union_all([shapely.Polygon(s).buffer(1e-3) for s in solid]))
    if free.is_empty:
        free = shapely.Polygon(outline)
    circle = shapely.maximum_inscribed_circle(free, tolerance=0.02)
    return np.asarray(shapely.get_coordinates(circle)[0])


CURVE_JAMB_M = 0.06
"""Straight wall on either side of the door."""
MAX_WALL_DISTANCE_M = 0.6
"""A wall further from the middle of a door is not the one it is in."""
MAX_SAGITTA_M = 0.25
"""A corner further off the door's line is a corner of the room, not of a curve."""
MIN_CURVE_SIDE_M = 0.04
"""Corners nearer than this to the ends of the new side are dropped."""


def straighten_wall(outline: Floats, centre: Floats, along: Floats, width_m: float) -> Floats | None:
    """The outline (k, 2) with one side, parallel to a door, at the door; None where it has one or cannot have one.

    Args:
        centre, along: (2,) middle and direction of the door on the plan [m].
        width_m: of the door.
    """
    normal = np.array([-along[1], along[0]])
    s, off = (outline - centre) @ along, (outline - centre) @ normal
    first = _crossing(s, off)
    if first is None:
        return None
    half, count = width_m / 2 + CURVE_JAMB_M, len(outline)
    ahead = 1.0 if s[(first + 1) % count] > s[first] else -1.0
    start, end = first, (first + 1) % count
    while ahead * s[start] > -half and start != end:
        start = (start - 1) % count
    while ahead * s[end] < half and start != end:
        end = (end + 1) % count
    between = [(start + 1 + i) % count for i in range((end - start - 1) % count)]
    if start == end or not between:
        return None
    ends = [_off_at(s, off, start, (start + 1) % count, -ahead * half), _off_at(s, off, (end - 1) % count, end,
                                                                                  ahead * half)]
    level = float(np.mean(ends))
    if np.abs(off[between] - level).max() > MAX_SAGITTA_M or np.abs(np.array(ends) - level).max() > MAX_SAGITTA_M:
        return None
    new = [centre + sign * ahead * half * along + level * normal for sign in (-1.0, 1.0)]
    kept = [outline[(end + i) % count] for i in range(count - len(between))]
    kept = [p for p in kept if min(float(np.linalg.norm(p - q)) for q in new) > MIN_CURVE_SIDE_M]
    changed = np.round(np.array([*kept, *new]), 4)
    return changed if len(changed) >= 4 and is_simple(changed) else None


def _crossing(s: Floats, off: Floats) -> int | None:
    """Index of the side that passes the middle of the door nearest; None where none is near."""
    best: tuple[float, int] | None = None
    for i in range(len(s)):
        j = (i + 1) % len(s)
        if (s[i] < 0.0) != (s[j] < 0.0):
            away = abs(_off_at(s, off, i, j, 0.0))
            if away < MAX_WALL_DISTANCE_M and (best is None or away < best[0]):
                best = away, i
    return best[1] if best else None


def _off_at(s: Floats, off: Floats, i: int, j: int, at: float) -> float:
    """Distance off the door's line of the side from corner i to j, at position ``at`` along the line [m]."""
    part = (at - s[i]) / (s[j] - s[i]) if abs(s[j] - s[i]) > 1e-9 else 0.5
    return float(off[i] + min(max(part, 0.0), 1.0) * (off[j] - off[i]))
