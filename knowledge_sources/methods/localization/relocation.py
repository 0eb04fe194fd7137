"""Where could the robot be? Poses anywhere in these rooms that bear out what was seen, each refined and weighed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.localization.hypotheses import (
    PoseHypothesis,
    SensingAction,
    are_distinguishable,
    can_distinguish,
    choose_sensing_action,
    find_widest_gap,
    make_safety_check,
    make_view_predictor,
    normalize_log_likelihoods,
)
from knowledge_sources.methods.localization.log_likelihood import PoseLikelihood, compute_pose_likelihood
from knowledge_sources.methods.localization.pose_candidates import are_distinct, find_pose_candidates
from knowledge_sources.methods.localization.refinement import refine_pose, refine_view_motions
from knowledge_sources.methods.localization.repetition import find_repetitions
from knowledge_sources.methods.localization.views import CameraView, align_headings
from knowledge_sources.methods.verification.predicted_lines import predict_lines
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
    evidence: PoseLikelihood
    weight: float = 1.0

    @property
    def is_accepted(self) -> bool:
        """Whether enough is borne out, in every glance."""
        e = self.evidence
        is_sure = e.likelihood >= SURE and e.accounted >= SURE_PART * e.seen
        is_explained = e.explained >= max(LEAST_EXPLAINED, LEAST_TOGETHER - e.accounted / max(e.seen, 1))
        return (e.accounted >= LEAST_LINES and e.accounted >= LEAST_PART * e.seen and e.weakest >= WEAKEST
                and (is_explained or is_sure))

    @property
    def place(self) -> PoseHypothesis:
        return PoseHypothesis(self.room, self.world_from_robot, self.weight)


class LocalizationStatus(Enum):
    """What several looks say of where the robot is."""

    FOUND = "found"
    PROBE = "probe"
    AMBIGUOUS = "ambiguous"


@dataclass(frozen=True, slots=True, eq=False)
class LocalizationResult:
    """The verdict, the places that are kept, the likeliest first, and the probe to carry out next."""

    status: LocalizationStatus
    candidates: tuple[Candidate, ...]
    next_action: SensingAction | None = None


def localize(robot: RobotModel, glances: Sequence[CameraView], rooms: Sequence[str]) -> LocalizationResult:
    """What is to be made of these glances, the last of which was taken from where the robot is now."""
    straight = align_headings(glances, robot.camera, robot.mount.camera_from_robot)
    return decide(robot, candidates(robot, straight, rooms), [g.now_from_then for g in straight])


def candidates(robot: RobotModel, straight: Sequence[CameraView], rooms: Sequence[str]) -> tuple[Candidate, ...]:
    """Places in these rooms that bear out all glances, the likeliest first, with their weights.

    If one place stands alone, its aliases are kept beside it: what would be seen there is looked for on the whole
    floor.
    """
    look_alike = make_alias_test(robot, [g.now_from_then for g in straight])
    found = [_candidate(robot, straight, *place) for place in _found(robot, straight, rooms)]
    kept = rank_candidates(found, look_alike)
    if len(kept) != 1 or not kept[0].is_accepted:
        return kept
    beside = find_aliases(robot, straight, kept[0].world_from_robot, rooms)
    return rank_candidates([*kept, *(_candidate(robot, straight, *place) for place in beside)], look_alike)


def find_aliases(
    robot: RobotModel, glances: Sequence[CameraView], pose: Pose2, rooms: Sequence[str]
) -> tuple[Found, ...]:
    """Room, pose and covariance (3, 3) of the other places of these rooms that would look the same in all glances.

    What was seen is asked no more, only the model: what is missed or hidden, and whatever else is seen, may put one of
    two places that look alike far behind the other. Where few lines are in sight the grid of places may be too coarse
    to propose either, so that the places at which the plan repeats itself are tried one by one.
    """
    predicted = [replace(g, segments_px=predict_lines(robot, g.then(pose)).segments_px) for g in glances]
    look_alike = make_alias_test(robot, [g.now_from_then for g in glances])
    found = [place for place in _found(robot, predicted, rooms)
             if are_distinct(place[1], pose) and look_alike(pose, place[1])]
    for room, other in find_repetitions(robot.world, _room_at(robot, rooms[0], pose), pose, rooms):
        known = (pose, *(place[1] for place in found))
        if all(are_distinct(other, one) for one in known) and look_alike(pose, other):
            found.append((room, *refine_pose(robot, predicted, other)))
    return tuple(found)


def make_alias_test(robot: RobotModel, looked: Sequence[Pose2]) -> Callable[[Pose2, Pose2], bool]:
    """The question whether two poses would look the same in all looks, by the robot's model."""
    seen = lru_cache(maxsize=64)(make_view_predictor(robot))

    def look_alike(one: Pose2, other: Pose2) -> bool:
        return not are_distinguishable([seen(one @ look) for look in looked], [seen(other @ look) for look in looked])

    return look_alike


def _found(robot: RobotModel, glances: Sequence[CameraView], rooms: Sequence[str]) -> list[Found]:
    """The places that fit best, refined, each once."""
    found: list[Found] = []
    for proposal in find_pose_candidates(robot, glances, rooms, FINALISTS):
        pose, covariance = refine_pose(robot, glances, proposal.world_from_robot)
        if all(are_distinct(pose, other) for _, other, _ in found):
            found.append((proposal.room, pose, covariance))
    return found


def _candidate(
    robot: RobotModel, glances: Sequence[CameraView], room: str, pose: Pose2, covariance: Floats
) -> Candidate:
    evidence = compute_pose_likelihood(robot, refine_view_motions(robot, glances, pose, covariance), pose)
    return Candidate(_room_at(robot, room, pose), pose, covariance, evidence)


def rank_candidates(found: Sequence[Candidate], look_alike: Callable[[Pose2, Pose2], bool]) -> tuple[Candidate, ...]:
    """Those that are an idea at all and not refuted by the likeliest, the likeliest first, with their weights.

    A place that would look like the likeliest one is not refuted, however much less likely chance has made it.
    """
    order = sorted((c for c in found if c.evidence.likelihood >= IDEA), key=lambda c: -c.evidence.likelihood)
    ideas = [c for c in order if c.evidence.likelihood >= order[0].evidence.likelihood - CLEAR
             or look_alike(order[0].world_from_robot, c.world_from_robot)][:KEPT]
    shares = normalize_log_likelihoods([c.evidence.likelihood for c in ideas])
    return tuple(Candidate(c.room, c.world_from_robot, c.covariance, c.evidence, share)
                 for c, share in zip(ideas, shares, strict=True))


def decide(robot: RobotModel, kept: Sequence[Candidate], looked: Sequence[Pose2]) -> LocalizationResult:
    """Found, if one place is_accepted and all others are refuted; ambiguous, if nothing in reach could refute them."""
    if len(kept) == 1 and kept[0].is_accepted and len(looked) >= LEAST_GLANCES:
        return LocalizationResult(LocalizationStatus.FOUND, tuple(kept))
    if not kept:
        return LocalizationResult(LocalizationStatus.PROBE, (), SensingAction(find_widest_gap(looked), 0.0, 0.0))
    seen, is_safe = make_view_predictor(robot), make_safety_check(robot)
    places = [c.place for c in kept]
    tied = len(kept) > 1 and all(c.is_accepted for c in kept[:2]) and len(looked) >= LEAST_GLANCES
    if tied and not can_distinguish(places[0], places[1], looked, seen, is_safe):
        return LocalizationResult(LocalizationStatus.AMBIGUOUS, tuple(kept))
    action = choose_sensing_action(places, looked, seen, is_safe)
    return LocalizationResult(LocalizationStatus.PROBE, tuple(kept), action)


def _room_at(robot: RobotModel, room: str, pose: Pose2) -> str:
    """The room in which a pose lies; in a doorway the one from which it was proposed."""
    there = robot.world.locale_at([*pose.position, robot.world.floor_m(room)])
    return there if there is not None and robot.world.is_room(there) else room
