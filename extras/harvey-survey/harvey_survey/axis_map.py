"""The map of a building while it is explored: stands, walls and uprights along two axes, all found together.

Headings come from the axes, picture by picture; then all that is measured is linear: the foot of a wall is so far from
a stand, an upright lies on its wall where a ray from a stand meets it, and wheels tell from stand to stand. Unknown are
two numbers a stand and one a wall and an upright, solved by reweighted least squares with their covariance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from harvey_survey.axis_view import AxisView, FloorLooks, Foot, Upright, is_floor
from world_models.building.geometry.outlines import subtract_intervals
from world_models.files.construction.rooms import CASING_WIDTH_M

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Key = tuple[str | int | float, ...]

OUTWARD = ((0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0))
"""From a room through its south, east, north and west wall."""
ACROSS, SIGN = (1, 0, 1, 0), (-1.0, 1.0, 1.0, -1.0)
"""Of each side: the axis across it, and whether it lies at the room's larger end of that."""
SAME_WALL_M = 0.12
"""Feet of walls so near to a wall that is known are of it."""
MIN_WALL_M = 0.5
"""So much of the foot of a wall must be seen."""
SAME_UPRIGHT_M, SHIFTS_M = 0.05, 0.2
"""Uprights so near on a wall are one; and by how much all of one stand may be shifted by the wheels' errors."""
MAX_SLANT = 2.5
"""Walls are read where they are seen under no larger tangent from their normal."""
BEYOND_M, BEYOND_SHARE = (0.3, 1.0), 0.75
"""Floor so far behind a wall, in such a share, says that it is open there."""
OPEN_GAP_M = 0.12
"""Rays that see floor behind a wall no further apart along it see one opening."""
PIECE_M, CORNER_M = 0.1, 0.35
"""Walls are read piece by piece, but for their ends."""
DOOR_M = (0.55, 2.2)
JAMB_LOW_M, JAMB_HIGH_M = 0.3, 1.5
"""A doorway ends at an upright that reaches from so low to so high."""
GAP_M, STEP_OVER_M = 0.12, 0.35
"""Of floor that is seen along a ray: what does not look like it, up to so long; and so long in a doorway."""
LOSS_SIGMAS, LOSS_STEPS = 2.5, 5
REACH_SIGMA = 0.012
"""Of what the wheels move for each metre that they count."""
SHADED_M = 0.09
"""So much of a doorway's width a jamb may hide. Its edge is told by the outer edge of the board round it, whose colour
differs from the wall's; the inner edges are of one colour."""
BEHIND_WALL_M = 0.35
"""The wall behind a doorway lies so near to the one before it."""
SAME_FAR_WALL_M = 0.04
"""Feet of walls seen through a doorway that are so near to a wall of the room behind are of it, beside their own
deviations."""


@dataclass(eq=False)
class Stand:
    """Where the robot stood: position (2,) as believed when it was made [m], its pictures, and the room."""

    position: Floats
    views: list[AxisView]
    room: str


@dataclass(eq=False)
class LearntDoor:
    """A doorway: of which room and wall, from where to where along it [m], and the room behind, once known."""

    room: str
    side: int
    ends_m: tuple[float, float]
    behind: str | None = None
    far_ends_m: tuple[float, float] | None = None
    tried: int = 0


@dataclass(eq=False)
class LearntRoom:
    """A room: its walls' offsets by side, None where none was seen yet; the looks of its floor.

    Attributes:
        reach: by side how far the walls beside were seen, where none ends the room yet.
        back: the side by which it was entered, and about where its wall must be.
    """

    name: str
    floor: FloorLooks
    walls: list[float | None] = field(default_factory=lambda: [None] * 4)
    reach: list[float] = field(default_factory=lambda: [0.0] * 4)
    height_m: float = 2.7
    back: tuple[int, float] | None = None

    def limit(self, side: int) -> float:
        """Where a wall is, or how far the room was seen there [m]."""
        wall = self.walls[side]
        return self.reach[side] if wall is None else wall

    @property
    def box(self) -> tuple[float, float, float, float]:
        """x from, y from, x to, y to."""
        return self.limit(3), self.limit(0), self.limit(1), self.limit(2)

    def corners(self, side: int) -> tuple[Floats, Floats]:
        """Both ends of a wall [m]."""
        begin, end = np.full(2, self.limit(side)), np.full(2, self.limit(side))
        begin[1 - ACROSS[side]], end[1 - ACROSS[side]] = self.span(side)
        return begin, end

    def span(self, side: int) -> tuple[float, float]:
        """From where to where a wall goes, along it."""
        x0, y0, x1, y1 = self.box
        return (x0, x1) if ACROSS[side] == 1 else (y0, y1)


@dataclass(frozen=True, slots=True)
class _Equation:
    terms: tuple[tuple[Key, float], ...]
    value: float
    sigma: float


class AxisMap:
    """All of it. Positions and offsets are in the axes' frame, with its origin at the first stand."""

    def __init__(self) -> None:
        self.stands: list[Stand] = []
        self.rooms: dict[str, LearntRoom] = {}
        self.doors: list[LearntDoor] = []
        self.values: dict[Key, float] = {}
        self.sigmas: dict[Key, float] = {}
        self.upright_ends: dict[Key, tuple[float, float]] = {}
        self._equations: list[_Equation] = []
        self._open: dict[int, tuple[tuple[float, ...], list[tuple[int, float, bool]]]] = {}
        self._points: dict[int, tuple[Key, Floats]] = {}

    # -- what is known ---------------------------------------------------------------------------------------------

    def position(self, stand: int) -> Floats:
        """(2,) where a stand is [m]."""
        return np.array([self.values["stand", stand, 0], self.values["stand", stand, 1]])

    def room_at(self, point: Floats) -> str | None:
        """The room in which a point lies."""
        boxes = {name: room.box for name, room in self.rooms.items()}
        return next((name for name, (x0, y0, x1, y1) in boxes.items()
                     if x0 <= point[0] <= x1 and y0 <= point[1] <= y1), None)

    def uprights_on(self, room: str, side: int) -> list[Key]:
        """Names of the uprights on a wall, by their place."""
        found = [key for key in self.values if key[:3] == ("upright", room, side)]
        return sorted(found, key=self.values.__getitem__)

    # -- what is added ---------------------------------------------------------------------------------------------

    def add_stand(self, moved: Floats, sigma_m: Floats, views: Sequence[AxisView], room: str) -> int:
        """A stand that the wheels put ``moved`` (2,) from the last one; returns its number.

        Args:
            moved: [m] were the wheels as they are believed to be: by how much more they move is found with all else.
            sigma_m: (2,) its deviations, without those of the wheels' measure.
        """
        n = len(self.stands)
        last = self.position(n - 1) if n else np.zeros(2)
        self.stands.append(Stand(last + moved, list(views), room))
        if not n:
            self.values["reach",] = 0.0
            self._equations.append(_Equation(((("reach",), 1.0),), 0.0, REACH_SIGMA))
        for axis in (0, 1):
            self.sigmas["stand", n, axis] = math.hypot(
                self.sigmas.get(("stand", n - 1, axis), 0.0), float(sigma_m[axis]), REACH_SIGMA * float(moved[axis]))
            self.values["stand", n, axis] = float(last[axis] + moved[axis] * (1.0 + self.values["reach",]))
            terms: tuple[tuple[Key, float], ...] = ((("stand", n, axis), 1.0),)
            if n:
                terms = (*terms, (("stand", n - 1, axis), -1.0), (("reach",), -float(moved[axis])))
            self._equations.append(_Equation(terms, float(moved[axis]), float(sigma_m[axis]) if n else 1e-4))
        return n

    def read_walls(self, stand: int, floors: Sequence[FloorLooks]) -> None:
        """Pair the feet of walls that a stand saw with the walls of its room, and make those that are not known yet."""
        s = self.stands[stand]
        room = self.rooms[s.room]
        feet = [foot for view in s.views for foot in view.find_feet(floors)]
        while (found := self._find_wall(room, stand, feet)) is not None:
            self.set_wall(room, *found)
        if room.back is not None and room.walls[room.back[0]] is None:
            self.set_wall(room, *room.back)
            self._equations.append(_Equation(((("wall", room.name, room.back[0]), 1.0),), room.back[1], 0.1))
        for side in range(4):
            self._grow_reach(room, side, stand, feet)
        rooms = [room, *(self.rooms[name] for name in self._beside(room.name))]
        for foot in feet:
            any(self._pair_foot(one, stand, foot, one is room) for one in rooms)
        self.solve()

    def read_through(self, stand: int, room: str, floors: Sequence[FloorLooks]) -> None:
        """Pair the feet of walls that a stand saw through a doorway with those of the room behind, known since."""
        for foot in (foot for view in self.stands[stand].views for foot in view.find_feet(floors)):
            self._pair_foot(self.rooms[room], stand, foot, False)
        self.solve()

    def list_ways(self, room: str) -> list[tuple[int, tuple[float, float]]]:
        """The doorways of a room: side, and from where to where along the wall."""
        own = [(door.side, door.ends_m) for door in self.doors if door.room == room]
        return [*own, *(((door.side + 2) % 4, door.far_ends_m or door.ends_m) for door in self.doors
                        if door.behind == room)]

    def _beside(self, room: str) -> list[str]:
        """The rooms behind the doorways of a room."""
        found = [door.behind for door in self.doors if door.room == room and door.behind is not None]
        return [*found, *(door.room for door in self.doors if door.behind == room)]

    def _pair_foot(self, room: LearntRoom, stand: int, foot: Foot, is_own: bool) -> bool:
        axis, wall = ACROSS[foot.side], room.walls[foot.side]
        here = self.position(stand)
        if wall is None:
            return False
        near = SAME_WALL_M if is_own else SAME_FAR_WALL_M + 2.0 * (foot.sigma_m + abs(
            self.sigmas["stand", stand, axis] - self.sigmas.get(("wall", room.name, foot.side), 0.0)))
        (low, high), ends = room.span(foot.side), (here[1 - axis] + foot.low_m, here[1 - axis] + foot.high_m)
        first, last = ends if is_own else ends[::-1]  # of its own wall a part, of another the whole
        if abs(here[axis] + foot.off_m - wall) > near or last < low - 0.1 or first > high + 0.1:
            return False
        self.measure_wall(stand, room.name, foot.side, foot.off_m, foot.sigma_m)
        return True

    def measure_wall(self, stand: int, room: str, side: int, off_m: float, sigma_m: float) -> None:
        """A wall is so far from a stand, along its axis [m]."""
        terms: tuple[tuple[Key, float], ...] = (
            (("wall", room, side), 1.0), (("stand", stand, ACROSS[side]), -1.0))
        self._equations.append(_Equation(terms, off_m, sigma_m))

    def _grow_reach(self, room: LearntRoom, side: int, stand: int, feet: Sequence[Foot]) -> None:
        """How far the walls beside are seen in a direction: where no wall ends the room yet, it goes so far."""
        axis, sign = ACROSS[side], SIGN[side]
        here = self.position(stand)
        far = [here[axis] + sign * 0.5]
        for foot in feet:
            wall = room.walls[foot.side]
            if foot.side % 2 != side % 2 and wall is not None and (
                    abs(here[1 - axis] + foot.off_m - wall) < SAME_WALL_M):
                far += [here[axis] + foot.low_m, here[axis] + foot.high_m]
        best = max(far, key=lambda m: sign * m)
        known = room.reach[side]
        room.reach[side] = best if known == 0.0 or sign * best > sign * known else known

    def _find_wall(self, room: LearntRoom, stand: int, feet: Sequence[Foot]) -> tuple[int, float] | None:
        """Of the sides where no wall is known, that of whose wall most is seen, between the walls that are known."""
        here = self.position(stand)
        best, most = None, 0.0
        for side in (side for side in range(4) if room.walls[side] is None):
            axis, sign = ACROSS[side], SIGN[side]
            ends = [room.walls[other] for other in ((3, 1) if axis == 1 else (0, 2))]
            low = -math.inf if ends[0] is None else ends[0] - 0.1
            high = math.inf if ends[1] is None else ends[1] + 0.1
            rows = []
            for foot in (foot for foot in feet if foot.side == side):
                along = float(here[1 - axis]) + foot.low_m, float(here[1 - axis]) + foot.high_m
                at = float(here[axis]) + foot.off_m
                if room.back is not None and room.back[0] == side and abs(at - room.back[1]) > BEHIND_WALL_M:
                    continue
                if low <= along[0] and along[1] <= high and sign * foot.off_m > 0.0:
                    rows.append((at, along))
            for offset, _ in rows:
                near = [(at, along) for at, along in rows if abs(at - offset) < 0.04]
                if _measure_union([along for _, along in near]) < MIN_WALL_M:
                    continue
                away, middle = abs(offset - here[axis]), here[1 - axis]  # what is far and long is seen as short
                bearings = [np.arctan2(np.array(along) - middle, away).tolist() for _, along in near]
                covered = _measure_union([(first, last) for first, last in bearings])
                if covered > most:
                    best, most = (side, float(np.median([at for at, _ in near]))), covered
        return best

    def set_wall(self, room: LearntRoom, side: int, offset_m: float) -> None:
        """A wall where none was known."""
        room.walls[side] = offset_m
        self.values["wall", room.name, side] = offset_m

    def read_uprights(self, stand: int) -> None:
        """Pair the uprights that a stand saw with those on its room's walls, and make those that are not known yet."""
        s = self.stands[stand]
        room = self.rooms[s.room]
        met = [(view, upright, meet_wall(room, self.position(stand) + view.forward_m, upright.bearing_rad))
               for view in s.views for upright in view.uprights]
        found = [(view, upright, *wall) for view, upright, wall in met
                 if wall[0] >= 0 and abs(wall[2]) < MAX_SLANT and room.walls[wall[0]] is not None]
        shift = [self._find_shift(room.name, [(side, along) for _, _, side, along, *_ in found if ACROSS[side] != axis],
                                  self.sigmas["stand", stand, axis]) for axis in (0, 1)]
        for view, upright, side, along, slant, far in found:
            self._pair_upright(room, stand, view, upright, side, along + shift[1 - ACROSS[side]], slant, far)
        self.solve()

    def _find_shift(self, room: str, places: Sequence[tuple[int, float]], sigma_m: float) -> float:
        """By how much all uprights of a stand are to be shifted along an axis, to lie on those that are known.

        ``sigma_m`` is the stand's deviation along it.
        """
        best, most, far = 0.0, 0.0, min(SHIFTS_M, 3.0 * sigma_m)
        known = {side: np.array([self.values[key] for key in self.uprights_on(room, side)]) for side in range(4)}
        for shift in sorted(np.arange(-0.01 * (far // 0.01), far + 0.001, 0.01), key=abs):
            score = 0.0
            for side, along in places:
                if len(known[side]):
                    score += max(0.0, 1.0 - (float(np.abs(known[side] - along - shift).min()) / 0.03) ** 2)
            score -= 0.5 * (float(shift) / sigma_m) ** 2
            if score > most + 0.5:
                best, most = float(shift), score
        return best

    def _pair_upright(
        self, room: LearntRoom, stand: int, view: AxisView, upright: Upright, side: int, along: float, slant: float,
        far: float,
    ) -> None:
        low, high = room.span(side)
        if not low + 0.04 < along < high - 0.04 or any(
                door.room == room.name and door.side == side and door.ends_m[0] + 0.04 < along < door.ends_m[1] - 0.04
                for door in self.doors):
            return
        axis = ACROSS[side]
        ends = view.mount.height_m + far * upright.lower, view.mount.height_m + far * upright.upper
        near = [key for key in self.uprights_on(room.name, side) if abs(self.values[key] - along) < SAME_UPRIGHT_M]
        if near:
            key = min(near, key=lambda one: abs(self.values[one] - along))
            before = self.upright_ends[key]
            ends = min(before[0], ends[0]), max(before[1], ends[1])
        else:
            key = "upright", room.name, side, sum(one[:3] == ("upright", room.name, side) for one in self.values)
            self.values[key] = along
        self.upright_ends[key] = ends
        forward = view.forward_m
        terms: tuple[tuple[Key, float], ...] = (
            (key, 1.0), (("stand", stand, 1 - axis), -1.0), (("wall", room.name, side), -slant),
            (("stand", stand, axis), slant))
        sigma = math.hypot(far * math.hypot(1.0, slant) * upright.sigma_rad, 0.004)
        self._equations.append(_Equation(terms, float(forward[1 - axis] - slant * forward[axis]), sigma))

    # -- all together ----------------------------------------------------------------------------------------------

    def solve(self) -> None:
        """Find all unknowns by all equations, with a loss that forgets wrong pairs; take walls over into the rooms."""
        index = {name: i for i, name in enumerate(sorted(self.values, key=lambda name: name[0] == "upright"))}
        few = sum(name[0] != "upright" for name in index)
        rows = [(r, index[name], factor) for r, e in enumerate(self._equations) for name, factor in e.terms]
        slopes = csr_array(([f for *_, f in rows], ([r for r, *_ in rows], [i for _, i, _ in rows])),
                           shape=(len(self._equations), len(index))).tocsc()
        value, sigma = np.array([(e.value, e.sigma) for e in self._equations]).T
        state = np.array([self.values[name] for name in index])
        for _ in range(LOSS_STEPS):
            left = value - slopes @ state
            weight = 1.0 / (1.0 + (left / sigma / LOSS_SIGMAS) ** 2) / sigma**2
            squares, pull = (slopes.T @ (slopes * weight[:, None])).tocsr(), slopes.T @ (weight * left)
            own = squares.diagonal()[few:]  # uprights are eliminated, each alone
            joined = squares[few:, :few].toarray() / own[:, None]
            reduced = squares[:few, :few].toarray() - joined.T @ (own[:, None] * joined) + 1e-9 * np.eye(few)
            covariance = np.linalg.inv(reduced)
            step = covariance @ (pull[:few] - joined.T @ pull[few:])
            state = state + np.concatenate([step, pull[few:] / own - joined @ step])
        self.values.update(zip(index, state.tolist(), strict=True))
        self.sigmas.update(zip(list(index)[:few], np.sqrt(covariance.diagonal()).tolist(), strict=True))
        for room in self.rooms.values():
            room.walls = [self.values.get(("wall", room.name, side)) for side in range(4)]

    # -- what is open ----------------------------------------------------------------------------------------------

    def see_open(self, stand: int, floors: Sequence[FloorLooks]) -> list[tuple[int, float, bool]]:
        """Of each ray that meets a wall of the stand's room: side, where along it, and whether floor is seen behind."""
        s = self.stands[stand]
        room = self.rooms[s.room]
        key = (len(floors), *np.round(room.box, 2), *np.round(self.position(stand), 2))
        if self._open.get(stand, (None, []))[0] == key:
            return self._open[stand][1]
        found = [(side, along, bool(is_floor(looks, floors).mean() >= BEYOND_SHARE))
                 for side, along, looks, _ in self._look_behind(stand, MAX_SLANT) if len(looks) >= 4]
        self._open[stand] = key, found
        return found

    def _look_behind(self, stand: int, max_slant: float) -> Iterator[tuple[int, float, Floats, Floats]]:
        """Of each ray that meets a wall of the stand's room: side, where along it, and the looks (n, 3) of what would
        be floor just behind it, and further."""
        room = self.rooms[self.stands[stand].room]
        for view in self.stands[stand].views:
            eye = self.position(stand) + view.forward_m
            known = np.isfinite(view.polar[..., 0])
            for i, bearing in enumerate(view.bearings.tolist()):
                side, along, slant, far = meet_wall(room, eye, bearing)
                if side >= 0 and room.walls[side] is not None and abs(slant) <= max_slant:
                    near = abs(room.limit(side) - eye[ACROSS[side]])
                    first, last = (far * (near + m) / near for m in BEYOND_M)
                    rows = known[i] & (view.distances_m >= first) & (view.distances_m <= last)
                    yield side, along, view.polar[i, rows], view.polar[i, known[i] & (view.distances_m > last)]

    def _rays_of(self, room: str, floors: Sequence[FloorLooks]) -> list[tuple[int, float, bool]]:
        return [ray for n, stand in enumerate(self.stands) if stand.room == room for ray in self.see_open(n, floors)]

    def unread_walls(self, room_name: str, floors: Sequence[FloorLooks]) -> list[tuple[int, float]]:
        """Pieces of a room's walls of which no stand says whether they are open: side, and place along it [m]."""
        room = self.rooms[room_name]
        rays = self._rays_of(room_name, floors)
        unread: list[tuple[int, float]] = []
        for side in (side for side in range(4) if room.walls[side] is not None):
            low, high = room.span(side)
            places = np.arange(low + CORNER_M, high - CORNER_M, PIECE_M)
            read = [along for met, along, _ in rays if met == side]
            away = np.abs(np.subtract.outer(places, read)).min(axis=1, initial=math.inf)
            unread += [(side, float(at)) for at in places[away > PIECE_M]]
        return unread

    def find_doors(self, room_name: str, floors: Sequence[FloorLooks]) -> list[tuple[int, float, float]]:
        """Doorways of a room: side, and from where to where along it, by all stands in it."""
        room = self.rooms[room_name]
        rays = self._rays_of(room_name, floors)
        doors = []
        for side in range(4):
            low, high = room.span(side)
            read = np.sort([along for met, along, is_open in rays if met == side and is_open and low <= along <= high])
            for part in np.split(read, np.flatnonzero(np.diff(read) > OPEN_GAP_M) + 1):
                if not len(part) or part[-1] - part[0] < 0.25:
                    continue
                snapped = self._snap(room_name, side, (float(part[0]), float(part[-1])))
                if snapped is not None and DOOR_M[0] < snapped[1] - snapped[0] < DOOR_M[1]:
                    doors.append((side, *snapped))
        return doors

    def find_gaps(self, room: str, side: int) -> list[tuple[float, float]]:
        """Pairs of neighbouring tall uprights as far apart as the jambs of a doorway."""
        return [(a, b) for a, b in pairwise(self._find_tall(room, side)) if DOOR_M[0] < b - a < DOOR_M[1]]

    def _find_tall(self, room: str, side: int) -> list[float]:
        """Where uprights are that may be jambs."""
        return [self.values[key] for key in self.uprights_on(room, side)
                if self.upright_ends[key][0] < JAMB_LOW_M and self.upright_ends[key][1] > JAMB_HIGH_M]

    def looks_behind(self, stand: int, side: int, low_m: float, high_m: float) -> Floats | None:
        """Looks (n, 3) of what may be floor behind a wall, between two uprights; None where it cannot be.

        It is alike all over, is not what is seen beside the uprights, and ends below the horizon.
        """
        rays = [ray[1:] for ray in self._look_behind(stand, 1.5) if ray[0] == side]
        inside = [behind for along, behind, _ in rays if low_m + 0.15 < along < high_m - 0.15]
        rest = [further for along, _, further in rays if low_m + 0.15 < along < high_m - 0.15]
        outside = [behind for along, behind, _ in rays
                   if low_m - 0.6 < along < low_m - 0.15 or high_m + 0.15 < along < high_m + 0.6]
        if len(inside) < 5 or not outside or sum(map(len, outside)) < 20 or sum(map(len, inside)) < 200:
            return None
        looks = np.concatenate(inside)
        wide = np.diag([0.07**2, 0.008**2, 0.008**2])
        floor = FloorLooks(np.median(looks, axis=0), wide, np.zeros(3))
        if floor.is_like(looks).mean() < 0.85 or floor.is_like(np.concatenate(outside)).mean() > 0.3:
            return None
        ends = np.mean([len(row) > 0 and not floor.is_like(row)[-12:].any() for row in rest])
        return looks if ends > 0.7 else None

    def _snap(self, room: str, side: int, ends: tuple[float, float]) -> tuple[float, float] | None:
        """Where a doorway ends, by the tall uprights outside of where floor is seen behind: the boards round it."""
        tall = self._find_tall(room, side)
        left = [x for x in tall if ends[0] - 0.4 < x < ends[0] + 0.06]
        right = [x for x in tall if ends[1] - 0.06 < x < ends[1] + 0.4]
        if not left or not right:
            return None
        low = [x for x in left if x > ends[0] - CASING_WIDTH_M - SHADED_M]
        high = [x for x in right if x < ends[1] + CASING_WIDTH_M + SHADED_M]
        return (min(low) + CASING_WIDTH_M if low else max(left)), (max(high) - CASING_WIDTH_M if high else min(right))

    # -- floor that was seen ---------------------------------------------------------------------------------------

    def floor_points(self, stand: int, floors: Sequence[FloorLooks]) -> Floats:
        """(n, 2) points of the floor that a stand saw, up to the walls and through doorways, from the stand [m]."""
        s = self.stands[stand]
        room = self.rooms[s.room]
        here, points = self.position(stand), []
        ways = self.list_ways(s.room)
        key: Key = (len(floors), *np.round([*room.box, *here, *(m for _, ends in ways for m in ends)], 2).tolist())
        if stand in self._points and self._points[stand][0] == key:
            return self._points[stand][1]
        for view in s.views:
            eye = here + view.forward_m
            met = [meet_wall(room, eye, bearing) for bearing in view.bearings.tolist()]
            through = np.array([side >= 0 and any(w == side and e[0] < along < e[1] for w, e in ways)
                                for side, along, _, _ in met])
            walls_m = np.array([far for *_, far in met])
            reach = _run_of_floor(view.distances_m, is_floor(view.polar, floors), np.isfinite(view.polar[..., 0]),
                                  walls_m, through)
            rows, columns = np.nonzero(np.isfinite(view.polar[..., 0]) & (view.distances_m <= reach[:, None]))
            d, bearing = view.distances_m[columns], view.bearings[rows]
            points.append(view.forward_m + d[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1))
        self._points[stand] = key, np.concatenate(points) if points else np.zeros((0, 2))
        return self._points[stand][1]


def meet_wall(room: LearntRoom, eye: Floats, bearing_rad: float) -> tuple[int, float, float, float]:
    """Where a ray from inside a room meets its walls: side, place along it, tangent from its normal, distance [m].

    Side -1 where it starts outside.
    """
    c, s = math.cos(bearing_rad), math.sin(bearing_rad)
    x0, y0, x1, y1 = room.box
    if not (x0 < eye[0] < x1 and y0 < eye[1] < y1):
        return -1, 0.0, 0.0, 0.0
    far_x = ((x1 if c > 0.0 else x0) - eye[0]) / c if abs(c) > 1e-9 else math.inf
    far_y = ((y1 if s > 0.0 else y0) - eye[1]) / s if abs(s) > 1e-9 else math.inf
    if far_x < far_y:
        return (1 if c > 0.0 else 3), float(eye[1] + far_x * s), s / c, float(far_x)
    return (2 if s > 0.0 else 0), float(eye[0] + far_y * c), c / s, float(far_y)


def _run_of_floor(distances_m: Floats, like: Mask, known: Mask, walls_m: Floats, through: Mask) -> Floats:
    """(b,) how far floor is seen in each direction from the nearest that is in the picture [m]; 0 where none is.

    ``like``, ``known`` (b, d): what looks like floor, and what is in the picture; ``walls_m`` (b,) where the room's
    wall is, ``through`` (b,) where there is a doorway in it.
    """
    nearest = np.where(known, distances_m, np.inf).min(axis=1)
    good = np.where(known & like, distances_m, 0.0)
    last = np.maximum(np.maximum.accumulate(good, axis=1), nearest[:, None] - GAP_M)
    beyond = walls_m[:, None]
    at_sill = through[:, None] & (last >= beyond - 0.1) & (last <= beyond + 0.3)
    ended = known & (distances_m - last > np.where(at_sill, STEP_OVER_M, GAP_M))
    ended |= ~through[:, None] & (distances_m > beyond)
    first = np.where(ended.any(axis=1), ended.argmax(axis=1), len(distances_m) - 1)
    reach = np.maximum.accumulate(good, axis=1)[np.arange(len(first)), first]
    return np.asarray(np.where(through, reach, np.minimum(reach, walls_m)))


def _measure_union(intervals: Sequence[tuple[float, float]]) -> float:
    ends = min(low for low, _ in intervals), max(high for _, high in intervals)
    return ends[1] - ends[0] - math.fsum(b - a for a, b in subtract_intervals(ends, intervals, 0.0))
