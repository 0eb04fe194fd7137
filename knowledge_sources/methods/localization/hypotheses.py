"""Several places where the robot may be: how likely each is, and what to do next so that they part."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.motion.routes import compute_free_space, is_clear
from knowledge_sources.methods.verification.agreement import compute_coverage
from knowledge_sources.methods.verification.predicted_lines import predict_lines
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

Floats = NDArray[np.float64]

HERE = Pose2(0.0, 0.0, 0.0)
NOWHERE = 0.1
"""Weight that is left for every place nobody thought of."""
MANY = 20
"""More lines than this in which two views differ part them no better."""
LONG_PX = 20.0
ALIKE_PX, ALIKE_RAD = 8.0, 0.12
"""Lines of two views that are no further apart are one to the eye, as sure as the poses are known."""
TELLING, TELLING_PART = 3.0, 0.15
"""Views that differ in fewer lines, or a smaller part of theirs, cannot be told apart: so much differs by what is just
long, near or clear enough to be expected from the one and not from the other."""
TURNS_RAD = tuple(math.radians(a) for a in (180.0, 90.0, -90.0, 135.0, -135.0, 45.0, -45.0))
MOVES_RAD = tuple(math.radians(a) for a in (0.0, 90.0, -90.0, 180.0))
MOVE_M = 0.6
MARGIN_M = 0.1
"""A probing move keeps so much further from things than the robot is wide."""
NEW_RAD = math.radians(30.0)
"""A look less than this beside an earlier one from the same spot shows little that is new."""


@dataclass(frozen=True, slots=True)
class PoseHypothesis:
    """A pose in a room, with its weight among others."""

    room: str
    world_from_robot: Pose2
    weight: float


@dataclass(frozen=True, slots=True)
class SensingAction:
    """Turn, move, and look; ``expected_separation`` of the hypotheses by the new view [lines]."""

    turn_rad: float
    move_m: float
    expected_separation: float

    def apply_to(self, pose: Pose2) -> Pose2:
        """Where it leads."""
        return pose @ Pose2(0.0, 0.0, self.turn_rad) @ Pose2(self.move_m, 0.0, 0.0)


View = Callable[[Pose2], Floats]
"""The lines (n, 2, 2) [px] that should be seen from a pose."""
IsSafe = Callable[[PoseHypothesis, SensingAction], bool]
"""Whether the move of an action keeps free of everything from a hypothesis."""


def normalize_log_likelihoods(likelihoods: Sequence[float]) -> tuple[float, ...]:
    """Shares, summing to one, of places from the logarithms of their likelihoods."""
    if not likelihoods:
        return ()
    best = max(likelihoods)
    parts = [math.exp(value - best) for value in likelihoods]
    total = math.fsum(parts)
    return tuple(part / total for part in parts)


def make_view_predictor(robot: RobotModel) -> View:
    """What a robot's model says is to be seen from a pose: long and clear lines."""
    def seen(pose: Pose2) -> Floats:
        lines = predict_lines(robot, pose).segments_px
        return np.asarray(lines[np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1) >= LONG_PX])

    return seen


def compute_view_difference(one: Floats, other: Floats) -> float:
    """In how many lines two views (n, 2, 2) and (m, 2, 2) differ: those of either that are not in the other as well."""
    return math.fsum(_lacking(a, b) for a, b in ((one, other), (other, one)))


def compute_separation(views: Sequence[Floats], weights: Sequence[float]) -> float:
    """Lines by which views separate their hypotheses: pairs by their weights, and each against no known pose."""
    terms = []
    for i, one in enumerate(views):
        terms.append(weights[i] * NOWHERE * min(len(one), MANY))
        terms += [weights[i] * weights[j] * min(compute_view_difference(one, views[j]), MANY) for j in range(i)]
    return math.fsum(terms)


def choose_sensing_action(
    places: Sequence[PoseHypothesis], looked: Sequence[Pose2], seen: View, is_safe: IsSafe
) -> SensingAction | None:
    """The probe that is expected to part the places best, of the turns and short moves that show something new.

    Args:
        looked: where looks were taken, from where the robot is now.
        is_safe: whether a move from a place keeps free of everything; a move must be so from every place.
    """
    options = [p for p in _options(looked) if p.move_m == 0.0 or all(is_safe(place, p) for place in places)]
    weights = [place.weight for place in places]
    tried = []
    for p in options:
        views = [seen(p.apply_to(place.world_from_robot)) for place in places]
        tried.append(SensingAction(p.turn_rad, p.move_m, compute_separation(views, weights)))
    return max(tried, key=lambda p: p.expected_separation, default=None)  # of equals the first


def are_distinguishable(ones: Sequence[Floats], others: Sequence[Floats]) -> bool:
    """Whether the views from one place, taken together, differ clearly from those from another."""
    lines = sum(len(view) for view in (*ones, *others))
    differ = math.fsum(compute_view_difference(one, other) for one, other in zip(ones, others, strict=True))
    return differ >= max(TELLING, TELLING_PART * lines)


def can_distinguish(
    one: PoseHypothesis, other: PoseHypothesis, looked: Sequence[Pose2], seen: View, is_safe: IsSafe
) -> bool:
    """Whether any look within reach, or one that was taken, would show two places to be different."""
    a, b = one.world_from_robot, other.world_from_robot
    reach = [p.apply_to(HERE) for p in _options(()) if p.move_m == 0.0 or (is_safe(one, p) and is_safe(other, p))]
    return any(are_distinguishable([seen(a @ step)], [seen(b @ step)]) for step in (*looked, *reach))


def make_safety_check(robot: RobotModel) -> IsSafe:
    """The question whether a probe's move keeps free of all walls and things of a place's room, as the model has it."""
    known: dict[str, Any] = {}

    def is_safe(place: PoseHypothesis, probe: SensingAction) -> bool:
        if place.room not in known:
            world = robot.world
            known[place.room] = compute_free_space(world.outline(place.room), world.obstacles(place.room),
                                           robot.radius_m + MARGIN_M)
        pose = place.world_from_robot
        return is_clear(known[place.room], pose.position, probe.apply_to(pose).position)

    return is_safe


def find_widest_gap(looked: Sequence[Pose2]) -> float:
    """The turn to the middle of the widest sector that was not looked at from here [rad]."""
    angles = sorted(wrap_angle(look.heading_rad) for look in looked)
    if not angles:
        return 0.0
    gaps = [(b - a, a) for a, b in zip(angles, [*angles[1:], angles[0] + 2.0 * math.pi], strict=True)]
    width, start = max(gaps, key=lambda gap: gap[0])
    return wrap_angle(start + 0.5 * width)


def _options(looked: Sequence[Pose2]) -> list[SensingAction]:
    """Turns that show something new from here, and moves."""
    here = [look.heading_rad for look in looked if math.hypot(look.x_m, look.y_m) < 0.5 * MOVE_M]
    turns = [turn for turn in TURNS_RAD if all(abs(wrap_angle(turn - h)) >= NEW_RAD for h in here)]
    moves = [SensingAction(turn, MOVE_M, 0.0) for turn in MOVES_RAD]
    return [*(SensingAction(turn, 0.0, 0.0) for turn in turns), *moves]


def _lacking(one: Floats, other: Floats) -> float:
    """How many lines of a view are not in another: by their length, a line that is half there being half."""
    if not len(one):
        return 0.0
    if not len(other):
        return float(len(one))
    return float(np.sum(1.0 - np.nan_to_num(compute_coverage(one, other, ALIKE_PX, ALIKE_RAD))))
