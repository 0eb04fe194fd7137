"""From a rough pose to a precise one, and how likely all views are there.

The pose is refined by iterated closest lines and a Kalman filter over all motions between the views. Its likelihood
counts matched and missed lines, against what chance would match. Lines in a pattern that the model does not have, as
bricks, neither move the pose nor count.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from knowledge_sources.methods.arrays import Floats, Ints
from knowledge_sources.methods.features import SIGMA_ACROSS_PX
from knowledge_sources.methods.localization.views import CameraView, find_lever, join_covariances
from knowledge_sources.methods.pose import planar_from_lines, to_pose2
from knowledge_sources.methods.verification import (
    DISPLACEMENT_M,
    LINE_INDEPENDENCE,
    LINE_TOLERANCE_PX,
    LINE_TOLERANCE_RAD,
    check_lines,
    compute_agreement,
    compute_coverage,
    compute_log_ratio,
    compute_p_share,
    find_distinct,
    find_errors,
    list_names,
    predict_lines,
    take_distinct,
)
from world_models.compiled import compiled
from world_models.frames import Pose, Pose2
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import visible_lines

ALIKE_LOG_NOISE = 2.0
"""Log likelihood ratio of one picture between places that look alike by the model that is noise (generated floors of
seeds 0 to 2)."""
TURN_STEP_RAD = math.radians(1.5)  # step of the search for an uncertain turn

CANDIDATE_SIGMA_M = 0.15  # standard deviation of a candidate's position
CANDIDATE_SIGMA_RAD = math.radians(1.5)  # standard deviation of a candidate's heading
COARSE_GATE_PX = 16.0  # distance of a segment from its line in the first round
FINE_GATE_PX = 4.0  # distance of a segment from its line in the second round
GATE_RAD = 0.12  # angle between a segment and its line
MIN_PAIR_OVERLAP = 0.5  # part of a segment that must lie beside its line
MIN_PAIRS = 3  # fewest pairs of segment and line that are solved for a pose
KNOWN_TURN_RAD = math.radians(0.5)  # standard deviation of a turn up to which it is not searched
TURN_SEARCH_SIGMAS = 2.5  # reach of the search for an uncertain turn, in standard deviations
MAX_VIEW_SURPRISE = 11.3
"""Largest squared normalized error of a view by the others, with which they still agree; three unknowns, 99 %."""
MIN_VIEW_LINES = 8  # fewest predicted lines by which a single view counts
MIN_EXPLAINED_LENGTH_PX = 25.0  # shortest segment that should be explained by the model
EXPLAINED_TOLERANCE_PX = 3.0  # distance of a segment from the model line that explains it
MIN_EXPLAINING_LENGTH_PX = 4.0  # shortest model line that explains a segment
MIN_EXPLAINING_CONTRAST = 0.01  # smallest contrast of a model line that explains a segment, 0..1
WRONG_TURN_RAD = 0.1  # turn of the wrong poses at which chance is counted


@dataclass(slots=True, eq=False)
class _State:
    """What is estimated together: the robot's pose now, and where it was at each view.

    Attributes:
        pose: now, world.
        motions: now_from_then of each view.
        covariance: (3 + 3n, 3 + 3n) over (x, y, heading) of the pose and then of each motion.
    """

    pose: Pose2
    motions: list[Pose2]
    covariance: Floats

    def predict(self, k: int) -> tuple[Pose2, Floats]:
        """The pose at view ``k``, world, and its Jacobian (3, 3 + 3n) by the state."""
        then, jacobian = self.pose @ self.motions[k], np.zeros((3, len(self.covariance)))
        jacobian[:, :3] = find_lever(self.pose, then)
        jacobian[:, 3 + 3 * k:6 + 3 * k] = _build_rotation(self.pose.heading_rad)
        return then, jacobian

    def update(self, jacobian: Floats, off: Floats, prior: Floats, posterior: Floats) -> None:
        """Correct the whole by what a view tells of its own pose: off (3,) from the prior, and its covariances."""
        gain = np.linalg.solve(prior, jacobian @ self.covariance).T
        moved, reduced = gain @ off, self.covariance - gain @ (prior - posterior) @ gain.T
        self.covariance = 0.5 * (reduced + reduced.T)
        self.pose = _add(self.pose, moved[:3])
        self.motions = [_add(m, moved[3 + 3 * k:6 + 3 * k]) for k, m in enumerate(self.motions)]


def refine_pose(
    robot: RobotModel, views: Sequence[CameraView], pose: Pose2
) -> tuple[Pose2, Floats]:
    """Refine a rough pose of the robot now, by all views together; returns the pose and its covariance (3, 3).

    A Kalman filter over the pose and all motions between the views: what one view tells of a motion holds for every
    view before it, and what is driven once is uncertain once. Views with a known turn come first, and of these the
    view in which most model lines are visible: once the pose is known from it, clutter in the others, or a wrong turn,
    does no harm. Where the views contradict one another, the covariance grows by Birge's ratio.
    """
    views = [replace(v, segments_px=take_distinct(v.segments_px)) for v in views]
    visible = [len(predict_lines(robot, view.pose_then(pose))) for view in views]
    order = sorted(range(len(views)), key=lambda k: (_is_turn_uncertain(views[k]), -visible[k]))
    state = _start(views, pose, order[0])
    surprises = []
    for k in order:
        then, jacobian = state.predict(k)
        prior = np.asarray(jacobian @ state.covariance @ jacobian.T)
        uncertain = _is_turn_uncertain(views[k])
        start = _search_turn(robot, views[k], then) if uncertain else then
        solved, posterior = _solve(robot, views[k], then, prior, start)
        if posterior is prior:
            continue
        off = solved.minus(then)
        surprises.append(float(off @ np.linalg.pinv(prior - posterior, rcond=1e-9, hermitian=True) @ off))
        state.update(jacobian, off, prior, posterior)
    return state.pose, state.covariance[:3, :3] * _compute_birge_ratio(surprises[1:])


def _start(views: Sequence[CameraView], pose: Pose2, first: int) -> _State:
    """The state before any view: a candidate's covariance is of the pose at the view that shows most, ``first``."""
    motions = [view.now_from_then for view in views]
    sigma_m, sigma_rad = CANDIDATE_SIGMA_M, CANDIDATE_SIGMA_RAD
    back = find_lever(pose @ motions[first], pose)  # of the pose now by the pose at that view
    turn = _build_rotation(pose.heading_rad)
    size = 3 + 3 * len(views)
    source = np.zeros((size, size))  # of the errors of the pose at that view, and of the motions
    source[:3, :3] = np.diag([sigma_m**2, sigma_m**2, sigma_rad**2])
    source[3:, 3:] = join_covariances(views)
    jacobian = np.eye(size)
    jacobian[:3, :3] = back
    jacobian[:3, 3 + 3 * first:6 + 3 * first] = -back @ turn
    return _State(pose, motions, np.asarray(jacobian @ source @ jacobian.T))


def _compute_birge_ratio(surprises: Sequence[float]) -> float:
    """By what the covariance grows where one view contradicts what the others tell: chi square by freedom (Birge).

    Args:
        surprises: squared normalized error of each view after the first, three unknowns each.
    """
    if not surprises or max(surprises) <= MAX_VIEW_SURPRISE:
        return 1.0
    return max(1.0, math.fsum(surprises) / (3.0 * len(surprises)))


def _build_rotation(heading_rad: float) -> Floats:
    """(3, 3) of (x, y, heading)."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _add(pose: Pose2, off: Floats) -> Pose2:
    return to_pose2(pose.vector + off)


def refine_view_motions(
    robot: RobotModel, views: Sequence[CameraView], pose: Pose2, covariance: Floats
) -> tuple[CameraView, ...]:
    """Refine where the robot was at each view, given its pose now and the covariance (3, 3).

    Only of views whose turn level lines have not measured: a turn known to a few degrees would count against the pose.
    """
    out = []
    for view in views:
        if _is_turn_uncertain(view):
            before = view.pose_then(pose)
            lever, turn = find_lever(pose, before), _build_rotation(pose.heading_rad)
            prior = np.asarray(lever @ covariance @ lever.T + turn @ view.covariance @ turn.T)
            start = _search_turn(robot, view, before)
            then, _ = _solve(robot, view, before, prior, start)
            view = replace(view, now_from_then=pose.inverse() @ then)
        out.append(view)
    return tuple(out)


def _is_turn_uncertain(view: CameraView) -> bool:
    return bool(view.covariance[2, 2] > KNOWN_TURN_RAD**2)


def _search_turn(robot: RobotModel, view: CameraView, then: Pose2) -> Pose2:
    """Of the headings that a view may have had, the one with most pairs of segment and line, then the nearest."""
    step = TURN_STEP_RAD
    most = int(TURN_SEARCH_SIGMAS * math.sqrt(float(view.covariance[2, 2])) / step)
    turns = sorted((k * step for k in range(-most, most + 1)), key=abs)
    tried = [then @ Pose2(0.0, 0.0, turn) for turn in turns]
    predicted = [predict_lines(robot, then).segments_px for then in tried]
    pairs = [_pair(lines, view.segments_px, COARSE_GATE_PX) for lines in predicted]
    return tried[int(np.argmax([len(p) for p in pairs]))]


def _solve(
    robot: RobotModel, view: CameraView, then: Pose2, prior: Floats, start: Pose2
) -> tuple[Pose2, Floats]:
    """The pose at a view, and its covariance: pair and solve, with a coarse and a fine gate.

    Both are those of the prior where there are too few pairs.
    """
    solved, posterior = start, prior
    for gate_px in (COARSE_GATE_PX, FINE_GATE_PX):
        lines = predict_lines(robot, solved)
        pairs = _pair(lines.segments_px, view.segments_px, gate_px)
        if len(pairs) < MIN_PAIRS:
            break
        model, data = pairs[:, 0], pairs[:, 1]
        fix = planar_from_lines(
            lines.lines_world[model], view.segments_px[data], robot.camera, robot.mount.camera_from_robot, then,
            prior_covariance=prior, landmark_ids=lines.landmark[model].tolist(),
            sigma_px=SIGMA_ACROSS_PX,
        )
        solved, posterior = fix.world_from_robot, np.asarray(fix.covariance)
    return (then if posterior is prior else solved), posterior


class Pairs(NamedTuple):
    """Model lines (n, 2, 3) [m, world], the segments (n, 2, 2) that agree with them, and n landmarks."""

    lines_world: Floats
    segments_px: Floats
    names: list[str]


def list_pairs(robot: RobotModel, view: CameraView, then: Pose2) -> Pairs:
    """What agrees in one view from a precise pose, without what is in a pattern."""
    segments, lines = take_distinct(view.segments_px), predict_lines(robot, then)
    model, data = _pair(lines.segments_px, segments, FINE_GATE_PX).T
    names = list_names(lines)
    return Pairs(lines.lines_world[model], segments[data], [names[int(i)] for i in model])


def _pair(lines_px: Floats, segments_px: Floats, gate_px: float) -> Ints:
    """(p, 2) indices of lines (m, 2, 2) and segments (k, 2, 2): each segment along a line, with the nearest one."""
    nearest = _find_nearest(
        np.array(lines_px, float, order="C"), np.array(segments_px, float, order="C"), gate_px,
        math.sin(GATE_RAD), MIN_PAIR_OVERLAP)
    data = np.flatnonzero(nearest >= 0)
    return np.column_stack([nearest[data], data])


@compiled
def _find_nearest(lines: Any, segments: Any, gate_px: float, sine: float, min_overlap: float) -> Any:
    """(k,) index of the nearest line of about the direction of each segment, -1 where there is none."""
    out = np.full(len(segments), -1, np.int64)
    for k in range(len(segments)):
        best = gate_px
        du, dv = segments[k, 1, 0] - segments[k, 0, 0], segments[k, 1, 1] - segments[k, 0, 1]
        size = max(math.hypot(du, dv), 1e-9)
        for i in range(len(lines)):
            u, v = lines[i, 1, 0] - lines[i, 0, 0], lines[i, 1, 1] - lines[i, 0, 1]
            length = max(math.hypot(u, v), 1e-9)
            u, v = u / length, v / length
            if abs(u * dv - v * du) > sine * size:
                continue
            low, high, off = math.inf, -math.inf, 0.0
            for e in range(2):
                x, y = segments[k, e, 0] - lines[i, 0, 0], segments[k, e, 1] - lines[i, 0, 1]
                off = max(off, abs(x * v - y * u))
                low, high = min(low, x * u + y * v), max(high, x * u + y * v)
            shared = min(high, length) - max(low, 0.0)
            if off < best and shared > min_overlap * (high - low):
                out[k], best = i, off
    return out


@dataclass(frozen=True, slots=True)
class PoseLikelihood:
    """How well a pose explains all views.

    Attributes:
        visible, matched: numbers of lines that should be in view, over all views, and of those that are found; without
            those in a pattern that the model does not have.
        log_likelihood: logarithm of the likelihood ratio of this pose to one drawn by chance.
        explained: part of the length of long segments that lies on a model line, 0..1.
        looks: of each view the lines in view, those that are found, and the log likelihood.
    """

    visible: int
    matched: int
    log_likelihood: float
    explained: float
    looks: tuple[tuple[int, int, float], ...] = ()

    def is_refuted_by_a_look(self, other: PoseLikelihood, log_ratio: float) -> bool:
        """Whether half of the lines of one look are missing, and another pose explains that look so much better."""
        return any(_is_half_missing(visible, matched) and there - here >= log_ratio
                   for (visible, matched, here), (_, _, there) in zip(self.looks, other.looks, strict=True))

    def compute_p_weakest_look(self) -> float:
        """The probability that some look shows as few lines as the weakest does, if the others are right.

        Of looks of which half is missing: as few among bricks, where all looks show little, are no surprise. Lines of
        one thing are missed together, as where two walls of a corner are alike.
        """
        shares = [compute_p_share(found := round(LINE_INDEPENDENCE * matched), found + round(
            LINE_INDEPENDENCE * (visible - matched)), self.matched - matched, self.visible - visible)
            for visible, matched, _ in self.looks if _is_half_missing(visible, matched)]
        return min(1.0, len(self.looks) * min(shares)) if shares else 1.0

    def __str__(self) -> str:
        return (f"{self.matched} of {self.visible} model lines that should be seen from there are in the pictures,"
                f" and {self.explained:.0%} of what is seen is in the model")


def refine_to_likelier(
    robot: RobotModel, views: Sequence[CameraView], rough: Pose2
) -> tuple[Pose2, Floats, PoseLikelihood]:
    """Refine a rough pose of the robot now, with its covariance (3, 3), or keep it where all views are likelier there.

    The last view may move a pose off the lines of those before it. By less than chance makes of so many views, the
    refined one is kept. One that is not refined is no surer than refining moves it.
    """
    refined, covariance = refine_pose(robot, views, rough)
    off = rough.minus(refined)
    tried = []
    for pose, spread in ((refined, covariance), (rough, covariance + np.outer(off, off))):
        moved = refine_view_motions(robot, views, pose, spread)
        tried.append((pose, spread, compute_pose_likelihood(robot, moved, pose)))
    lost = tried[1][2].log_likelihood - tried[0][2].log_likelihood
    return tried[lost > ALIKE_LOG_NOISE * len(views)]


def compute_pose_likelihood(
    robot: RobotModel, views: Sequence[CameraView], world_from_now: Pose2
) -> PoseLikelihood:
    """Compute the likelihood of the robot's pose now by all views."""
    visible, matched, looks = 0, 0, list[tuple[int, int, float]]()
    lengths, explained = 0.0, 0.0
    for view in views:
        then = view.pose_then(world_from_now)
        shown = predict_lines(robot, then)
        projected = _project(robot, shown.lines_world, [then, *_displace(then)])
        tells = find_distinct(projected[0], view.segments_px)
        shown, projected = shown[tells], projected[:, tells]
        errors = find_errors(robot, shown)
        agreement = compute_agreement(
            projected[0], view.segments_px, projected[1:], LINE_TOLERANCE_PX
        ) if errors.is_exact else check_lines(
            robot, shown.lines_world, view.segments_px, then, errors,
            list_names(shown)).agreement
        found, expected = agreement.matched, agreement.visible
        visible, matched = visible + expected, matched + found
        looks.append((expected, found, compute_log_ratio(found, expected, agreement.chance)))
        length, part = _explain(robot, view, then)
        lengths, explained = lengths + length, explained + part
    part = explained / lengths if lengths > 0.0 else 0.0
    return PoseLikelihood(visible, matched, math.fsum(look[2] for look in looks), part, tuple(looks))


def _is_half_missing(visible: int, matched: int) -> bool:
    return visible >= MIN_VIEW_LINES and 2 * matched <= visible


def _project(robot: RobotModel, lines_world: Floats, poses: Sequence[Pose2]) -> Floats:
    """(p, m, 2, 2) the lines as seen from each pose, NaN where not in view [px]."""
    lines_camera = np.array([robot.camera_from_world(pose).apply(lines_world) for pose in poses])
    seen, _ = robot.camera.project_segments(lines_camera.reshape(-1, 2, 3), Pose.identity())
    return np.asarray(seen.reshape(len(poses), len(lines_world), 2, 2))


def _displace(pose: Pose2) -> list[Pose2]:
    """Sixteen wrong poses around a pose: four directions, two distances, two turns."""
    shifts = [(by * x, by * y) for by in (DISPLACEMENT_M, 2.0 * DISPLACEMENT_M)
              for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    return [pose @ Pose2(x, y, turn) for x, y in shifts for turn in (-WRONG_TURN_RAD, WRONG_TURN_RAD)]


def _explain(robot: RobotModel, view: CameraView, then: Pose2) -> tuple[float, float]:
    """Length of the long segments, and of the part of them that lies on model lines, also on faint ones [px]."""
    length = np.linalg.norm(view.segments_px[:, 1] - view.segments_px[:, 0], axis=1)
    long = length >= MIN_EXPLAINED_LENGTH_PX
    if not np.any(long):
        return 0.0, 0.0
    shown = visible_lines(
        robot.world, robot.camera, robot.camera_from_world(then), min_length_px=MIN_EXPLAINING_LENGTH_PX,
        min_contrast=MIN_EXPLAINING_CONTRAST, min_separation_px=0.0)
    covered = compute_coverage(
        view.segments_px[long], shown.segments_px, EXPLAINED_TOLERANCE_PX, LINE_TOLERANCE_RAD)
    return float(np.sum(length[long])), float(np.sum(length[long] * covered))
