"""Active localization: the next turn or short move whose view separates the pose hypotheses best."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.localization.hypotheses import (
    PoseHypothesis,
    PredictView,
    are_distinguishable,
    compute_view_difference,
)
from knowledge_sources.methods.motion.routes import find_free_space, is_clear
from knowledge_sources.settings import DEFAULT, Settings
from knowledge_sources.settings.localization import LocalizationSettings
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

HERE = Pose2(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class SensingAction:
    """A turn, then a move, then a look.

    Attributes:
        turn_rad, move_m: the motion.
        expected_separation: lines by which the new view is expected to separate the hypotheses.
    """

    turn_rad: float
    move_m: float
    expected_separation: float

    def apply_to(self, pose: Pose2) -> Pose2:
        """Where the motion leads."""
        return pose @ Pose2(0.0, 0.0, self.turn_rad) @ Pose2(self.move_m, 0.0, 0.0)


IsSafe = Callable[[PoseHypothesis, SensingAction], bool]
"""Whether an action's move is free of collisions if a hypothesis is true."""


def choose_sensing_action(
    hypotheses: Sequence[PoseHypothesis], looked: Sequence[Pose2], predict: PredictView, is_safe: IsSafe,
    settings: Settings = DEFAULT,
) -> SensingAction | None:
    """Choose the action with the largest expected separation; None where no action shows anything new.

    Args:
        looked: poses of the views so far, in the robot's frame now.
        is_safe: a move must be safe from every hypothesis.
    """
    options = [o for o in _list_actions(looked, settings.localization)
               if o.move_m == 0.0 or all(is_safe(hypothesis, o) for hypothesis in hypotheses)]
    weights = [hypothesis.weight for hypothesis in hypotheses]
    rated = []
    for option in options:
        views = [predict(option.apply_to(hypothesis.world_from_robot)) for hypothesis in hypotheses]
        rated.append(SensingAction(option.turn_rad, option.move_m, compute_separation(views, weights, settings)))
    return max(rated, key=lambda action: action.expected_separation, default=None)  # of equals the first


def compute_separation(views: Sequence[Floats], weights: Sequence[float], settings: Settings = DEFAULT) -> float:
    """Compute the expected number of lines by which a look separates hypotheses with these views.

    Sum over pairs by their weights, and of each hypothesis against the poses that none covers.
    """
    tuning, terms = settings.localization, []
    for i, one in enumerate(views):
        terms.append(weights[i] * tuning.unknown_weight * min(len(one), tuning.max_different_lines))
        terms += [weights[i] * weights[j]
                  * min(compute_view_difference(one, views[j], settings), tuning.max_different_lines)
                  for j in range(i)]
    return math.fsum(terms)


def can_distinguish(
    one: PoseHypothesis, other: PoseHypothesis, looked: Sequence[Pose2], predict: PredictView, is_safe: IsSafe,
    settings: Settings = DEFAULT,
) -> bool:
    """Whether any look within reach, or one that was taken, would tell two hypotheses apart."""
    a, b = one.world_from_robot, other.world_from_robot
    reach = [option.apply_to(HERE) for option in _list_actions((), settings.localization)
             if option.move_m == 0.0 or (is_safe(one, option) and is_safe(other, option))]
    return any(are_distinguishable([predict(a @ step)], [predict(b @ step)], settings) for step in (*looked, *reach))


def make_safety_check(robot: RobotModel, settings: LocalizationSettings = DEFAULT.localization) -> IsSafe:
    """Return a check whether an action's move keeps free of the walls and things of the hypothesis's room."""
    clearance_m = robot.radius_m + settings.move_clearance_m

    def is_safe(hypothesis: PoseHypothesis, action: SensingAction) -> bool:
        free, pose = find_free_space(robot.world, hypothesis.room, clearance_m), hypothesis.world_from_robot
        return is_clear(free, pose.position, action.apply_to(pose).position)

    return is_safe


def find_widest_gap(looked: Sequence[Pose2]) -> float:
    """Return the turn to the middle of the widest sector that no view has shown [rad]."""
    angles = sorted(wrap_angle(look.heading_rad) for look in looked)
    if not angles:
        return 0.0
    gaps = [(b - a, a) for a, b in zip(angles, [*angles[1:], angles[0] + 2.0 * math.pi], strict=True)]
    width, start = max(gaps, key=lambda gap: gap[0])
    return wrap_angle(start + 0.5 * width)


def _list_actions(looked: Sequence[Pose2], settings: LocalizationSettings) -> list[SensingAction]:
    """The turns that show something new from here, and the moves."""
    move = settings.move_m
    here = [look.heading_rad for look in looked if math.hypot(look.x_m, look.y_m) < 0.5 * move]
    turns = [turn for turn in settings.turns_rad
             if all(abs(wrap_angle(turn - h)) >= settings.min_new_view_rad for h in here)]
    moves = [SensingAction(turn, move, 0.0) for turn in settings.turns_before_move_rad]
    return [*(SensingAction(turn, 0.0, 0.0) for turn in turns), *moves]
