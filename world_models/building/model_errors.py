"""How well the model knows where things are: the errors of its lines, and which of them are shared.

A world file may state a standard deviation (``sigma_cm``) for all of it, a locale, a door or a thing. What is built
together is wrong together, so the errors are not one a line but one a *mode*: a wall is displaced along its normal with
all that is on it, the two sides of a wall with a door as one; a door along its wall, with the ends that it cuts the
wall's lines to; a thing along and up its wall, or on the floor in both directions. The modes are independent and
normal. No model is exact: one of which nothing is stated counts as measured, and what is found to be displaced by more
says so itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # an explanation reads journals, and needs no building
    from world_models.building.building import Building
    from world_models.building.geometry.landmarks import Landmark
    from world_models.building.locales import Doorway

Floats = NDArray[np.float64]

SIGMA, SIGMAS = "sigma_m", "sigmas_m"
"""Properties of a locale: the deviation of all that is in it [m], and by name those of its doors and things."""
WALL_DEPTH_M = 0.15
"""What lies no further than this from the plane of a wall is on it [m]."""
MIN_LIFT_M = 0.3
"""Things on a wall that begin lower stand on the floor: their height is known [m]."""
WALL = " wall "
"""Between the name of a room and the number of its wall, in the name of a mode."""
BETWEEN = " from wall "
"""The same in the name of what is between two walls that face each other."""
ALONG = " along"
"""Ends the name of a mode of what is displaced along its wall; a door's begins with its name, a thing's with its room.
"""
JAMB_M = 0.2
"""What of a wall lies whole within this of a jamb ends at the door, and is displaced with it [m]."""
MEASURED_M = 0.01
"""Deviation of a model of which nothing is stated: as of what is measured by hand with a tape [m]."""
INEXACT_M = 0.05
"""Deviation of a model that is found to be inexact: as of a plan that was traced [m]."""
PARALLEL = 0.999
"""Cosine between the normals of walls that face each other."""
BOARDS_M, TOUCHING_M = 0.11, 0.01
"""What stands before a wall by less is on it; and what ends at its ends reaches them within this [m]."""
MAX_MARKS = 4096
"""Landmarks whose modes are kept."""


@dataclass(frozen=True, eq=False, slots=True)
class LineErrors:
    """The errors of n model lines.

    Attributes:
        displacement_modes: k names, of walls, doors and things.
        displacements: (k, n, 3) by how much one standard deviation of each mode displaces each line [m, world].
    """

    displacement_modes: tuple[str, ...]
    displacements: Floats

    @property
    def is_exact(self) -> bool:
        """Whether its lines are where the model says, to what can be measured."""
        return not np.any(np.linalg.norm(self.displacements, axis=2) > 1.001 * MEASURED_M)

    def restate(self, sigma_m: float) -> LineErrors:
        """The same modes, each with this deviation [m]."""
        sizes = np.linalg.norm(self.displacements, axis=2).max(axis=1, initial=1e-12)
        return LineErrors(self.displacement_modes, sigma_m * self.displacements / sizes[:, None, None])

    def restate_doors(self, sigma_m: float) -> LineErrors:
        """The same modes, those of doors along their walls with this deviation [m]."""
        is_door = [mode.endswith(ALONG) and "/" not in mode for mode in self.displacement_modes]
        doors = self.restate(sigma_m).displacements
        return LineErrors(self.displacement_modes, np.where(np.reshape(is_door, (-1, 1, 1)), doors, self.displacements))

    def take(self, lines: Sequence[int] | NDArray[np.int64]) -> LineErrors:
        """Those of some of the lines, which may be repeated."""
        return LineErrors(self.displacement_modes, self.displacements[:, np.asarray(lines, np.int64)])

    def list_walls(self) -> list[tuple[str, Floats]]:
        """Each wall that is seen, by name, with how far each line (n, 3) goes with one metre along its normal [m]."""
        metres = self.restate(1.0).displacements
        return [(mode, metres[k]) for k, mode in enumerate(self.displacement_modes) if WALL in mode and metres[k].any()]

    def displace(self, lines_world: Floats, amplitudes: Floats) -> Floats:
        """The lines (n, 2, 3) displaced by the modes with amplitudes (k,), in standard deviations."""
        return np.asarray(lines_world + np.tensordot(amplitudes, self.displacements, axes=1)[:, None])


def exact(count: int) -> LineErrors:
    """Of lines that are where the model says."""
    return LineErrors((), np.zeros((0, count, 3)))


def pack_errors(errors: LineErrors) -> tuple[tuple[float, ...], ...]:
    """The shifts that are not zero, as (mode, line, x, y, z)."""
    return tuple((float(k), float(i), *errors.displacements[k, i].tolist())
                 for k, i in np.argwhere(np.any(errors.displacements != 0.0, axis=2)).tolist())


def unpack_errors(modes: tuple[str, ...], packed: Sequence[Sequence[float]], count: int) -> LineErrors:
    """The inverse of :func:`pack_errors`, for ``count`` lines."""
    shifts = np.zeros((len(modes), count, 3))
    for k, i, *by_m in packed:
        shifts[int(k), int(i)] = by_m
    return LineErrors(modes, shifts)


def find_line_errors(
    building: Building, marks: Sequence[Landmark], line: Sequence[int], unstated_m: float = 0.0
) -> LineErrors:
    """The errors of n model lines, as far as the world file states them, or it was found that they are inexact.

    Args:
        marks: the landmark of each line. line: its number in the landmark.
        unstated_m: the deviation of what nothing is stated of.
    """
    rows: dict[str, Floats] = {}
    modes = {mark: _find_modes(building, mark, unstated_m) for mark in dict.fromkeys(marks)}
    for i, (mark, number) in enumerate(zip(marks, line, strict=True)):
        for name, shifts in modes[mark].items():
            if np.any(shifts[number]):
                rows.setdefault(name, np.zeros((len(marks), 3)))[i] = shifts[number]
    return LineErrors(tuple(rows), np.array(list(rows.values()), float).reshape(len(rows), len(marks), 3))


def find_sigma_m(building: Building, locale: str, name: str = "") -> float:
    """The stated deviation of a door or thing of a locale, or else of what is in it; 0 where nothing is stated.

    Where the whole building was found to be inexact, it is no less than that; nor than how well is known what was found
    to stand beside: a door, or a wall by the name of its mode.
    """
    properties = building.locale(locale).properties
    sigmas: Mapping[str, float] = properties.get(SIGMAS, {})
    found_m = INEXACT_M * building.root_frame().is_inexact
    changes = building.frame(locale).changes
    beside = (change.sigma_m for change in changes if (change.what, change.name) == ("beside", name))
    return float(max(sigmas.get(name, properties.get(SIGMA, 0.0)), found_m, *beside))


def _find_modes(building: Building, mark: Landmark, unstated_m: float) -> Mapping[str, Floats]:
    """For each mode of a landmark, by name, the displacement (lines, 3) of its lines [m, world]."""
    own_m, walls_m = (find_sigma_m(building, mark.locale, name) or unstated_m for name in (mark.name, ""))
    is_redrawn = any(change.what == "beside" for change in building.frame(mark.locale).changes)
    if not own_m and not walls_m and not is_redrawn:
        return {}
    return building.cached("model errors", MAX_MARKS, (mark.name, unstated_m),
                           lambda: _compute_modes(building, mark, own_m, walls_m, unstated_m))


def _compute_modes(
    building: Building, mark: Landmark, own_m: float, walls_m: float, unstated_m: float
) -> dict[str, Floats]:
    walls, origins, inward = _list_walls(building, mark.locale)
    sigmas = [find_sigma_m(building, mark.locale, name) or walls_m for name, _ in walls]
    lines, doors = mark.lines_world, {door.name: door for door in building.doorways_of(mark.locale)}
    flat = lines[..., :2]
    off_m = np.einsum("nei,wi->wne", flat, inward) - np.sum(origins * inward, axis=1)[:, None, None]
    if mark.kind == "wall":
        near = np.abs(off_m).max(axis=2) <= WALL_DEPTH_M
        found = {walls[w][0]: sigmas[w] * near[w][:, None] * walls[w][1] for w in np.flatnonzero(near.any(axis=1))}
        for door in doors.values():
            jambs = door.threshold_of(mark.locale)
            cut = np.linalg.norm(flat[:, None] - jambs[:, None], axis=3).max(axis=2).min(axis=1) <= JAMB_M
            if np.any(cut):
                door_m = find_sigma_m(building, mark.locale, door.name) or unstated_m
                found[f"{door.name}{ALONG}"] = door_m * cut[:, None] * _find_along(door)
        return found
    thing = next((t for t in building.things_of(mark.locale) if t.name == mark.name), None)
    if thing is not None and thing.protrusion_m is None:
        return {f"{mark.name} {axis}": own_m * _same(lines, direction)
                for axis, direction in (("x", (1.0, 0.0, 0.0)), ("y", (0.0, 1.0, 0.0)))}
    wall = int(np.argmin(np.abs(off_m).mean(axis=(1, 2)) + 10.0 * _miss_wall(flat, origins, inward)))
    along = _find_along(doors[mark.name]) if mark.name in doors else (inward[wall, 1], -inward[wall, 0], 0.0)
    found = {walls[wall][0]: sigmas[wall] * _same(lines, walls[wall][1]),
             f"{mark.name}{ALONG}": own_m * _same(lines, along)}
    if thing is not None and thing.low_m >= MIN_LIFT_M:
        found[f"{mark.name} up"] = own_m * _same(lines, (0.0, 0.0, 1.0))
    return found


class Side(NamedTuple):
    """A wall of a room, as one of two that face each other.

    Attributes:
        mode: its name as a mode: that of the room on whose side it is longer.
        outward: (3,) unit normal out of the room that is asked about; inward: into the one of its mode [world].
        corners: (4, 2) the floor that it takes with the boards on both its sides, counter-clockwise [m, world].
        rooms: whose wall it is: that of its mode, and those to which doors in it lead.
    """

    mode: str
    outward: Floats
    inward: Floats
    corners: tuple[tuple[float, float], ...]
    rooms: tuple[str, ...]


def list_facing(building: Building, locale: str) -> Mapping[str, tuple[Side, Side]]:
    """The walls of a room that face each other, in pairs, by the name of what is between them."""
    walls, origins, inward = _list_walls(building, locale)
    lengths = np.linalg.norm(np.roll(origins, -1, axis=0) - origins, axis=1)
    found = {}
    for i, k in combinations(range(len(walls)), 2):
        along = np.array([inward[i, 1], -inward[i, 0]])
        ends = np.sort([(origins[k] - origins[i]) @ along, (origins[(k + 1) % len(walls)] - origins[i]) @ along])
        shared_m = min(ends[1], lengths[i]) - max(ends[0], 0.0)
        if inward[i] @ inward[k] < -PARALLEL and (origins[k] - origins[i]) @ inward[i] > 0.0 and shared_m > 0.0:
            sides = [_build_side(building, walls[w][0], inward[w]) for w in (i, k)]
            found[f"{locale}{BETWEEN}{i} to wall {k}"] = sides[0], sides[1]
    return found


def find_facing(building: Building, between: str) -> tuple[Side, Side]:
    """The two walls of such a name. Raises KeyError where there are none."""
    return list_facing(building, between.partition(BETWEEN)[0])[between]


def measure_between(sides: tuple[Side, Side]) -> float:
    """How far apart the middles of two walls are that face each other [m]."""
    one, other = (np.mean(side.corners, axis=0) for side in sides)
    return float(abs((other - one) @ sides[0].outward[:2]))


def _build_side(building: Building, mode: str, into: Floats) -> Side:
    locale, _, number = mode.rpartition(WALL)
    start, inward, length_m = (one[int(number)] for one in _measure_walls(building.outline(locale)))
    along = np.array([inward[1], -inward[0]])
    doors: list[Doorway] = []
    for door in building.doorways_of(locale):
        at = door.threshold_of(locale).mean(axis=0) - start
        if abs(at @ inward) <= WALL_DEPTH_M and 0.0 <= at @ along <= length_m:
            doors.append(door)
    back_m = BOARDS_M + max((door.depth_m for door in doors), default=0.0)
    a, b = start - TOUCHING_M * along, start + (length_m + TOUCHING_M) * along
    corners = [a - back_m * inward, b - back_m * inward, b + BOARDS_M * inward, a + BOARDS_M * inward]
    return Side(mode, _level(-into), _level(inward), tuple((float(x), float(y)) for x, y in corners),
                (locale, *(door.other(locale) for door in doors)))


def _list_walls(building: Building, locale: str) -> tuple[list[tuple[str, Floats]], Floats, Floats]:
    """Mode and its direction (3,) of each wall of a room, starts (w, 2) and unit normals into it (w, 2) [m, world].

    The two sides of a wall with a door are one, named after the longer side.
    """
    origins, inward, lengths = _measure_walls(building.outline(locale))
    walls = [(f"{locale}{WALL}{i}", _level(inward[i])) for i in range(len(origins))]
    for door in building.doorways_of(locale):
        other = door.other(locale)
        theirs, into, long = _measure_walls(building.outline(other))
        i, k = (int(np.argmin(np.abs(np.sum((door.threshold_of(room).mean(axis=0) - starts) * normals, axis=1))
                              + 10.0 * _miss_wall(door.threshold_of(room), starts, normals)))
                for room, starts, normals in ((locale, origins, inward), (other, theirs, into)))
        if (long[k], other) > (lengths[i], locale):
            walls[i] = f"{other}{WALL}{k}", _level(into[k])
    return walls, origins, inward


def _measure_walls(outline: Floats) -> tuple[Floats, Floats, Floats]:
    """Starts (w, 2), unit normals into the room (w, 2) and lengths (w,) of the walls of an outline [m, world]."""
    along = np.roll(outline, -1, axis=0) - outline
    lengths = np.linalg.norm(along, axis=1)
    return outline, np.column_stack([-along[:, 1], along[:, 0]]) / lengths[:, None], lengths


def _miss_wall(points: Floats, origins: Floats, inward: Floats) -> Floats:
    """(w,) how far the middle of points (..., 2) lies beyond the ends of each wall [m]."""
    along = np.column_stack([inward[:, 1], -inward[:, 0]])
    lengths = np.linalg.norm(np.roll(origins, -1, axis=0) - origins, axis=1)
    at = np.sum((points.reshape(-1, 2).mean(axis=0) - origins) * along, axis=1)
    return np.asarray(np.maximum(0.0, np.maximum(-at, at - lengths)))


def _find_along(door: Doorway) -> Floats:
    """(3,) unit direction along the wall of a door [world]; the same from both its sides."""
    ahead = door.outward_from(door.between[0])
    return np.array([ahead[1], -ahead[0], 0.0])


def _level(direction: Floats) -> Floats:
    return np.array([direction[0], direction[1], 0.0])


def _same(lines: Floats, direction: tuple[float, ...] | Floats) -> Floats:
    """(n, 3) one displacement for all lines."""
    return np.tile(np.array(direction, float), (len(lines), 1))
