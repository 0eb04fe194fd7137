"""Explores a building of which nothing is known: looks round, drives to where something is not known yet, comes home.

What it wants to know: the floor of a room that it has not seen, walls that it has not read, and what is behind a
doorway (B. Yamauchi, A frontier-based approach for autonomous exploration, 1997). It moves only where it has seen
floor. Round the start, nearer than the lower edge of its picture, the floor is taken to be free.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from harvey_survey.axis_map import ACROSS, OUTWARD, AxisMap, LearntDoor, LearntRoom
from harvey_survey.axis_view import AxisView, FloorLooks, see_axes
from harvey_survey.seen_floor import CELL_M, Cell, SeenFloor, cell_of, near_cell, point_of
from knowledge_sources.methods.floor.appearance import fit_appearance
from knowledge_sources.methods.motion.clearance import choose_move
from world_models.actuator import ActuatorModel
from world_models.camera import Camera, CameraMount
from world_models.entries import BodyFault, CameraPicture, Contact, MotionReport, MotorCommand
from world_models.frames import wrap_angle

Floats = NDArray[np.float64]

LOOKS = 8
"""Pictures of a look round."""
GLANCE_RAD = math.radians(28.0)
"""Pictures to both sides, of a doorway."""
MAX_LEG_M, MAX_LEGS = 1.6, 40
BORNE_M_PER_S, LEG_S = 0.09, 3.0
"""Speed at which a certain touch is borne, and what a leg takes besides moving: its turn and picture."""
TURN_RAD = math.radians(0.4)
"""A heading further off is corrected before it moves."""
BEFORE_DOOR_M, BEHIND_DOOR_M = 1.9, 1.2
"""So far before a doorway it looks through, and so far behind the wall it looks round, in the room behind."""
NEAR_FLOOR_M = 0.8
"""Floor so much further than the nearest in the picture tells what the floor looks like where it stands."""
SAME_FLOOR = 9.0
"""Squared deviations between the looks of floors that are one."""
MIN_GAIN_M2, MIN_GAIN_SHARE, GAIN_M = 0.3, 0.02, (1.8, 7.0)
"""It goes on looking in a room while so much more floor of it would be seen, from so far."""
COST_PER_M2 = 0.15
UNREAD_M2, READ_SLANT = 0.1, 2.0
"""A piece of a wall of which it is not known whether it is open counts as so much floor, where it would be seen so
straight (tangent from its normal)."""
LOOKED_M = 0.7
"""It looks round only so far from where it has."""
DISC_M = 0.45
"""Where it stood and drove there is floor: its own disc, with the margin beside it."""
WALL_M, DOORWAY_M = 0.08, 0.25
"""A wall is at least so thick; so far behind its front floor is taken for seen between jambs."""
BETWEEN_WALLS_M = 0.12
"""Behind a doorway the next room begins about so far behind the wall."""
MAX_STANDS = 300


class ExploringBody(Protocol):
    """What moves and sees."""

    def execute(self, command: MotorCommand, /) -> MotionReport | BodyFault: ...
    def look(self, purpose: str, /) -> CameraPicture | BodyFault: ...
    def take_contact(self) -> Contact | None: ...


class ExploringStopped(Exception):
    """It cannot go on, and why: something was touched, or a device failed."""


@dataclass(frozen=True, eq=False)
class ExploringGoal:
    """Where to go for what: a doorway to look through, or None: to look round in a room."""

    cell: Cell
    cost: float
    door: LearntDoor | None
    words: str


class Explorer:
    """One exploration.

    Attributes:
        map: what is known; floor: where floor was seen; heading_rad: of the robot now, in the axes' frame.
        start_rad: heading at the start.
    """

    def __init__(
        self, body: ExploringBody, camera: Camera, mount: CameraMount, actuator: ActuatorModel, radius_m: float,
        tell: Callable[[str], None] = lambda _text: None,
    ) -> None:
        self.map, self.floor, self.heading_rad, self.start_rad = AxisMap(), SeenFloor(radius_m), 0.0, 0.0
        self._body, self._camera, self._mount, self._actuator = body, camera, mount, actuator
        self._tell, self._floors = tell, list[FloorLooks]()
        self._given_up: list[Floats] = []
        self._turned_rad, self._moved_m = list[float](), list[float]()

    # -- the whole -------------------------------------------------------------------------------------------------

    def explore(self) -> None:
        """Until nothing is left to be known that can be reached, then home. Raises ExploringStopped."""
        while self.take_step():
            pass
        self.go_home()

    def _begin(self) -> None:
        views = self._look_round()
        self.start_rad = views[0].heading_rad if views else 0.0
        self._open_room("room-1", views)
        self._add_stand(np.zeros(2), np.zeros(2), views, "room-1")

    def take_step(self) -> bool:
        """Go for one thing that is not known; False where there is none."""
        if not self.map.stands:
            self._begin()
            return True
        goal = self._choose()
        if goal is None or len(self.map.stands) > MAX_STANDS:
            return False
        self._tell(f"{goal.words}, {goal.cost:.1f} m")
        if goal.door is not None:
            self._go_through(goal.door, goal.cell)
        elif self._go_to(goal.cell):
            self._add_stand(np.zeros(2), np.full(2, 0.006), self._look_round(), self.map.stands[-1].room)
        else:
            self._given_up.append(point_of(goal.cell))
        return True

    def go_home(self) -> bool:
        """To the start and to the heading there; whether it got there."""
        arrived = self._go_to(cell_of(self.map.position(0)))
        if arrived and float(np.hypot(*(self.map.position(0) - self.here))) > 0.02:
            self._drive(self.map.position(0))
        self._turn_to(self.start_rad)
        return arrived

    def summary(self, stopped: str = "") -> str:
        """What was found, in a few words."""
        rooms, doors = len(self.map.rooms), [door for door in self.map.doors if door.behind is not None]
        left = len(self.map.doors) - len(doors)
        unseen = f", {left} not gone through" if left else ""
        end = f"stopped: {stopped}" if stopped else f"home, {100.0 * np.hypot(*self.here):.0f} cm from the start"
        return f"{rooms} rooms, {len(doors)} doorways{unseen}, by {len(self.map.stands)} stands; {end}"

    @property
    def here(self) -> Floats:
        """(2,) where it stands [m]."""
        return self.map.position(len(self.map.stands) - 1)

    # -- looking ---------------------------------------------------------------------------------------------------

    def _see(self) -> AxisView | None:
        picture = self._body.look("explore")
        if isinstance(picture, BodyFault):
            raise ExploringStopped(f"the camera failed: {picture.what}")
        view = see_axes(picture.jpeg, self._camera, self._mount, self.heading_rad)
        if view is not None:
            self.heading_rad = view.heading_rad
        return view

    def _look_round(self) -> list[AxisView]:
        views = []
        for _ in range(LOOKS):
            views.append(self._see())
            self._command(2.0 * math.pi / LOOKS, 0.0)
        views.append(self._see())
        return [view for view in views if view is not None]

    def _add_stand(self, moved: Floats, sigma_m: Floats, views: list[AxisView], room: str) -> None:
        """A stand with what is seen there, read with all that is known."""
        n = self.map.add_stand(moved, sigma_m, views, room)
        self.map.read_walls(n, self._floors)
        self.map.read_uprights(n)
        if len(views) > 1:
            self._find_doors(room)
        self._see_floor()

    def _open_room(self, name: str, views: list[AxisView]) -> LearntRoom:
        """A room that is new: its floor looks as that nearest in the picture where it ends; a wall goes on upwards."""
        every = (view.polar[:, _near(view)].reshape(-1, 3) for view in views)
        near = [looks[np.isfinite(looks[:, 0])] for looks in every]
        best = max(near, key=lambda looks: _count_ends(looks, views), default=np.zeros((0, 3)))
        floor = self._learn_floor(best)
        if floor is None:
            raise ExploringStopped("the floor where it stands is not seen")
        room = self.map.rooms[name] = LearntRoom(name, floor)
        return room

    def _learn_floor(self, looks: Floats) -> FloorLooks | None:
        """The floor of which most of these looks (n, 3) are; the same one where it is known already."""
        if len(looks) < 200:
            return None
        fit = fit_appearance(looks, np.median(looks, axis=0), False)
        if fit is None:
            return None
        mean, covariance = fit
        for known in self._floors:
            step = known.mean - mean
            if step @ np.linalg.solve(known.covariance + covariance, step) < SAME_FLOOR:
                return known
        floor = FloorLooks(mean, 2.0 * covariance, _colour_of(mean))
        self._floors.append(floor)
        return floor

    def _find_doors(self, room: str) -> None:
        """Doorways of a room; those that are known already are found better."""
        self._find_other_floors(room)
        for side, low, high in self.map.find_doors(room, self._floors):
            self._note_door(room, side, (low, high))

    def _note_door(self, room: str, side: int, ends: tuple[float, float]) -> None:
        middle = 0.5 * (ends[0] + ends[1])
        wall = self.map.rooms[room].limit(side)
        for door in self.map.doors:
            if door.room == room and door.side == side and door.ends_m[0] < middle < door.ends_m[1]:
                door.ends_m = ends
                return
            other = self.map.rooms[door.room].limit(door.side)
            if door.room != room and door.side == (side + 2) % 4 and abs(other - wall) < 0.6 and (
                    door.ends_m[0] < middle < door.ends_m[1]):
                door.behind, door.far_ends_m = room, ends
                return
        point = np.full(2, middle)
        point[ACROSS[side]] = wall
        behind = self.map.room_at(point + 0.6 * np.array(OUTWARD[side]))
        self.map.doors.append(LearntDoor(room, side, ends, behind if behind != room else None))

    def _find_other_floors(self, room: str) -> None:
        """Behind pairs of tall uprights there may be floor of another look: it is alike all over, is not what is seen
        beside it, and ends below the horizon, as nothing does that stands."""
        for side in range(4):
            for low, high in self.map.find_gaps(room, side):
                looks = self.map.looks_behind(len(self.map.stands) - 1, side, low, high)
                if looks is not None:
                    self._learn_floor(looks)

    def _see_floor(self) -> None:
        """All floor that was seen, from where the stands are believed to be now."""
        self.floor.clear()
        last = None
        for n in range(len(self.map.stands)):
            here = self.map.position(n)
            self.floor.add_points(here + self.map.floor_points(n, self._floors))
            self.floor.add_way(here if last is None else last, here, 2.0 * DISC_M)
            last = here
        self.floor.add_way(self.map.position(0), self.map.position(0), 2.0 * self._blind_m)
        for room in self.map.rooms.values():
            for side in (side for side in range(4) if room.walls[side] is not None):
                begin, end = room.corners(side)
                self.floor.add_box(begin, end + WALL_M * np.array(OUTWARD[side]), False)
        for door in self.map.doors:
            begin, end = self._across_door(door, 0.0, DOORWAY_M)
            far, along = door.far_ends_m or door.ends_m, 1 - ACROSS[door.side]  # what both sides say is free
            begin[along], end[along] = max(door.ends_m[0], far[0]), min(door.ends_m[1], far[1])
            self.floor.add_box(begin, end, True)

    @property
    def _blind_m(self) -> float:
        """How far the nearest floor is that the picture shows [m]."""
        views = [view for view in self.map.stands[0].views if np.isfinite(view.polar).any()]
        return 0.15 + min(float(view.distances_m[np.isfinite(view.polar[..., 0]).any(axis=0)][0]) for view in views)

    def _across_door(self, door: LearntDoor, before_m: float, behind_m: float) -> tuple[Floats, Floats]:
        """A point before a doorway and one behind it."""
        middle = np.full(2, 0.5 * (door.ends_m[0] + door.ends_m[1]))
        middle[ACROSS[door.side]] = self.map.rooms[door.room].limit(door.side)
        out = np.array(OUTWARD[door.side])
        return middle - before_m * out, middle + behind_m * out

    # -- choosing --------------------------------------------------------------------------------------------------

    def _choose(self) -> ExploringGoal | None:
        costs, _ = self.floor.costs_from(self.here)
        goals = [*self._door_goals(costs), *self._room_goals(costs)]
        return min(goals, key=lambda goal: goal.cost) if goals else None

    def _door_goals(self, costs: dict[Cell, float]) -> list[ExploringGoal]:
        goals = []
        for door in self.map.doors:
            if door.behind is None and door.tried < 2:
                for before_m in (BEFORE_DOOR_M, 1.7, 1.5, 1.2, 0.9):
                    cell = near_cell(self._across_door(door, before_m, 0.0)[0], costs, 3)
                    if cell is not None:
                        goals.append(ExploringGoal(cell, costs[cell] + 3.0, door, f"a doorway of {door.room}"))
                        break
        return goals

    def _room_goals(self, costs: dict[Cell, float]) -> list[ExploringGoal]:
        goals, seen = [], self.floor.seen
        for room in self.map.rooms.values():
            x0, y0, x1, y1 = room.box
            (i0, j0), (i1, j1) = cell_of((x0 + 0.1, y0 + 0.1)), cell_of((x1 - 0.1, y1 - 0.1))
            unseen = np.argwhere(~seen[i0:i1, j0:j1]) + np.array([i0, j0])
            been = [self.map.position(n) for n, stand in enumerate(self.map.stands) if len(stand.views) >= LOOKS - 2]
            spots = [(i, j) for i, j in costs if i0 <= i < i1 and j0 <= j < j1 and i % 6 == j % 6 == 0]
            spots = [cell for cell in spots if not any(
                np.hypot(*(point_of(cell) - point)) < LOOKED_M for point in (*self._given_up, *been))]
            if not spots:
                continue
            enough = max(MIN_GAIN_M2, MIN_GAIN_SHARE * (x1 - x0) * (y1 - y0))
            unread = self.map.unread_walls(room.name, self._floors)
            gains = [_gain(cell, unseen) + UNREAD_M2 * _count_read(room, point_of(cell), unread) for cell in spots]
            best = max(range(len(spots)), key=lambda k: gains[k] - COST_PER_M2 * costs[spots[k]])
            if gains[best] > enough:
                goals.append(ExploringGoal(spots[best], costs[spots[best]], None, f"{room.name} is not seen whole"))
            for side in (side for side in range(4) if room.walls[side] is None):
                out = np.array(OUTWARD[side])
                far = max(spots, key=lambda cell: float(point_of(cell) @ out))
                if float((point_of(far) - self.here) @ out) > 0.8:
                    goals.append(ExploringGoal(far, costs[far] + 1.0, None, f"{room.name} goes on"))
        return goals

    # -- moving ----------------------------------------------------------------------------------------------------

    def _go_through(self, door: LearntDoor, front: Cell) -> None:
        """To before a doorway, look through, and into the room behind."""
        door.tried += 1
        if not self._go_to(front):
            return
        out = OUTWARD[door.side]
        facing = math.atan2(out[1], out[0])
        glances = []
        for aside in (0.0, GLANCE_RAD, -GLANCE_RAD):
            self._turn_to(facing + aside)
            glances.append(self._see())
        self._add_stand(np.zeros(2), np.full(2, 0.004), [view for view in glances if view is not None], door.room)
        before = len(self.map.stands) - 1
        costs, _ = self.floor.costs_from(self.here)
        for behind_m in (BEHIND_DOOR_M, 1.0, 0.8):
            inside = self._across_door(door, 0.0, behind_m)[1]
            cell = near_cell(inside, costs, 2)
            if cell is not None:
                break
        else:
            self._tell("  no floor is seen behind it")
            return
        door.behind = self.map.room_at(inside)
        if door.behind is not None or not self._go_to(cell):
            return
        views = self._look_round()
        name = f"room-{len(self.map.rooms) + 1}"
        room = self._open_room(name, views)
        door.behind = name
        near = self.map.rooms[door.room].limit(door.side)
        room.back = (door.side + 2) % 4, near + BETWEEN_WALLS_M * sum(out)
        self._add_stand(np.zeros(2), np.full(2, 0.006), views, name)
        self.map.read_through(before, name, self._floors)
        self._see_floor()
        self._tell(f"  {name}")

    def _go_to(self, cell: Cell) -> bool:
        """On floor that was seen, to a cell; whether it got there."""
        for _ in range(MAX_LEGS):
            costs, before = self.floor.costs_from(self.here)
            goal = near_cell(point_of(cell), costs, 3)
            if goal is None:
                return False
            if np.hypot(*(point_of(goal) - self.here)) < 0.12:
                return True
            legs = self.floor.way_to(goal, before)
            if not legs:
                return True
            self._drive(legs[0])
        return False

    def _drive(self, goal: Floats) -> None:
        """Turn to a point, and move towards it, as fast as what may be touched on the way allows."""
        step = goal - self.here
        distance, speed_m_per_s = choose_move(
            self.floor.find_clearance(self.here, goal), min(float(np.hypot(*step)), MAX_LEG_M), self._actuator,
            BORNE_M_PER_S, LEG_S)
        bend_per_m = sum(self._turned_rad) / max(sum(self._moved_m), 1.0)  # how the wheels drift, by what was driven
        self._turn_to(math.atan2(step[1], step[0]) - 0.5 * bend_per_m * distance)
        before_rad = self.heading_rad
        report = self._command(0.0, self._actuator.compute_command_m(distance), speed_m_per_s)
        moved_m = self._actuator.reach * report.move_m
        self.heading_rad = before_rad
        view = self._see()
        turned_rad = wrap_angle(self.heading_rad - before_rad)
        self._turned_rad.append(turned_rad)
        self._moved_m.append(moved_m)
        middle = before_rad + 0.5 * turned_rad
        c, s = math.cos(middle), math.sin(middle)
        along, aside = 0.004 * moved_m + 0.003, 0.004 + 0.003 * moved_m
        sigma = np.hypot([c * along, s * along], [s * aside, c * aside])
        here = self.here + moved_m * np.array([c, s])
        room = self.map.room_at(here) or self.map.stands[-1].room
        self._add_stand(moved_m * np.array([c, s]), sigma, [] if view is None else [view], room)

    def _turn_to(self, heading_rad: float) -> None:
        for _ in range(3):
            turn = wrap_angle(heading_rad - self.heading_rad)
            if abs(turn) < TURN_RAD:
                return
            self._command(turn, 0.0)
            self._see()

    def _command(self, turn_rad: float, move_m: float, speed_m_per_s: float | None = None) -> MotionReport:
        report = self._body.execute(MotorCommand(turn_rad, move_m, speed_m_per_s))
        if isinstance(report, BodyFault):
            raise ExploringStopped(f"the base failed: {report.what}")
        self.heading_rad = wrap_angle(self.heading_rad + report.turn_rad)
        if self._body.take_contact() is not None:
            raise ExploringStopped("something was touched")
        return report


def _near(view: AxisView) -> NDArray[np.bool_]:
    known = np.isfinite(view.polar[..., 0]).any(axis=0)
    return np.asarray(view.distances_m < view.distances_m[known][0] + NEAR_FLOOR_M)


def _count_ends(looks: Floats, views: Sequence[AxisView]) -> int:
    """In how many directions what has mostly these looks (n, 3) is nearest, and ends below the horizon."""
    fit = fit_appearance(looks, np.median(looks, axis=0), False) if len(looks) else None
    if fit is None:
        return 0
    floor, count = FloorLooks(fit[0], 2.0 * fit[1], np.zeros(3)), 0
    for view in views:
        like, known = floor.is_like(view.polar), np.isfinite(view.polar[..., 0])
        first = known.argmax(axis=1)
        count += int(np.count_nonzero(like[np.arange(len(like)), first] & ~like[:, -12:].any(axis=1)))
    return count


def _colour_of(mean: Floats) -> Floats:
    """The colour (3,) 0..255 whose looks these are."""
    total = math.exp(float(mean[0]))
    red, blue = (float(mean[k]) * total - 2.0 for k in (1, 2))
    return np.asarray(np.clip(np.array([red, total - 6.0 - red - blue, blue]), 0.0, 255.0))


def _gain(cell: Cell, unseen: NDArray[np.int64]) -> float:
    """How much floor that was not seen lies where it would be seen from a cell [m2]."""
    if not len(unseen):
        return 0.0
    away = np.hypot(*(unseen - cell).T) * CELL_M
    return float(np.count_nonzero((away > GAIN_M[0]) & (away < GAIN_M[1]))) * CELL_M**2


def _count_read(room: LearntRoom, point: Floats, unread: list[tuple[int, float]]) -> int:
    """How many pieces of walls would be seen straight enough from a point."""
    return sum(abs(along - point[1 - ACROSS[side]]) < READ_SLANT * abs(room.limit(side) - point[ACROSS[side]])
               for side, along in unread)
