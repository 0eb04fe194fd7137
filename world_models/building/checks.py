"""Checks of a world that could be read: rooms that overlap, leak or cannot be reached; misplaced things."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.outlines import distance_to_border, inside_polygon
from world_models.building.locales import STEP_M, Finding, Locale, Thing
from world_models.building.passages import find_firsts
from world_models.building.world import World

TOLERANCE_M = 0.01
"""Overlaps and overhangs up to this are not reported."""

DOORWAY_CLEARANCE_M = 0.05
"""A thing nearer than this to an opening stands in it."""

OUTDOOR_EYE_M = 0.3
"""Outdoors rays start this low: walls under the sky may be low."""


Watched = Callable[[Sequence[Any], str], Iterable[Any]]
"""Passes items on, one by one, and may show how far it is; the text says what they are."""


def pass_on(items: Sequence[Any], _what: str) -> Iterable[Any]:
    """Show nothing."""
    return items


def check_world(world: World, watched: Watched = pass_on) -> list[Finding]:
    """All findings, each kind in the order of the file; empty for a sound world.

    ``watched`` may show the progress: a large world takes minutes.
    """
    return [*world.building_faults, *_unclosed(world, watched), *_overlapping(world, watched), *_stepped(world),
            *_obstructed(world), *_unreachable(world), *_misplaced(world, watched), *_coinciding(world)]


def _unclosed(world: World, watched: Watched) -> Iterator[Finding]:
    """Rooms with a gap: from a point inside, some ray meets neither a surface nor a doorway of the room."""
    for name in watched(world.rooms, "rooms closed"):
        locale = world.locales[name]
        faces = world.faces_of(name)
        polygons = [r.polygon_world for f in faces for r in f.front]
        openings = [f.polygon_world for f in faces if f.kind == "doorway"]
        if not polygons or not _is_enclosed(world, name, [*polygons, *openings]):
            shut = "floor and walls" if _is_outdoors(locale) else "floor, ceiling, walls and doors"
            yield Finding(locale.source, f"{name}: expected a room closed by {shut}, got a gap")


def _is_enclosed(world: World, name: str, polygons: list[NDArray[np.float64]]) -> bool:
    """Whether every ray from a point in the room meets the front of a polygon; outdoors, every downward ray."""
    centre = _find_inner_point(world.outline(name))
    base = world.world_from_locale(name).translation[2]
    locale, rays = world.locales[name], _build_rays()
    eye = np.array([*centre, base + 0.55 * locale.height_m])
    if _is_outdoors(locale):
        eye, rays = np.array([*centre, base + OUTDOOR_EYE_M]), rays[rays[:, 2] < 0.0]
    hit = np.zeros(len(rays), bool)
    for polygon in polygons:
        hit |= _hits(eye, rays, polygon)
    return bool(hit.all())


def _build_rays() -> NDArray[np.float64]:
    """(n, 3) directions all round and from steeply down to steeply up."""
    turn, lift = np.meshgrid(np.linspace(0.0, 2 * np.pi, 47, endpoint=False) + 0.01, np.linspace(-1.4, 1.4, 9))
    return np.stack([np.cos(turn) * np.cos(lift), np.sin(turn) * np.cos(lift), np.sin(lift)], axis=-1).reshape(-1, 3)


def _hits(eye: NDArray[np.float64], rays: NDArray[np.float64], polygon: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(n,) which rays (n, 3) from ``eye`` meet the front of a convex polygon (k, 3), its border included."""
    spokes = polygon - eye
    return np.asarray(np.all(rays @ np.cross(spokes, np.roll(spokes, -1, axis=0)).T <= 1e-9, axis=1))


def _find_inner_point(outline: NDArray[np.float64]) -> NDArray[np.float64]:
    """A point well inside a simple polygon (k, 2): the best of a grid."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    xs, ys = (np.linspace(low[i], high[i], 12)[1:-1] for i in (0, 1))
    points = [np.array([x, y]) for x in xs for y in ys]
    return max(points, key=lambda p: _clearance_m(p, outline))


def _clearance_m(point: NDArray[np.float64], outline: NDArray[np.float64]) -> float:
    """Distance from the border; negative outside."""
    distance = distance_to_border(point, outline)
    return distance if inside_polygon(point, outline) else -distance


def _overlapping(world: World, watched: Watched) -> Iterator[Finding]:
    outlines = [world.outline(name) for name in watched(world.rooms, "rooms apart")]
    for i, j in _near_pairs(outlines):
        a, b = world.rooms[i], world.rooms[j]
        one, other = outlines[i], outlines[j]
        if _share_height(world, a, b) and (_reaches_into(one, other) or _reaches_into(other, one)):
            yield Finding(world.locales[b].source, f"{b}: expected a room apart from others, got one that overlaps {a}")


def _share_height(world: World, *names: str) -> bool:
    """Whether two rooms are not above each other."""
    floors = [world.floor_m(name) for name in names]
    ceilings = [floor + world.locales[name].height_m for floor, name in zip(floors, names, strict=True)]
    return max(floors) < min(ceilings) - TOLERANCE_M


def _is_outdoors(locale: Locale) -> bool:
    return bool(locale.properties.get("sky"))


def _stepped(world: World) -> Iterator[Finding]:
    """Doorways with a step in them: wheels cannot pass."""
    for doorway in world.doorways:
        step_m = abs(world.floor_m(doorway.between[0]) - world.floor_m(doorway.between[1]))
        if step_m > STEP_M:
            yield Finding(doorway.source, f"{doorway.name}: expected {' and '.join(doorway.between)} on one level, "
                                          f"got a step of {step_m:.2f} m")


def _obstructed(world: World) -> Iterator[Finding]:
    """Things that stand or hang in an open doorway."""
    for doorway in world.doorways:
        for room in doorway.between:
            left, right = doorway.threshold_of(room)
            across, outward = (right - left) / doorway.width_m, doorway.outward_from(room)
            for thing in world.things_of(room):
                sideways = (thing.footprint_world - left) @ across
                away_m = float(-((thing.footprint_world - left) @ outward).max())
                beside = sideways.max() < TOLERANCE_M or sideways.min() > doorway.width_m - TOLERANCE_M
                at_height = thing.high_m > STEP_M and thing.low_m < doorway.height_m
                if not beside and away_m < DOORWAY_CLEARANCE_M and at_height:
                    what = f"{thing.name}: expected the doorway {doorway.name} free, got it in there"
                    yield Finding(thing.source, what)


def _near_pairs(outlines: list[NDArray[np.float64]]) -> Iterator[tuple[int, int]]:
    """Pairs of polygons, in order, whose bounding rectangles share more than a border."""
    if not outlines:
        return
    low, high = (np.array([bound(outline, axis=0) for outline in outlines]) for bound in (np.min, np.max))
    for i in range(len(outlines)):
        meets = (low[i + 1 :] < high[i] - TOLERANCE_M) & (high[i + 1 :] > low[i] + TOLERANCE_M)
        yield from ((i, i + 1 + int(j)) for j in np.flatnonzero(meets.all(axis=1)))


def _reaches_into(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Whether points just inside the sides of a simple polygon, or in its middle, are well within another."""
    points = [_find_inner_point(one)]
    for a, b in zip(one, np.roll(one, -1, axis=0), strict=True):
        inward = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
        points += [a + t * (b - a) + 2 * TOLERANCE_M * inward for t in np.linspace(0.01, 0.99, 25)]
    return any(_clearance_m(point, other) > TOLERANCE_M for point in points)


def _unreachable(world: World) -> Iterator[Finding]:
    if not world.rooms:
        return
    joined = [*(doorway.between for doorway in world.doorways), *(link.between for link in world.links)]
    firsts = find_firsts(world.rooms, joined)
    for name in world.rooms:
        locale = world.locales[name]
        if firsts[name] != world.rooms[0] and not locale.properties.get("unreachable"):
            yield Finding(locale.source, f"{name}: expected open doorways from {world.rooms[0]}, got none")


def _misplaced(world: World, watched: Watched) -> Iterator[Finding]:
    for thing in watched(world.things, "things in their rooms"):
        outline, locale = world.outline(thing.locale), world.locales[thing.locale]
        if not all(inside_polygon(corner, outline, TOLERANCE_M) for corner in thing.footprint_world):
            yield Finding(thing.source, f"{thing.name}: expected it inside {thing.locale}, got a corner outside")
        if thing.low_m < -TOLERANCE_M or thing.high_m > locale.height_m + TOLERANCE_M:
            what = (f"{thing.name}: expected it between floor and ceiling (0 .. {locale.height_m:.2f} m), "
                    f"got {thing.low_m:.2f} .. {thing.high_m:.2f} m")
            yield Finding(thing.source, what)


def _coinciding(world: World) -> Iterator[Finding]:
    """Things in exactly the same place: one of them was pasted twice, or is not where it should be."""
    places: dict[tuple[Any, ...], list[Thing]] = {}
    for thing in world.things:
        key = (thing.locale, thing.low_m, thing.high_m, thing.footprint_world.tobytes())
        places.setdefault(key, []).append(thing)
    for first, *others in places.values():
        if others:
            more = f", and {len(others) - 1} more are there" if len(others) > 1 else ""
            what = f"{others[0].name}: expected a place of its own, got that of {first.name}{more}"
            yield Finding(others[0].source, what)
