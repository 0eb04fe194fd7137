"""A building that its model describes by centimetres wrongly: ``[truth.inexact]`` of a scenario.

Each wall is displaced along its normal, each door along its wall, each thing on the floor, or along and up its wall.
All displacements are independent and normal. What is built back to back moves as one: the two sides of a wall, and
walls of several rooms that lie in one plane along a corridor. Some things are missing, and some are there once more,
elsewhere in their room. What belongs to something moves with it: baseboards with their wall, casings with their door.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from world_models.building.locales import Thing
from world_models.building.world import World
from world_models.files.construction.builder import MAX_WALL_M, build_world, compute_world_poses
from world_models.files.construction.specs import DoorSpec, LocaleSpec, ThingSpec, WorldSpec
from world_models.frames import Pose
from world_models.units import Bounded, bounded

Floats = NDArray[np.float64]

MAX_SIGMAS = 2.5
"""Displacements are drawn again beyond: at 10 cm a wall is never half a metre elsewhere."""
PLACES_TRIED = 4
"""So many places are drawn for a thing that is there once more."""
MAX_SMALLER = 6
"""So often a displacement of a door that does not fit into its wall is halved."""
MIN_LIFT_M = 0.3
"""Things on a wall that begin lower stand on the floor, and are not displaced upward [m]."""
PARALLEL = 0.999
"""Cosine between the normals of walls that lie in one plane."""
SAME_PLANE_M = 0.02
"""Walls of one room that lie in one plane to this are pieces of one wall [m]."""
MIN_LONG_M = 5.0
"""A corridor's walls of this length are next to those who walk along it [m]."""
MARGIN_M, NEAR_DOOR_M, OUTSIDE_M = 0.3, 0.05, 0.15
"""Extra things are so far from the ends of their wall and from doors, and reach so far out of their room [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueInexact(Bounded):
    """How far the true building is from its model: ``[truth.inexact]``.

    Attributes:
        sigma_m: standard deviation of each displacement.
        missing: share of the model's things that are not there.
        extra: number of things that are there and not in the model, as a share of the model's things.
        door_m: by how much each door is also displaced along its wall, to either side.
        corridor_m: by how much each hallway is wider, half of it on either side.
        seed: of the random numbers.
    """

    sigma_m: float = bounded(0.0, 0.0, 0.3)
    missing: float = bounded(0.0, 0.0, 1.0)
    extra: float = bounded(0.0, 0.0, 1.0)
    door_m: float = bounded(0.0, 0.0, 0.3)
    corridor_m: float = bounded(0.0, 0.0, 0.5)
    seed: int = bounded(0, 0, 2**31)


EXACT = TrueInexact()


@dataclass(frozen=True, slots=True)
class TrueBuilding:
    """A building as it is.

    Attributes:
        spec: of all that is there.
        missing, extra: names of the things that are not there, and of those that the model lacks.
        walls_m: displacement of each wall (locale, wall) into its room; doors_m: of each door along its wall, by name.
    """

    spec: WorldSpec
    missing: tuple[str, ...]
    extra: tuple[str, ...]
    walls_m: Mapping[tuple[str, str], float]
    doors_m: Mapping[str, float] = field(default_factory=dict)


def displace(spec: WorldSpec, truth: TrueInexact) -> TrueBuilding:
    """The model with all its displacements, the same for the same arguments."""
    walls_rng, doors_rng, things_rng, lots_rng = np.random.default_rng([truth.seed, 11]).spawn(4)
    walls_m = _draw_walls(spec, truth.sigma_m, 0.5 * truth.corridor_m, walls_rng)
    moved = _move_walls(spec, walls_m)
    moved, doors_m = _move_doors(spec, moved, truth, doors_rng)
    things = [_move_thing(thing, spec.locales[thing.locale], moved.locales[thing.locale], truth.sigma_m, things_rng)
              for thing in spec.things]
    is_missing = lots_rng.random(len(things)) < truth.missing
    chosen = np.flatnonzero(lots_rng.random(len(things)) < truth.extra).tolist()
    extra = _add_things(moved, [things[i] for i in chosen], lots_rng)
    kept = [thing for thing, gone in zip(things, is_missing, strict=True) if not gone]
    return TrueBuilding(
        replace(moved, things=(*kept, *extra)),
        tuple(f"{t.locale}/{t.name}" for t, gone in zip(things, is_missing, strict=True) if gone),
        tuple(f"{t.locale}/{t.name}" for t in extra), walls_m, doors_m)


def _draw(rng: np.random.Generator, sigma_m: float, size: int = 1) -> Floats:
    """(size,) normal displacements, none beyond :data:`MAX_SIGMAS` [m]."""
    drawn = rng.normal(size=size)
    while np.any(far := np.abs(drawn) > MAX_SIGMAS):
        drawn[far] = rng.normal(size=np.count_nonzero(far))
    return np.asarray(sigma_m * drawn)


# -- walls -----------------------------------------------------------------------------------------------------------


def _draw_walls(
    spec: WorldSpec, sigma_m: float, outward_m: float, rng: np.random.Generator
) -> dict[tuple[str, str], float]:
    """The displacement of each wall (locale, wall) into its room [m]; ``outward_m``: of a corridor's long walls."""
    import networkx as nx  # slow to import, and few missions have such a building

    names, starts, ends, inward = _list_walls(spec)
    lengths = np.linalg.norm(ends - starts, axis=1)
    graph = nx.Graph()
    graph.add_nodes_from(range(len(names)))
    for i in range(len(names)):
        graph.add_edges_from((i, j) for j in _find_one_with(i, names, starts, ends, inward))
    found: dict[tuple[str, str], float] = {}
    for group in nx.connected_components(graph):
        first = min(group)
        by_m = float(_draw(rng, sigma_m)[0])
        long = [i for i in group if spec.locales[names[i][0]].kind == "hallway" and lengths[i] >= MIN_LONG_M]
        by_m -= outward_m * float(np.sign(inward[long[0]] @ inward[first])) if long else 0.0
        found.update({names[i]: by_m * float(np.sign(inward[i] @ inward[first])) for i in group})
    return {name: found[name] for name in names}


def _list_walls(spec: WorldSpec) -> tuple[list[tuple[str, str]], Floats, Floats, Floats]:
    """Names (locale, wall), ends (n, 2) and unit normals into the room (n, 2) of all walls [m, world]."""
    poses = compute_world_poses(spec.locales, spec.name)
    names: list[tuple[str, str]] = []
    starts: list[Floats] = [np.zeros((0, 2))]
    for name, locale in spec.locales.items():
        if locale.outline is not None:
            corners = np.column_stack([locale.outline, np.zeros(len(locale.outline))])
            starts.append(poses[name].apply(corners)[:, :2])
            names += [(name, wall) for wall in locale.wall_names]
    ends = np.concatenate([np.roll(corners, -1, axis=0) for corners in starts])
    begin = np.concatenate(starts)
    along = (ends - begin) / np.linalg.norm(ends - begin, axis=1, keepdims=True)
    return names, begin, ends, np.column_stack([-along[:, 1], along[:, 0]])


def _find_one_with(
    i: int, names: Sequence[tuple[str, str]], starts: Floats, ends: Floats, inward: Floats
) -> list[int]:
    """The walls that move with wall i: those back to back with it, and those of its room in the same plane."""
    along = np.array([inward[i, 1], -inward[i, 0]])
    own = np.sort([along @ starts[i], along @ ends[i]])
    reach = np.sort(np.stack([starts @ along, ends @ along]), axis=0)
    overlap = np.minimum(own[1], reach[1]) - np.maximum(own[0], reach[0])
    off = np.mean([(starts - starts[i]) @ inward[i], (ends - starts[i]) @ inward[i]], axis=0)
    turned = inward @ inward[i]
    is_back = (turned < -PARALLEL) & (off >= -MAX_WALL_M) & (off <= SAME_PLANE_M) & (overlap > 0.0)
    is_same_room = np.array([name[0] == names[i][0] for name in names])
    is_piece = is_same_room & (turned > PARALLEL) & (np.abs(off) < SAME_PLANE_M)
    return [int(j) for j in np.flatnonzero(is_back | is_piece) if j != i]


def _move_walls(spec: WorldSpec, walls_m: Mapping[tuple[str, str], float]) -> WorldSpec:
    locales = {}
    for name, locale in spec.locales.items():
        if locale.outline is not None:
            by_m = np.array([walls_m[name, wall] for wall in locale.wall_names])
            locale = replace(locale, outline=_move_sides(locale.outline, by_m))
        locales[name] = locale
    return replace(spec, locales=locales)


def _move_sides(outline: Floats, inward_m: Floats) -> Floats:
    """An outline (k, 2), counter-clockwise, with each side moved inward: each corner is where its two sides meet."""
    along = np.roll(outline, -1, axis=0) - outline
    normals = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    corners = []
    for i in range(len(outline)):
        sides, by_m = np.stack([normals[i - 1], normals[i]]), np.array([inward_m[i - 1], inward_m[i]])
        corners.append(outline[i] + np.linalg.lstsq(sides, by_m, rcond=0.05)[0])
    return np.array(corners)


# -- doors and things ------------------------------------------------------------------------------------------------


def _move_doors(
    spec: WorldSpec, moved: WorldSpec, truth: TrueInexact, rng: np.random.Generator
) -> tuple[WorldSpec, dict[str, float]]:
    """Doors along their walls; one that does not fit there is displaced by less."""
    drawn = _draw(rng, 1.0, len(spec.doors))
    offs_m = truth.sigma_m * drawn + truth.door_m * np.sign(drawn)
    by_m = dict(zip((door.name for door in spec.doors), offs_m.tolist(), strict=True))
    known = _count_faults(spec)
    for _ in range(MAX_SMALLER):
        tried = replace(moved, doors=tuple(_move_door(door, spec, moved, by_m[door.name]) for door in spec.doors))
        unfit = _count_faults(tried) - known
        if not unfit:
            break
        by_m.update({name: 0.5 * by_m[name] for name in unfit})
    return tried, by_m


def _count_faults(spec: WorldSpec) -> set[str]:
    """Names of the doors that cannot be built."""
    faults = [finding.what for finding in build_world(replace(spec, things=())).building_faults]
    return {door.name for door in spec.doors for what in faults if what.startswith(f"door {door.name}:")}


def _move_door(door: DoorSpec, spec: WorldSpec, moved: WorldSpec, by_m: float) -> DoorSpec:
    room = door.between[0]
    shift_m = _compute_start_shift(door.wall, spec.locales[room], moved.locales[room])
    return replace(door, along_m=door.along_m - shift_m + by_m)


def _compute_start_shift(wall: str, before: LocaleSpec, after: LocaleSpec) -> float:
    """How far the start of a wall moved along it, where places on it are measured from there [m]."""
    if wall in ("south", "north", "east", "west") or before.outline is None or after.outline is None:
        return 0.0
    i = before.wall_names.index(wall)
    along = before.outline[(i + 1) % len(before.outline)] - before.outline[i]
    return float((after.outline[i] - before.outline[i]) @ along / np.linalg.norm(along))


def _move_thing(
    thing: ThingSpec, before: LocaleSpec, after: LocaleSpec, sigma_m: float, rng: np.random.Generator
) -> ThingSpec:
    x_m, y_m = _draw(rng, sigma_m, 2).tolist()
    if thing.wall is None:
        pose = thing.locale_from_part or Pose.identity()
        return replace(thing, locale_from_part=Pose(pose.rotation, pose.translation + np.array([x_m, y_m, 0.0])))
    up_m = thing.up_m + y_m if thing.up_m >= MIN_LIFT_M else thing.up_m
    low, high = _list_places(after, thing.wall)
    along_m = thing.along_m - _compute_start_shift(thing.wall, before, after) + x_m
    return replace(thing, along_m=float(np.clip(along_m, low, high)), up_m=up_m)


def _list_places(locale: LocaleSpec, wall: str) -> tuple[float, float]:
    """Where a wall begins and ends, as places on it are given [m]."""
    if locale.outline is None:
        return 0.0, 0.0
    i = locale.wall_names.index(wall)
    start, end = locale.outline[i], locale.outline[(i + 1) % len(locale.outline)]
    axis = {"south": 0, "north": 0, "east": 1, "west": 1}.get(wall)
    if axis is None:
        return 0.0, float(np.linalg.norm(end - start))
    return float(min(start[axis], end[axis])), float(max(start[axis], end[axis]))


def _add_thing(thing: ThingSpec, locale: LocaleSpec, number: str, rng: np.random.Generator) -> ThingSpec:
    """A thing once more: elsewhere on its wall, or, where it stands on the floor, displaced by about its size."""
    name = f"{thing.name}-once-more-{number}"
    if thing.wall is not None:
        low, high = _list_places(locale, thing.wall)
        margin_m = min(MARGIN_M, 0.5 * (high - low))
        return replace(thing, name=name, along_m=float(rng.uniform(low + margin_m, high - margin_m)))
    reach = np.array([box.ranges for box in thing.boxes])[:, :2]
    size_m = float(np.max(reach[..., 1].max(axis=0) - reach[..., 0].min(axis=0)))
    turn = rng.uniform(-np.pi, np.pi)
    pose = thing.locale_from_part or Pose.identity()
    beside = size_m * np.array([np.cos(turn), np.sin(turn), 0.0])
    return replace(thing, name=name, locale_from_part=Pose(pose.rotation, pose.translation + beside))


def _add_things(spec: WorldSpec, things: Sequence[ThingSpec], rng: np.random.Generator) -> list[ThingSpec]:
    """Each of these things once more, where there is room; none where :data:`PLACES_TRIED` draws found none."""
    tried = [[_add_thing(thing, spec.locales[thing.locale], f"{number}-{k}", rng) for k in range(PLACES_TRIED)]
             for number, thing in enumerate(things)]
    built = build_world(replace(spec, things=tuple(thing for places in tried for thing in places)))
    stands = {thing.name: _stands_free(built, thing) for thing in built.things}
    free = [[thing for thing in places if stands[f"{thing.locale}/{thing.name}"]] for places in tried]
    return [places[0] for places in free if places]


def _stands_free(world: World, thing: Thing) -> bool:
    """Whether a thing covers no door, and lies within its room."""
    covered = shapely.MultiPoint(thing.footprint_world).convex_hull
    doors = [shapely.MultiPoint(mark.lines_world[..., :2].reshape(-1, 2)).convex_hull for mark in world.landmarks
             if mark.kind in ("door", "doorway") and thing.locale in (mark.locale, mark.neighbour)]
    room = shapely.Polygon(world.outline(thing.locale)).buffer(OUTSIDE_M)
    return bool(room.contains(covered)) and all(covered.distance(door) > NEAR_DOOR_M for door in doors)
