"""From a rough pose to a precise one, and how likely all views are there.

The pose is refined by iterated closest lines and a Kalman filter over all motions between the views. Its likelihood
counts matched and missed lines, against what chance would match.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit

from knowledge_sources.methods.arrays import Floats, Ints
from knowledge_sources.methods.localization.views import CameraView, find_lever, join_covariances
from knowledge_sources.methods.pose import planar_from_lines
from knowledge_sources.methods.verification.line_check import compute_agreement, compute_coverage, predict_lines
from knowledge_sources.settings import DEFAULT, Settings
from knowledge_sources.settings.localization import LocalizationSettings
from world_models.frames import Pose, Pose2, wrap_angle
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import visible_lines


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
    robot: RobotModel, views: Sequence[CameraView], pose: Pose2, settings: Settings = DEFAULT
) -> tuple[Pose2, Floats]:
    """Refine a rough pose of the robot now, by all views together; returns the pose and its covariance (3, 3).

    A Kalman filter over the pose and all motions between the views: what one view tells of a motion holds for every
    view before it, and what is driven once is uncertain once. Views with a known turn come first, and of these the
    view in which most model lines are visible: once the pose is known from it, clutter in the others, or a wrong turn,
    does no harm. Where the views contradict one another, the covariance grows by Birge's ratio.
    """
    tuning = settings.localization
    visible = [len(predict_lines(robot, view.pose_then(pose), settings.verification)) for view in views]
    order = sorted(range(len(views)), key=lambda k: (_is_turn_uncertain(views[k], tuning), -visible[k]))
    state = _start(views, pose, order[0], tuning)
    surprises = []
    for k in order:
        then, jacobian = state.predict(k)
        prior = np.asarray(jacobian @ state.covariance @ jacobian.T)
        uncertain = _is_turn_uncertain(views[k], tuning)
        start = _search_turn(robot, views[k], then, settings) if uncertain else then
        solved, posterior = _solve(robot, views[k], then, prior, start, settings)
        if posterior is prior:
            continue
        turned = wrap_angle(solved.heading_rad - then.heading_rad)
        off = np.array([solved.x_m - then.x_m, solved.y_m - then.y_m, turned])
        surprises.append(float(off @ np.linalg.pinv(prior - posterior, rcond=1e-9, hermitian=True) @ off))
        state.update(jacobian, off, prior, posterior)
    return state.pose, state.covariance[:3, :3] * _compute_birge_ratio(surprises[1:], tuning)


def _start(views: Sequence[CameraView], pose: Pose2, first: int, settings: LocalizationSettings) -> _State:
    """The state before any view: a candidate's covariance is of the pose at the view that shows most, ``first``."""
    motions = [view.now_from_then for view in views]
    sigma_m, sigma_rad = settings.candidate_sigma_m, settings.candidate_sigma_rad
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


def _compute_birge_ratio(surprises: Sequence[float], settings: LocalizationSettings) -> float:
    """By what the covariance grows where one view contradicts what the others tell: chi square by freedom (Birge).

    Args:
        surprises: squared normalized error of each view after the first, three unknowns each.
    """
    if not surprises or max(surprises) <= settings.max_view_surprise:
        return 1.0
    return max(1.0, math.fsum(surprises) / (3.0 * len(surprises)))


def _build_rotation(heading_rad: float) -> Floats:
    """(3, 3) of (x, y, heading)."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _add(pose: Pose2, off: Floats) -> Pose2:
    return Pose2(pose.x_m + float(off[0]), pose.y_m + float(off[1]), wrap_angle(pose.heading_rad + float(off[2])))


def refine_view_motions(
    robot: RobotModel, views: Sequence[CameraView], pose: Pose2, covariance: Floats, settings: Settings = DEFAULT
) -> tuple[CameraView, ...]:
    """Refine where the robot was at each view, given its pose now and the covariance (3, 3).

    Only of views whose turn level lines have not measured: a turn known to a few degrees would count against the pose.
    """
    out = []
    for view in views:
        if _is_turn_uncertain(view, settings.localization):
            before = view.pose_then(pose)
            lever, turn = find_lever(pose, before), _build_rotation(pose.heading_rad)
            prior = np.asarray(lever @ covariance @ lever.T + turn @ view.covariance @ turn.T)
            start = _search_turn(robot, view, before, settings)
            then, _ = _solve(robot, view, before, prior, start, settings)
            view = replace(view, now_from_then=pose.inverse() @ then)
        out.append(view)
    return tuple(out)


def _is_turn_uncertain(view: CameraView, settings: LocalizationSettings) -> bool:
    return bool(view.covariance[2, 2] > settings.known_turn_rad**2)


def _search_turn(robot: RobotModel, view: CameraView, then: Pose2, settings: Settings) -> Pose2:
    """Of the headings that a view may have had, the one with most pairs of segment and line, then the nearest."""
    tuning, step = settings.localization, settings.localization.turn_step_rad
    most = int(tuning.turn_search_sigmas * math.sqrt(float(view.covariance[2, 2])) / step)
    turns = sorted((k * step for k in range(-most, most + 1)), key=abs)
    tried = [then @ Pose2(0.0, 0.0, turn) for turn in turns]
    predicted = [predict_lines(robot, then, settings.verification).segments_px for then in tried]
    pairs = [_pair(lines, view.segments_px, tuning.coarse_gate_px, tuning) for lines in predicted]
    return tried[int(np.argmax([len(p) for p in pairs]))]


def _solve(
    robot: RobotModel, view: CameraView, then: Pose2, prior: Floats, start: Pose2, settings: Settings
) -> tuple[Pose2, Floats]:
    """The pose at a view, and its covariance: pair and solve, with a coarse and a fine gate.

    Both are those of the prior where there are too few pairs.
    """
    tuning, solved, posterior = settings.localization, start, prior
    for gate_px in (tuning.coarse_gate_px, tuning.fine_gate_px):
        lines = predict_lines(robot, solved, settings.verification)
        pairs = _pair(lines.segments_px, view.segments_px, gate_px, tuning)
        if len(pairs) < tuning.min_pairs:
            break
        model, data = pairs[:, 0], pairs[:, 1]
        fix = planar_from_lines(
            lines.lines_world[model], view.segments_px[data], robot.camera, robot.mount.camera_from_robot, then,
            prior_covariance=prior, landmark_ids=lines.landmark[model].tolist(),
            sigma_px=settings.features.sigma_across_px, settings=settings.pose,
        )
        solved, posterior = fix.world_from_robot, np.asarray(fix.covariance)
    return (then if posterior is prior else solved), posterior


def _pair(lines_px: Floats, segments_px: Floats, gate_px: float, settings: LocalizationSettings) -> Ints:
    """(p, 2) indices of lines (m, 2, 2) and segments (k, 2, 2): each segment along a line, with the nearest one."""
    nearest = _find_nearest(
        np.array(lines_px, float, order="C"), np.array(segments_px, float, order="C"), gate_px,
        math.sin(settings.gate_rad), settings.min_pair_overlap)
    data = np.flatnonzero(nearest >= 0)
    return np.column_stack([nearest[data], data])


@njit(cache=True, error_model="numpy")
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
        visible, matched: numbers of lines that should be in view, over all views, and of those that are found.
        log_likelihood: logarithm of the likelihood ratio of this pose to one drawn by chance.
        explained: part of the length of long segments that lies on a model line, 0..1.
        weakest_view: smallest matched part of the predicted lines of a view that has enough of them, 0..1.
    """

    visible: int
    matched: int
    log_likelihood: float
    explained: float
    weakest_view: float

    def is_sufficient(self, settings: LocalizationSettings = DEFAULT.localization) -> bool:
        """Whether the pose can be accepted.

        Enough lines must be matched, in every view, and the segments be explained, or else the log likelihood be so
        large that the model may lack much of what is seen.
        """
        fraction = self.matched / max(self.visible, 1)
        is_sure = (self.log_likelihood >= settings.sure_log_likelihood
                   and self.matched >= settings.sure_matched_fraction * self.visible)
        is_explained = self.explained >= max(settings.min_explained_fraction, settings.min_fraction_sum - fraction)
        return (self.matched >= settings.min_matched_lines
                and self.matched >= settings.min_matched_fraction * self.visible
                and self.weakest_view >= settings.min_view_fraction and (is_explained or is_sure))

    def __str__(self) -> str:
        return (f"{self.matched} of {self.visible} model lines that should be seen from there are in the pictures,"
                f" and {self.explained:.0%} of what is seen is in the model")


def compute_pose_likelihood(
    robot: RobotModel, views: Sequence[CameraView], world_from_now: Pose2, settings: Settings = DEFAULT
) -> PoseLikelihood:
    """Compute the likelihood of the robot's pose now by all views."""
    tuning = settings.localization
    visible = matched = 0
    terms, weakest, lengths, explained = [0.0], 1.0, 0.0, 0.0
    for view in views:
        then = view.pose_then(world_from_now)
        lines = predict_lines(robot, then, settings.verification).lines_world
        projected = _project(robot, lines, [then, *_displace(then, tuning)])
        agreement = compute_agreement(projected[0], view.segments_px, projected[1:], settings.verification)
        visible, matched = visible + agreement.visible, matched + agreement.matched
        terms.append(compute_log_ratio(agreement.matched, agreement.visible, agreement.chance, tuning))
        if agreement.visible >= tuning.min_view_lines:
            weakest = min(weakest, agreement.matched / agreement.visible)
        length, part = _explain(robot, view, then, settings)
        lengths, explained = lengths + length, explained + part
    part = explained / lengths if lengths > 0.0 else 0.0
    return PoseLikelihood(visible, matched, math.fsum(terms), part, weakest)


def compute_log_ratio(
    matched: int, visible: int, chance: float, settings: LocalizationSettings = DEFAULT.localization
) -> float:
    """Compute the tempered log likelihood ratio of so many matched lines at the right pose and at a wrong one."""
    p, rate = min(max(chance, settings.min_chance), settings.max_chance), settings.detection_rate
    found, missed = math.log(rate / p), math.log((1.0 - rate) / (1.0 - p))
    return settings.line_independence * (matched * found + (visible - matched) * missed)


def _project(robot: RobotModel, lines_world: Floats, poses: Sequence[Pose2]) -> Floats:
    """(p, m, 2, 2) the lines as seen from each pose, NaN where not in view [px]."""
    lines_camera = np.array([robot.camera_from_world(pose).apply(lines_world) for pose in poses])
    seen, _ = robot.camera.project_segments(lines_camera.reshape(-1, 2, 3), Pose.identity())
    return np.asarray(seen.reshape(len(poses), len(lines_world), 2, 2))


def _displace(pose: Pose2, settings: LocalizationSettings) -> list[Pose2]:
    """Sixteen wrong poses around a pose: four directions, two distances, two turns."""
    shifts = [(by * x, by * y) for by in (settings.displacement_m, 2.0 * settings.displacement_m)
              for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    return [pose @ Pose2(x, y, turn) for x, y in shifts for turn in (-settings.displacement_rad,
                                                                     settings.displacement_rad)]


def _explain(robot: RobotModel, view: CameraView, then: Pose2, settings: Settings) -> tuple[float, float]:
    """Length of the long segments, and of the part of them that lies on model lines, also on faint ones [px]."""
    tuning = settings.localization
    length = np.linalg.norm(view.segments_px[:, 1] - view.segments_px[:, 0], axis=1)
    long = length >= tuning.min_explained_length_px
    if not np.any(long):
        return 0.0, 0.0
    shown = visible_lines(
        robot.world, robot.camera, robot.camera_from_world(then), min_length_px=tuning.min_explaining_length_px,
        min_contrast=tuning.min_explaining_contrast, min_separation_px=0.0)
    covered = compute_coverage(
        view.segments_px[long], shown.segments_px, tuning.explained_tolerance_px,
        settings.verification.line_tolerance_rad, settings.verification)
    return float(np.sum(length[long])), float(np.sum(length[long] * covered))
