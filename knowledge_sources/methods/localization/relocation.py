"""Where could the robot be? Poses anywhere in these rooms that bear out what was seen, each refined and weighed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.localization.hypotheses import (
    Place,
    Probe,
    best_probe,
    can_part,
    is_safe_in,
    tell_apart,
    view_of,
    weights_of,
    widest_gap,
)
from knowledge_sources.methods.localization.log_likelihood import Support, support_of
from knowledge_sources.methods.localization.pose_candidates import are_apart, proposals
from knowledge_sources.methods.localization.refinement import expected_lines, refined, settled
from knowledge_sources.methods.localization.repetition import repetitions
from knowledge_sources.methods.localization.views import Glance, squared
from world_models.frames import Pose2
from world_models.robot import RobotModel

Floats = NDArray[np.float64]
Found = tuple[str, Pose2, Floats]
"""The room in which a place was thought of, the pose, and its covariance (3, 3)."""

FINALISTS = 14
LEAST_GLANCES = 2
"""One look is not enough to say where one is, however well it fits: a place nobody thought of may fit as well."""
LEAST_LINES = 12
LEAST_PART, LEAST_EXPLAINED, WEAKEST = 0.6, 0.35, 0.35
"""What must be accounted for: of the expected lines, of what is seen, and of the lines of each single glance."""
LEAST_TOGETHER = 1.15
"""And so much of the first two together: a place a few inches beside the right one has a little of both."""
SURE, SURE_PART = 40.0, 0.75
"""Where the model has little of what there is, as before full shelves, the lines that it has must tell so much more: by
the logarithm of their likelihood, and by the part of them that is accounted for."""
CLEAR = 8.0
"""A place is refuted by another that is likelier by this factor's logarithm, if the two would look different."""
KEPT = 6
"""So many of the likeliest places are kept in agent."""
IDEA = 2.0
"""A place with less evidence than this is none."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A place where the robot may be now.

    Attributes:
        room, world_from_robot, covariance: where; (3, 3) over (x, y, heading), world.
        evidence: what speaks for it; weight: its share among all that are kept.
    """

    room: str
    world_from_robot: Pose2
    covariance: Floats
    evidence: Support
    weight: float = 1.0

    @property
    def stands(self) -> bool:
        """Whether enough is borne out, in every glance."""
        e = self.evidence
        is_sure = e.likelihood >= SURE and e.accounted >= SURE_PART * e.seen
        is_explained = e.explained >= max(LEAST_EXPLAINED, LEAST_TOGETHER - e.accounted / max(e.seen, 1))
        return (e.accounted >= LEAST_LINES and e.accounted >= LEAST_PART * e.seen and e.weakest >= WEAKEST
                and (is_explained or is_sure))

    @property
    def place(self) -> Place:
        return Place(self.room, self.world_from_robot, self.weight)


class Verdict(Enum):
    """What several looks say of where the robot is."""

    FOUND = "found"
    PROBE = "probe"
    AMBIGUOUS = "ambiguous"


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """The verdict, the places that are kept, the likeliest first, and the probe to carry out next."""

    verdict: Verdict
    candidates: tuple[Candidate, ...]
    probe: Probe | None = None


def finding(robot: RobotModel, glances: Sequence[Glance], rooms: Sequence[str]) -> Finding:
    """What is to be made of these glances, the last of which was taken from where the robot is now."""
    straight = squared(glances, robot.camera, robot.mount.camera_from_robot)
    return verdict(robot, candidates(robot, straight, rooms), [g.now_from_then for g in straight])


def candidates(robot: RobotModel, straight: Sequence[Glance], rooms: Sequence[str]) -> tuple[Candidate, ...]:
    """Places in these rooms that bear out all glances, the likeliest first, with their weights.

    If one place stands alone, its twins are kept beside it: what would be seen there is looked for on the whole floor.
    """
    look_alike = alike_in(robot, [g.now_from_then for g in straight])
    kept = ranked([_candidate(robot, straight, *place) for place in _found(robot, straight, rooms)], look_alike)
    if len(kept) != 1 or not kept[0].stands:
        return kept
    beside = twins(robot, straight, kept[0].world_from_robot, rooms)
    return ranked([*kept, *(_candidate(robot, straight, *place) for place in beside)], look_alike)


def twins(robot: RobotModel, glances: Sequence[Glance], pose: Pose2, rooms: Sequence[str]) -> tuple[Found, ...]:
    """Room, pose and covariance (3, 3) of the other places of these rooms that would look the same in all glances.

    What was seen is asked no more, only the model: what is missed or hidden, and whatever else is seen, may put one of
    two places that look alike far behind the other. Where few lines are in sight the grid of places may be too coarse
    to propose either, so that the places at which the plan repeats itself are tried one by one.
    """
    predicted = [replace(g, segments_px=expected_lines(robot, g.then(pose)).segments_px) for g in glances]
    look_alike = alike_in(robot, [g.now_from_then for g in glances])
    found = [place for place in _found(robot, predicted, rooms)
             if are_apart(place[1], pose) and look_alike(pose, place[1])]
    for room, other in repetitions(robot.world, _room_at(robot, rooms[0], pose), pose, rooms):
        if all(are_apart(other, known) for known in (pose, *(place[1] for place in found))) and look_alike(pose, other):
            found.append((room, *settled(robot, predicted, other)))
    return tuple(found)


def alike_in(robot: RobotModel, looked: Sequence[Pose2]) -> Callable[[Pose2, Pose2], bool]:
    """The question whether two poses would look the same in all looks, by the robot's model."""
    seen = lru_cache(maxsize=64)(view_of(robot))

    def look_alike(one: Pose2, other: Pose2) -> bool:
        return not tell_apart([seen(one @ look) for look in looked], [seen(other @ look) for look in looked])

    return look_alike


def _found(robot: RobotModel, glances: Sequence[Glance], rooms: Sequence[str]) -> list[Found]:
    """The places that fit best, settled, each once."""
    found: list[Found] = []
    for proposal in proposals(robot, glances, rooms, FINALISTS):
        pose, covariance = settled(robot, glances, proposal.world_from_robot)
        if all(are_apart(pose, other) for _, other, _ in found):
            found.append((proposal.room, pose, covariance))
    return found


def _candidate(robot: RobotModel, glances: Sequence[Glance], room: str, pose: Pose2, covariance: Floats) -> Candidate:
    evidence = support_of(robot, refined(robot, glances, pose, covariance), pose)
    return Candidate(_room_at(robot, room, pose), pose, covariance, evidence)


def ranked(found: Sequence[Candidate], look_alike: Callable[[Pose2, Pose2], bool]) -> tuple[Candidate, ...]:
    """Those that are an idea at all and not refuted by the likeliest, the likeliest first, with their weights.

    A place that would look like the likeliest one is not refuted, however much less likely chance has made it.
    """
    order = sorted((c for c in found if c.evidence.likelihood >= IDEA), key=lambda c: -c.evidence.likelihood)
    ideas = [c for c in order if c.evidence.likelihood >= order[0].evidence.likelihood - CLEAR
             or look_alike(order[0].world_from_robot, c.world_from_robot)][:KEPT]
    shares = weights_of([c.evidence.likelihood for c in ideas])
    return tuple(Candidate(c.room, c.world_from_robot, c.covariance, c.evidence, share)
                 for c, share in zip(ideas, shares, strict=True))


def verdict(robot: RobotModel, kept: Sequence[Candidate], looked: Sequence[Pose2]) -> Finding:
    """Found, if one place stands and all others are refuted; ambiguous, if nothing in reach could refute them."""
    if len(kept) == 1 and kept[0].stands and len(looked) >= LEAST_GLANCES:
        return Finding(Verdict.FOUND, tuple(kept))
    if not kept:
        return Finding(Verdict.PROBE, (), Probe(widest_gap(looked), 0.0, 0.0))
    seen, is_safe = view_of(robot), is_safe_in(robot)
    places = [c.place for c in kept]
    tied = len(kept) > 1 and all(c.stands for c in kept[:2]) and len(looked) >= LEAST_GLANCES
    if tied and not can_part(places[0], places[1], looked, seen, is_safe):
        return Finding(Verdict.AMBIGUOUS, tuple(kept))
    return Finding(Verdict.PROBE, tuple(kept), best_probe(places, looked, seen, is_safe))


def _room_at(robot: RobotModel, room: str, pose: Pose2) -> str:
    """The room in which a pose lies; in a doorway the one from which it was proposed."""
    there = robot.world.locale_at([*pose.position, robot.world.floor_m(room)])
    return there if there is not None and robot.world.is_room(there) else room
