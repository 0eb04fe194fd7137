"""Clutter: solid things on or beside a way that the model lacks, at random, with a way left or with none left.

Whether there is a way is decided by a planner that knows everything solid (:mod:`sim.body.collision`). With a way left
the robot can pass at ``WAY_MARGIN_M`` from everything; with none left it cannot even by touching.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from experiments.generated.free_floor import find_free_floor, has_way, take_from_floor
from sim.body.collision import ROBOT_RADIUS_M, Obstacles
from sim.ground_truth.table import ExtraThing
from sim.ground_truth.things import SHAPES, build_thing, footprint
from sim.stage import Stage
from world_models.building.locales import Doorway
from world_models.commands import parse_command
from world_models.entries import Place
from world_models.frames import Pose2

Floats = NDArray[np.float64]
MIN_THINGS, MAX_THINGS = 1, 6
WAY_MARGIN_M = 0.08
"""Room to either side of the robot on a way that is left: narrow, as in a doorway [m]."""
KINDS = tuple(sorted(set(SHAPES) - {"partition", "door-leaf"}))
"""A mat among them is rolled over, and nothing in the way."""
WIDE = ("box", "cart", "cartons", "table")
"""Things that a row across a way is made of."""
KEPT_FREE_M = ROBOT_RADIUS_M + 0.4
"""Distance from start and goal within which nothing is put."""
MAX_GAP_M = 2.0 * ROBOT_RADIUS_M - 0.06
"""Gaps in a row across a way are narrower."""
PAINTED_SHARE = 0.7
"""Of camouflaged things."""
MAX_DRAWS = 300


@dataclass(frozen=True)
class Clutter:
    """Things that stand on or beside a mission's way.

    Attributes:
        things: 1 to 6, from the start of the run.
        leaves_way: whether the robot can still get to its goal.
    """

    things: tuple[ExtraThing, ...]
    leaves_way: bool

    def painted(self, colour: tuple[float, ...], rng: np.random.Generator) -> Clutter:
        """The same with most things in one colour."""
        return replace(self, things=tuple(
            replace(thing, colour=colour) if rng.random() < PAINTED_SHARE else thing for thing in self.things))

    @property
    def text(self) -> str:
        """Its part of a scenario's file."""
        return "".join(
            f'\n[[truth.extra]]\nkind = "{t.kind}"\nlocale = "{t.locale}"\nx_m = {t.x_m:.4f}\ny_m = {t.y_m:.4f}\n'
            f"heading_rad = {t.heading_rad:.4f}\n{f'colour = {list(t.colour)}' if t.colour else ''}\n"
            for t in self.things)


class ClutterMaker:
    """Clutters the way of one scenario, again and again."""

    def __init__(self, stage: Stage) -> None:
        """Prepare a scenario without clutter. Raises ValueError where there is no way from its start to its goal."""
        self._stage, self._world = stage, stage.world
        obstacles = stage.building.obstacles
        self._free = {margin: find_free_floor(obstacles, margin) for margin in (0.0, WAY_MARGIN_M)}
        self._solid = shapely.union_all(shapely.linestrings(obstacles.segments_world))
        shapely.prepare(self._solid)
        ends = parse_command(stage.scenario.goal, stage.world)
        self._rooms = self._world.walk(ends[0].locale, ends[1].locale)
        if self._rooms is None or not self._has_way((), WAY_MARGIN_M):
            raise ValueError(f"expected a way from start to goal of {stage.scenario.name}, got none")
        self._way = self._draft_way(self._rooms)

    def draw(self, seed: int, *, leaves_way: bool = True, count: int | None = None) -> Clutter:
        """Clutter for a seed.

        Args:
            leaves_way: whether a way to the goal is left.
            count: how many things; at random from 1 to 6 unless said. Where no way is left, the least number.

        Raises:
            ValueError: the count is not 1 to 6, or nothing that fits was found.
        """
        if count is not None and not MIN_THINGS <= count <= MAX_THINGS:
            raise ValueError(f"expected {MIN_THINGS} to {MAX_THINGS} things, got {count}")
        rng = np.random.default_rng(seed)
        for _ in range(MAX_DRAWS):
            wanted = count or int(rng.integers(MIN_THINGS, MAX_THINGS + 1))
            barriers = [] if leaves_way else self._draw_barriers(rng)
            things = self._fill(barriers, wanted, rng)
            if things is not None and self._is_as_wanted(things, leaves_way):
                return Clutter(tuple(things), leaves_way)
        way = "a way" if leaves_way else "no way"
        raise ValueError(f"expected clutter that leaves {way}, got none in {MAX_DRAWS} draws")

    def _is_as_wanted(self, things: Sequence[ExtraThing], leaves_way: bool) -> bool:
        return self._has_way(things, WAY_MARGIN_M) if leaves_way else not self._has_way(things, 0.0)

    def _has_way(self, things: Sequence[ExtraThing], margin_m: float) -> bool:
        faces = [face for i, t in enumerate(things) for face in build_thing(
            t.kind, f"{i}", t.locale, self._pose(t).lifted(self._world.floor_m(t.locale)))]
        extra = Obstacles.of_faces(faces, self._stage.building.floor_m)
        free = take_from_floor(self._free[margin_m], extra, margin_m)
        return has_way(free, self._stage.start_world, self._stage.goal_world)

    def _fill(self, things: list[ExtraThing], count: int, rng: np.random.Generator) -> list[ExtraThing] | None:
        """These things, where they have room, and more at random places up to a count; None where some have no room."""
        taken: list[shapely.Geometry] = []
        for thing in things:
            if len(taken) == MAX_THINGS or not self._has_room(thing, taken):
                return None
            taken.append(self._floor_of(thing))
        for _ in range(MAX_DRAWS):
            if len(things) >= count:
                return things
            more = self._draw_thing(rng)
            if more is not None and self._has_room(more, taken):
                things.append(more)
                taken.append(self._floor_of(more))
        return None

    def _draw_thing(self, rng: np.random.Generator) -> ExtraThing | None:
        """A thing on the way, or as often beside it; None where that is in no room."""
        kind = str(rng.choice(KINDS))
        aside_m = float(rng.normal(0.0, 0.2) if rng.random() < 0.5 else rng.choice([-1, 1]) * rng.uniform(0.5, 1.4))
        point = self._way.interpolate(float(rng.uniform(0.0, self._way.length)))
        there = self._across(point) @ Pose2(0.0, aside_m, float(rng.uniform(-math.pi, math.pi)))
        return self._placed(kind, there)

    def _across(self, point: shapely.Point) -> Pose2:
        """The pose at a point of the way, facing along it."""
        at = self._way.project(point)
        (x0, y0), (x1, y1) = (self._way.interpolate(max(0.0, at + step)).coords[0] for step in (-0.05, 0.05))
        return Pose2(float(point.x), float(point.y), math.atan2(y1 - y0, x1 - x0))

    def _draw_barriers(self, rng: np.random.Generator) -> list[ExtraThing]:
        """What may close the way: a thing in each doorway of the first or the last room, or a row across the way."""
        assert self._rooms is not None
        if len(self._rooms) > 1 and rng.random() < 0.5:
            room = str(rng.choice([self._rooms[0], self._rooms[-1]]))
            doorways = [d for d in self._world.doorways if room in d.between]
            things = [self._before_doorway(doorway, room, rng) for doorway in doorways]
        else:
            things = list(self._draw_row(rng))
        return [thing for thing in things if thing is not None]

    def _before_doorway(self, doorway: Doorway, room: str, rng: np.random.Generator) -> ExtraThing | None:
        """A thing before one side of a doorway; its own x runs along the wall."""
        kind, side = str(rng.choice(WIDE)), str(rng.choice(doorway.between))
        half_m = float(footprint(kind)[:, 1].max())
        back = doorway.pose_from(side) @ Pose2(-half_m - float(rng.uniform(0.05, 0.12)), 0.0, math.pi / 2.0)
        return self._placed(kind, back)

    def _draw_row(self, rng: np.random.Generator) -> Iterator[ExtraThing | None]:
        """Things side by side from wall to wall, with gaps that are too narrow."""
        point = self._way.interpolate(float(rng.uniform(0.0, self._way.length)))
        here, kind = self._across(point), str(rng.choice(WIDE))
        left_m, right_m = (self._room_beside_m(here, side) for side in (1.0, -1.0))
        width_m, between_m = float(np.ptp(footprint(kind)[:, 0])), left_m + right_m
        for count in range(1, MAX_THINGS + 1):
            gap_m = (between_m - count * width_m) / (count + 1)
            if 0.02 < gap_m < MAX_GAP_M:
                for i in range(count):
                    aside_m = left_m - gap_m - width_m / 2.0 - i * (width_m + gap_m)
                    yield self._placed(kind, here @ Pose2(0.0, aside_m, math.pi / 2.0))
                return

    def _room_beside_m(self, here: Pose2, side: float) -> float:
        """Distance from a pose to the first solid thing on its left (1) or right (-1) [m]."""
        far = (here @ Pose2(0.0, side * 50.0, 0.0)).position
        met = shapely.intersection(shapely.LineString([here.position, far]), self._solid)
        return float(shapely.distance(met, shapely.Point(here.position)))

    def _placed(self, kind: str, pose: Pose2) -> ExtraThing | None:
        room = self._stage.building.locale_at(pose)
        if room not in self._world.locales or not self._world.is_room(room):
            return None
        place = Place.of_world(self._world, room, pose.x_m, pose.y_m, pose.heading_rad)
        heading_rad = math.remainder(place.heading_rad or 0.0, math.tau)
        return ExtraThing(kind=kind, locale=room, x_m=round(place.x_m, 4), y_m=round(place.y_m, 4),
                          heading_rad=round(heading_rad, 4))

    def _pose(self, thing: ExtraThing) -> Pose2:
        return Place(thing.locale, thing.x_m, thing.y_m, thing.heading_rad).in_world(self._world)

    def _floor_of(self, thing: ExtraThing) -> shapely.Geometry:
        """The rectangle round a thing, world frame."""
        pose = self._pose(thing)
        return shapely.Polygon([(pose @ Pose2(float(x), float(y), 0.0)).position for x, y in footprint(thing.kind)])

    def _has_room(self, thing: ExtraThing, taken: Sequence[shapely.Geometry]) -> bool:
        floor, stage = self._floor_of(thing), self._stage
        kept = [shapely.Point(end.position) for end in (stage.start_world, stage.goal_world)]
        room = shapely.Polygon(self._world.outline(thing.locale))
        return bool(
            room.covers(floor) and not self._solid.intersects(floor)
            and all(floor.distance(end) > KEPT_FREE_M for end in kept)
            and not any(floor.intersects(other) for other in taken))

    def _draft_way(self, rooms: Sequence[str]) -> shapely.LineString:
        """From the start through the middles of the doorways to the goal."""
        points: list[Floats] = [self._stage.start_world.position]
        for near, far in pairwise(rooms):
            between = [d for d in self._world.doorways if {near, far} == set(d.between)]
            if between:
                doorway = min(between, key=lambda d: float(np.linalg.norm(d.centre_world - points[-1])))
                points += [doorway.pose_from(near).position, doorway.pose_from(far).position]
        return shapely.LineString([*points, self._stage.goal_world.position])
