"""What is believed of a door: by the pictures of it, and by a picture that a shut door explains (§4).

It is log odds of its not being open.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.belief import Alike, Look, add_looks, measure_common, to_probability
from knowledge_sources.methods.features import SIGMA_ACROSS_PX, read_picture
from knowledge_sources.methods.matching import match_on_floor
from knowledge_sources.methods.pose import planar_from_lines
from knowledge_sources.methods.verification import (
    MIN_MATCHED_LINES,
    POSE_CONFIDENCE,
    check_colors,
    check_lines,
    compute_evidence,
    predict_face_colors,
    predict_lines,
)
from world_models.building.locales import Doorway
from world_models.entries import DoorCondition, DoorPicture, DoorState, Hypothesis
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

MIN_LOG_RATIO = 2.0  # least that is counted
PRIOR_LOG_ODDS = 4.0  # log odds that a door is as it is believed to be, before a picture is taken: 98 %
SHUT_LOG_ODDS = 4.6  # log odds from which a door is shut: 99 %
OPEN_LOG_ODDS = -3.0  # log odds up to which a door is open: 95 %
MAX_LOG_ODDS = 7.0  # largest log odds that are kept, that a door may open again
TOUCH_LOG_RATIO = 3.0  # what a touch in the opening adds: 20 to 1, as things stand in open doorways, too
MAX_TOUCH_M = 0.1  # so far before the wall, or behind it, what is touched may be a leaf
MIN_PICTURES = 2  # fewest pictures by which a door is shut; a touch counts as one
SAME_PLACE = Alike(step_m=0.6, turn_rad=math.inf)
"""Pictures of a door from places so far apart are independent; what is seen through it does not change by a turn."""
MAX_COMMON = 0.5  # of two pictures that have more in common, one is kept
MAX_VIEWS = 4  # so many are kept, the last ones
MAX_DOUBTED_SIGMAS = 3.0  # standard deviations of the belief within which the explained pose must be
MIN_EXPLAINED_BETTER = 10.0  # least ratio by which the pose is likelier to be wrong with the door open
MIN_FEW_LINES = 3  # fewest lines by which a frame is recognized, where they are too few to tell the place by
MIN_FEW_SHARE = 0.6  # least share of these that must be there


def update_door(
    known: DoorState | None, door: str, between: tuple[str, str], picture: DoorPicture, seen_s: float, *,
    is_believed_shut: bool,
) -> DoorState | None:
    """What is believed of a door after a picture; None where that picture adds nothing.

    Pictures count by what they do not have in common (:func:`~knowledge_sources.methods.belief.odds.add_looks`): from
    near one place they show the same jambs and the same of what is beyond, however the robot turns. A picture that
    contradicts what was seen from there takes its place, and only the last few count: the door may have moved.
    """
    if abs(picture.log_ratio) < MIN_LOG_RATIO:
        return None
    prior = (1 if is_believed_shut else -1) * PRIOR_LOG_ODDS
    views: tuple[DoorPicture, ...] = ()
    if known is not None:
        views = known.views or (known.last,)
        prior = known.prior if known.views else known.log_odds - known.last.log_ratio
    kept = _keep(views, picture)
    if kept is None:
        return None
    views = (*kept, picture)[-MAX_VIEWS:]
    log_odds = prior + add_looks([Look(_pose(view), view.log_ratio) for view in views], SAME_PLACE)
    log_odds = min(max(log_odds, -MAX_LOG_ODDS), MAX_LOG_ODDS)
    touched_s = None if known is None else known.touched_s
    state = _name_state(log_odds, len(views) + (touched_s is not None), known)
    if known is not None and (state, log_odds) == (known.state, known.log_odds):
        return None
    p_shut = to_probability(log_odds)
    certainty = 1.0 - p_shut if state == "open" else p_shut
    return DoorState(door, between, state, certainty, log_odds, len(views), picture, seen_s, prior, views, touched_s)


def touch_door(known: DoorState, when_s: float) -> DoorState:
    """What is believed of a door after the first touch in its opening; that counts besides the pictures."""
    log_odds = min(known.log_odds + TOUCH_LOG_RATIO, MAX_LOG_ODDS)
    prior = (known.prior if known.views else known.log_odds - known.last.log_ratio) + TOUCH_LOG_RATIO
    state = _name_state(log_odds, known.pictures + 1, known)
    return replace(known, state=state, certainty=to_probability(log_odds), log_odds=log_odds, prior=prior,
                   views=known.views or (known.last,), touched_s=when_s)


def is_in_opening(doorway: Doorway, locale: str, at: Floats, margin_m: float) -> bool:
    """Whether a place (2,) [world] lies in a doorway, by a margin within its jambs, and as deep as a leaf may hang."""
    (left, right), outward = doorway.threshold_of(locale), doorway.outward_from(locale)
    behind = doorway.threshold_of(doorway.other(locale))[0]
    across_m = float((at - left) @ (right - left)) / doorway.width_m
    deep_m, wall_m = float((at - left) @ outward), float((behind - left) @ outward)
    return margin_m <= across_m <= doorway.width_m - margin_m and -MAX_TOUCH_M <= deep_m <= wall_m + MAX_TOUCH_M


def _keep(views: tuple[DoorPicture, ...], new: DoorPicture) -> tuple[DoorPicture, ...] | None:
    """The pictures that count besides a new one; None where one of them says the same, and no less."""
    agreeing = [view for view in views if view.log_ratio * new.log_ratio > 0.0
                and measure_common(_pose(view), _pose(new), SAME_PLACE) > MAX_COMMON]
    if any(abs(view.log_ratio) >= abs(new.log_ratio) for view in agreeing):
        return None
    against = [view for view in views if view.log_ratio * new.log_ratio < 0.0
               and measure_common(_pose(view), _pose(new), SAME_PLACE) > 0.0]
    return tuple(view for view in views if view not in against and view not in agreeing)


def _pose(picture: DoorPicture) -> Pose2:
    return Pose2(picture.x_m, picture.y_m, picture.heading_rad)


def _name_state(log_odds: float, count: int, known: DoorState | None) -> DoorCondition:
    if log_odds >= SHUT_LOG_ODDS and count >= MIN_PICTURES:
        return "shut"
    if log_odds <= OPEN_LOG_ODDS:
        return "open"
    was = "unknown" if known is None else known.state
    return was if was == "shut" else "unknown"


@dataclass(frozen=True, slots=True, eq=False)
class ExplainedPicture:
    """A picture as seen from a pose.

    Attributes:
        pose, covariance: as solved for, world; (3, 3) over (x, y, heading).
        p_false: probability that the pose is wrong, by lines and colors.
        matched, expected: number of lines.
        is_solved: whether the pose was solved for; else there were too few lines, and it is the believed one.
    """

    pose: Pose2
    covariance: Floats
    p_false: float
    matched: int
    expected: int
    is_solved: bool = True


def explain_picture(
    robot: RobotModel, belief: Pose2, covariance: Floats, segments_px: Floats, jpeg: bytes
) -> ExplainedPicture | None:
    """Find the pose near a belief from which a picture was taken; None where no line is expected.

    Args:
        robot: in the building as it would be.
        covariance: (3, 3) of the belief.
        segments_px: (k, 2, 2) found in the picture.
    """
    lines = predict_lines(robot, belief)
    if not len(lines) or not len(segments_px):
        return None
    mount = robot.mount.camera_from_robot
    found = match_on_floor(lines.lines_world, segments_px, robot.camera, mount, belief, covariance)
    pairs = np.asarray(found.pairs, np.int64).reshape(-1, 2)
    if len(np.unique(pairs[:, 0])) < MIN_MATCHED_LINES:
        agreed = check_lines(robot, lines.lines_world, segments_px, belief)
        return ExplainedPicture(belief, covariance, 1.0, agreed.agreement.matched, len(lines), is_solved=False)
    fix = planar_from_lines(
        lines.lines_world[pairs[:, 0]], segments_px[pairs[:, 1]], robot.camera, mount, belief,
        prior_covariance=covariance, landmark_ids=[int(lines.landmark[i]) for i in pairs[:, 0]],
        sigma_px=SIGMA_ACROSS_PX)
    pose = fix.world_from_robot
    agreed = check_lines(robot, lines.lines_world, segments_px, pose)
    faces = check_colors(robot, pose, read_picture(jpeg).quarter, predict_face_colors(robot, pose))
    weight = compute_evidence(pose, fix.covariance, belief, covariance, agreed, faces)
    return ExplainedPicture(pose, fix.covariance, POSE_CONFIDENCE.p_false(weight), agreed.agreement.matched, len(lines))


def is_explained(shut: ExplainedPicture, opened: ExplainedPicture | None, *, is_sure: bool) -> bool:
    """Whether a picture tells the place with the door shut, and does not with it open.

    Where too few lines are in view to tell the place by, the belief must be sure (``is_sure``), and these lines be
    there; of none, or next to none, the frame of the opening must do.
    """
    if not shut.is_solved:
        are_there = shut.matched >= MIN_FEW_SHARE * shut.expected
        return is_sure and (are_there or shut.expected < MIN_FEW_LINES)
    if shut.p_false > POSE_CONFIDENCE.accept:
        return False
    return opened is None or not opened.is_solved or opened.p_false > MIN_EXPLAINED_BETTER * shut.p_false


def is_near(before: Pose2, after: Pose2, belief: Hypothesis) -> bool:
    """Whether a pose is where the robot believes to be."""
    off_rad = abs(wrap_angle(after.heading_rad - before.heading_rad))
    is_there = before.distance_to(after) <= MAX_DOUBTED_SIGMAS * belief.sigma_m + 0.05
    return is_there and off_rad <= MAX_DOUBTED_SIGMAS * belief.sigma_rad + 0.02
