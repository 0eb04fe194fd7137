"""Changes of a model that its runs speak for: what stands elsewhere, and what is gone; each with odds and evidence.

That something is elsewhere competes with chance: by what is measured of it, is it as far off as a model of this
deviation may be, or where the file has it, to what a tape measures? That a thing is gone competes with its having been
overlooked, picture by picture; pictures from one place count once (``knowledge_sources/methods/belief``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harvey_survey.adjustment import Adjustment
from harvey_survey.seen_pictures import SeenPicture
from knowledge_sources.methods.belief import Alike, add_looks, to_log_odds, to_probability
from knowledge_sources.methods.belief import Look as Sight
from world_models.building.model_errors import ALONG, MEASURED_M, WALL
from world_models.building.world import World

Floats = NDArray[np.float64]

SURE = 0.99
"""What is less certain is not proposed."""
MIN_PICTURES, SURE_SIGMAS = 3, 3.0
"""A change of place needs so many pictures, and so many standard deviations."""
PRIOR_GONE = 0.05
"""Share of the things of a plan that are gone, before any look."""
APART = Alike(0.5, 0.5)
"""Looks at a thing from so far apart, or with such a turn between them, may overlook it each for itself."""
FEW = 1.0 / 3.0
GONE_RATIOS: Mapping[tuple[int, str], float] = {
    (1, "none"): 1.4, (1, "few"): -1.7, (1, "some"): -1.7,
    (3, "none"): 2.1, (3, "few"): -0.5, (3, "some"): -2.6,
    (4, "none"): 3.8, (4, "few"): 2.6, (4, "some"): -3.9,
}
"""By how much a look is likelier where a thing is gone than where it is there [log]: by how many of its lines are
expected and not hidden (one or two, three, four and more), and whether none, fewer than a third or some of them are
found. Counted in twelve missions on two floors (seeds 9001 and 9002) that no experiment judges."""


@dataclass(frozen=True, slots=True)
class SurveyChange:
    """One change of a world file.

    Attributes:
        kind: wall, door or thing. name: as the file has it; of a wall ``corridor wall 2``.
        moved: by how much, by what is changed, in the file's own directions [cm]: ``into`` the room (a wall), ``along``
            as the file counts, ``up``, ``x`` and ``y`` of its room. Empty where it is gone.
        sigmas: standard deviations of these [cm].
        certainty: probability of the change.
        evidence: in words.
    """

    kind: str
    name: str
    moved: Mapping[str, float]
    sigmas: Mapping[str, float]
    certainty: float
    evidence: str

    @property
    def is_gone(self) -> bool:
        return not self.moved


def propose_changes(world: World, looks: Sequence[SeenPicture], found: Adjustment) -> tuple[SurveyChange, ...]:
    """What is surely gone, then what is surely elsewhere; by name."""
    gone = find_gone(world, looks)
    names = {change.name for change in gone}
    return (*gone, *(change for change in find_moved(world, found) if change.name not in names))


def find_gone(world: World, looks: Sequence[SeenPicture]) -> tuple[SurveyChange, ...]:
    """The things that are surely gone."""
    things = {thing.name for thing in world.things}
    sights: dict[str, list[Sight]] = {}
    counted: dict[str, list[tuple[int, int]]] = {}
    for look in looks:
        rows: dict[str, list[int]] = {}
        for i, mark in enumerate(look.marks):
            if mark.name in things and not (look.hidden[i] and not look.found[i]):
                rows.setdefault(mark.name, []).append(i)
        for name, lines in rows.items():
            seen = int(np.count_nonzero(look.found[lines]))
            sights.setdefault(name, []).append(Sight(look.pose, weigh_gone(len(lines), seen)))
            counted.setdefault(name, []).append((len(lines), seen))
    changes = []
    for name in sorted(sights):
        certainty = to_probability(to_log_odds(PRIOR_GONE) + add_looks(sights[name], APART))
        if certainty >= SURE:
            lines, seen = (sum(part) for part in zip(*counted[name], strict=True))
            changes.append(SurveyChange("thing", name, {}, {}, certainty,
                                  f"{seen} of its {lines} lines were found, in {len(counted[name])} pictures"))
    return tuple(changes)


def weigh_gone(expected: int, seen: int) -> float:
    """The log likelihood ratio of one look that a thing is gone, by its lines that are expected and those found."""
    size = 4 if expected >= 4 else 3 if expected == 3 else 1
    return GONE_RATIOS[size, "none" if not seen else "few" if seen < FEW * expected else "some"]


def find_moved(world: World, found: Adjustment) -> tuple[SurveyChange, ...]:
    """What is surely elsewhere: walls, doors and things."""
    things = {thing.name: thing for thing in world.things}
    merged: dict[tuple[str, str], list[tuple[str, float, int]]] = {}
    for k, way in enumerate(found.ways):
        name, axis = _name(world, way)
        kind = "wall" if axis == "into" else "thing" if name in things else "door"
        sign = 1.0 if axis in ("into", "up") else _sign_of(world, way, kind, axis, found.directions[k])
        if sign:
            merged.setdefault((kind, name), []).append((axis, sign, k))
    changes = []
    for (kind, name), parts in sorted(merged.items()):
        sure = [(axis, sign, k) for axis, sign, k in parts if _is_sure(found, k)]
        if sure:
            k = max((k for _, _, k in sure), key=lambda k: abs(found.offs_m[k]) / found.sigmas_m[k])
            changes.append(SurveyChange(
                kind, name, {axis: round(100.0 * sign * float(found.offs_m[k]), 2) for axis, sign, k in sure},
                {axis: round(100.0 * float(found.sigmas_m[k]), 2) for axis, _, k in sure}, _weigh_moved(found, k),
                f"found elsewhere in {found.pictures[k]} pictures, by {found.segments[k]} segments"))
    return tuple(changes)


def _is_sure(found: Adjustment, k: int) -> bool:
    return bool(found.pictures[k] >= MIN_PICTURES and _weigh_moved(found, k) >= SURE
                and abs(found.offs_m[k]) > SURE_SIGMAS * found.sigmas_m[k])


def _weigh_moved(found: Adjustment, k: int) -> float:
    """The probability that something is off as a model of its deviation may be, and not where the file has it."""
    prior, variance = float(found.priors_m[k]) ** 2, float(found.covariance[k, k])
    if variance >= prior:
        return 0.0
    own = 1.0 / (1.0 / variance - 1.0 / prior)  # of what the pictures alone say
    off = float(found.offs_m[k]) * own / variance
    elsewhere, here = own + prior, own + MEASURED_M**2
    log_ratio = 0.5 * (off**2 * (1.0 / here - 1.0 / elsewhere) - math.log(elsewhere / here))
    return to_probability(log_ratio)


def _name(world: World, way: str) -> tuple[str, str]:
    """What a mode is of, as the file names it, and along which of its own directions."""
    if WALL in way:
        return way, "into"
    name, _, axis = way.rpartition(" ")
    known = {thing.name for thing in world.things} | {door.name for door in world.doorways}
    return (name if name in known else name.rpartition("/")[2]), axis


def _sign_of(world: World, way: str, kind: str, axis: str, direction: Floats) -> float:
    """1 or -1: whether a mode's direction is that in which the file counts; 0 where the room lies askew."""
    mark = world.landmark(way.rpartition(" ")[0])
    room = next((door.between[0] for door in world.doorways if kind == "door" and door.name == mark.name), mark.locale)
    own = world.world_from_locale(room).rotation.T @ direction
    largest = int(np.argmax(np.abs(own)))
    is_own = axis == ALONG.strip() or axis == "xy"[min(largest, 1)]
    return float(np.sign(own[largest])) if is_own and abs(own[largest]) > 1.0 - 1e-6 else 0.0
