"""Is the robot at this pose, by its lines? Predicted model lines against the segments that were found.

How many predicted lines are matched at the pose is compared with how many are at displaced poses, where they are
matched by chance: a contrario. The binomial tail is the probability that as many are matched at a wrong pose
(Desolneux, Moisan, Morel: From Gestalt Theory to Image Analysis, 2008, ch. 3). How precise a pose from a view would be,
before it is seen, follows from the information matrix of the predicted lines, inverted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np
from scipy.special import betainc, betaln

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.pose import compute_camera_poses, compute_point_jacobian, compute_sigmas_px
from world_models.building.building import Building
from world_models.building.model_errors import LineErrors, exact, find_line_errors
from world_models.camera import Camera
from world_models.compiled import compiled
from world_models.frames import Pose, Pose2
from world_models.robot import RobotModel
from world_models.visibility.lines_and_points import VisibleLines, visible_lines

MIN_LINE_LENGTH_PX = 12.0  # shortest projected model line that is predicted
LINE_TOLERANCE_PX = 2.5
"""Largest distance of a segment from the line that it covers (checked with harvey experiment milestones)."""
MIN_MATCHED_LINES = 6
"""Fewest matched lines by which a milestone is testable (checked with harvey experiment milestones)."""
MIN_LINE_CONTRAST = 0.05  # smallest contrast of a model line that is predicted, 0..1
MAX_LINE_DISTANCE_M = 15.0  # largest distance of a model line that is predicted
CELLS_PER_LINE = 24  # cells into which a line is cut to measure how much of it is covered
MIN_COVERED_FRACTION = 0.5  # covered part from which a line is matched
SHARP_TOLERANCE_PX = 1.0  # distance within which a line is matched sharply, as it is at the right pose
TEST_COUNT = 1e3
"""Resolvable poses within the matcher's reach: the number of tests of the a-contrario count (Desolneux, Moisan and
Morel 2008, ch. 3)."""
CHANCE_BOUNDS = 0.02, 0.95  # of the probability that a line is matched at a wrong pose
DISPLACEMENT_M = 0.35  # shift of the nearer wrong poses at which chance is counted; the farther are at twice as much
DISPLACEMENT_RAD = 0.07  # turn of the nearer wrong poses at which chance is counted; the farther are at twice as much
PATTERN_REACH_PX = 8.0, 32.0  # how far aside it is looked for a pattern: nearer ones are the line's own edges
PATTERN_STEP_PX = 2.0  # of the places aside at which it is looked
MAX_PATTERN_PART = 0.4  # part of the places aside, covered by what the model lacks, from which it is a pattern
FOUND_AND_MISSED = 6.0, 2.0
"""Beta distribution of the part of the predicted lines that a picture shows at the right pose: others are hidden, too
faint, or lost among bricks and planks."""
CERTAINTY_BOUNDS = 0.04, 0.6  # of the chance of a match, as a line counts for or against a pose
LINE_INDEPENDENCE = 0.5  # weight of a line: lines of one thing are seen or missed together (tempered likelihood)
LINE_TOLERANCE_RAD = 0.06  # largest angle between a segment and the line that it covers
MODEL_SIGMAS = 1.0
"""Deviations of an inexact model within which a segment covers a line: more of them let chance cover as much."""
MAX_LINE_WEIGHT_PX = 100.0  # length from which a longer line weighs no more


def predict_lines(
    robot: RobotModel, world_from_robot: Pose2
) -> VisibleLines:
    """Predict the model lines that are long, clear and near enough to be looked for from a pose."""
    return visible_lines(
        robot.world, robot.camera, robot.camera_from_world(world_from_robot),
        min_length_px=MIN_LINE_LENGTH_PX, min_contrast=MIN_LINE_CONTRAST,
        max_distance_m=MAX_LINE_DISTANCE_M,
    )


def find_errors(robot: RobotModel, lines: VisibleLines, unstated_m: float = 0.0) -> LineErrors:
    """How well the model knows lines that it predicts; ``unstated_m``: those of which nothing is stated."""
    marks = [lines.marks[int(i)] for i in lines.landmark]
    return find_line_errors(robot.world, marks, lines.line.tolist(), unstated_m)


def list_names(lines: VisibleLines) -> list[str]:
    """The landmark of each line that it predicts."""
    return [lines.marks[int(i)].name for i in lines.landmark]


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """How many of the predicted lines are matched.

    Attributes:
        coverage: (m,) covered part of each line, 0..1; NaN where the line is not in view.
        visible: number of lines in view.
        matched: number of lines of which enough is covered.
        chance: probability that a line is matched at a wrong pose.
        p_false: probability that as many lines are matched at a wrong pose.
    """

    coverage: Floats
    visible: int
    matched: int
    chance: float
    p_false: float

    def covered_length(self, lengths_px: Floats) -> float:
        """Covered part of the length in view, 0..1, of lines with these lengths (m,)."""
        visible = ~np.isnan(self.coverage)
        length = float(np.sum(lengths_px[visible]))
        return float(np.sum(self.coverage[visible] * lengths_px[visible])) / length if length > 0 else 0.0


def compute_agreement(
    lines_px: Floats, segments_px: Floats, displaced_px: Floats,
    tolerance_px: float | Floats = LINE_TOLERANCE_PX,
) -> Agreement:
    """Compute how well projected lines agree with segments, and how well they would by chance.

    Args:
        lines_px: (m, 2, 2) projected at the pose, NaN where not in view.
        segments_px: (k, 2, 2) found in the picture.
        displaced_px: (p, m, 2, 2) the same lines projected at p wrong poses nearby.
        tolerance_px: how far a segment may lie from the line that it covers, one number or (m,).
    """
    coverage = compute_coverage(lines_px, segments_px, tolerance_px, LINE_TOLERANCE_RAD)
    tolerances = np.broadcast_to(tolerance_px, displaced_px.shape[:2]).reshape(-1)
    displaced = compute_coverage(displaced_px.reshape(-1, 2, 2), segments_px, tolerances, LINE_TOLERANCE_RAD)
    displaced = displaced.reshape(displaced_px.shape[:2])
    visible, matched = _count(coverage, MIN_COVERED_FRACTION)
    visible_there, matched_there = _count(displaced, MIN_COVERED_FRACTION)
    seen = visible_there > 0
    rate = float(np.mean(matched_there[seen] / visible_there[seen])) if np.any(seen) else 1.0
    chance = min(CHANCE_BOUNDS[1], max(CHANCE_BOUNDS[0], rate))
    p_false = compute_p_false(int(matched), int(visible), chance)
    return Agreement(coverage, int(visible), int(matched), chance, p_false)


def compute_p_false(matched: int, visible: int, chance: float) -> float:
    """Compute the probability that so many of the visible lines are matched at a wrong pose (binomial tail)."""
    if not visible:
        return 1.0
    # As scipy.stats.binom.sf to the bit, whose import takes a quarter of a second.
    tail = float(betainc(matched, visible - matched + 1, chance)) if matched else 1.0
    return min(1.0, TEST_COUNT * tail)


def compute_log_ratio(matched: int, visible: int, chance: float) -> float:
    """Compute the tempered log likelihood ratio of so many matched lines at the right pose and at a wrong one.

    How many a picture shows at the right pose is not known beforehand: the likelihood is its mean over what may be.
    """
    p = min(max(chance, CERTAINTY_BOUNDS[0]), CERTAINTY_BOUNDS[1])
    found, missed = LINE_INDEPENDENCE * matched, LINE_INDEPENDENCE * (visible - matched)
    a, b = FOUND_AND_MISSED
    return float(betaln(a + found, b + missed) - betaln(a, b)) - found * math.log(p) - missed * math.log(1.0 - p)


def compute_p_share(matched: int, visible: int, matched_before: int, visible_before: int) -> float:
    """Compute the probability that a picture shows at most so many lines at the right pose.

    The part that pictures show at the right pose is Beta distributed, and learnt from what others showed ``before``.
    """
    a, b = FOUND_AND_MISSED
    a, b = a + LINE_INDEPENDENCE * matched_before, b + LINE_INDEPENDENCE * (visible_before - matched_before)
    k = np.arange(matched + 1)
    logs = betaln(a + k, b + visible - k) - betaln(a, b) - betaln(1 + k, 1 + visible - k)
    return float(np.sum(np.exp(logs))) / (visible + 1)


def find_distinct(
    lines_px: Floats, segments_px: Floats
) -> Mask:
    """Which (m,) of the lines (m, 2, 2) tell of a place: near the others segments (k, 2, 2) lie wherever one looks.

    Bricks, planks and tiles that the model does not have cover a line by accident, wherever it is. The chance of that
    is measured in the picture itself: by how many of the places off the line are covered as well, beyond those that
    the other lines cover by the model.
    """
    expected = lines_px[~np.isnan(lines_px).any(axis=(1, 2))]
    tolerance_px = LINE_TOLERANCE_PX
    found, by_model = (_measure_pattern(lines_px, some, tolerance_px) for some in (segments_px, expected))
    return np.asarray(found - by_model <= MAX_PATTERN_PART)


def take_distinct(segments_px: Floats) -> Floats:
    """The segments (k, 2, 2) of a picture without those of bricks, planks and tiles: near these lie others."""
    segments = np.array(segments_px, float, order="C").reshape(-1, 2, 2)
    return segments[_find_distinct_segments(segments.tobytes(), LINE_TOLERANCE_PX)]


@lru_cache(maxsize=32)  # a lost robot searches with the same pictures again and again
def _find_distinct_segments(segments: bytes, tolerance_px: float) -> Mask:
    segments_px = np.frombuffer(segments).reshape(-1, 2, 2)
    return np.asarray(_measure_pattern(segments_px, segments_px, tolerance_px) <= MAX_PATTERN_PART)


def _measure_pattern(lines_px: Floats, segments_px: Floats, tolerance_px: float) -> Floats:
    """(m,) part of the places off lines (m, 2, 2) at which segments (k, 2, 2) lie."""
    if not len(lines_px):
        return np.zeros(0)
    along = lines_px[:, 1] - lines_px[:, 0]
    aside = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    near, far = PATTERN_REACH_PX
    steps = np.arange(near, far + 1e-9, PATTERN_STEP_PX)
    shifts = np.concatenate([-steps, steps])[:, None, None, None] * aside[None, :, None, :]
    covered = compute_coverage((lines_px + shifts).reshape(-1, 2, 2), segments_px, tolerance_px, LINE_TOLERANCE_RAD)
    return np.asarray(np.mean(covered.reshape(len(shifts), -1) >= MIN_COVERED_FRACTION, axis=0))


def compute_coverage(
    lines_px: Floats, segments_px: Floats, tolerance_px: float | Floats, tolerance_rad: float
) -> Floats:
    """Compute the part (m,) of each line (m, 2, 2) that lies under segments (k, 2, 2) within the tolerances.

    That across a line is one number, or (m,).
    """
    lines, segments = np.array(lines_px, float, order="C"), np.array(segments_px, float, order="C")
    tolerances = np.array(np.broadcast_to(tolerance_px, len(lines)), float, order="C")
    covered: Floats = _cover(lines, segments, tolerances, math.sin(tolerance_rad), CELLS_PER_LINE)
    return covered


def find_tolerances_px(
    robot: RobotModel, lines_world: Floats, errors: LineErrors, world_from_robot: Pose2,
    tolerance_px: float = LINE_TOLERANCE_PX,
) -> Floats:
    """(m,) how far a segment may lie from each line (m, 2, 3) [m, world] that it covers: as the model's errors leave.
    """
    if errors.is_exact:
        return np.full(len(lines_world), tolerance_px)
    mount = robot.mount.camera_from_robot
    sigmas_px = compute_sigmas_px(lines_world, errors, robot.camera, mount, world_from_robot)
    return np.hypot(tolerance_px, MODEL_SIGMAS * sigmas_px)


def _count(coverage: Floats, min_covered: float) -> Any:
    """Numbers of visible and of matched lines along the last axis."""
    return np.count_nonzero(~np.isnan(coverage), axis=-1), np.count_nonzero(coverage >= min_covered, axis=-1)


@compiled
def _cover(lines: Any, segments: Any, tolerances: Any, sine: float, cells: int) -> Any:
    """(m,) part of the cells of each line over which a near and parallel segment lies; NaN where not in view."""
    out = np.empty(len(lines))
    directions = np.empty((len(segments), 2))
    for k in range(len(segments)):
        u, v = segments[k, 1, 0] - segments[k, 0, 0], segments[k, 1, 1] - segments[k, 0, 1]
        size = max(math.hypot(u, v), 1e-9)
        directions[k, 0], directions[k, 1] = u / size, v / size
    for i in range(len(lines)):
        u0, v0 = lines[i, 0, 0], lines[i, 0, 1]
        u, v = lines[i, 1, 0] - u0, lines[i, 1, 1] - v0
        length = max(math.hypot(u, v), 1e-9)
        if not (math.isfinite(u0) and math.isfinite(v0) and math.isfinite(u) and math.isfinite(v)):
            out[i] = math.nan
            continue
        u, v = u / length, v / length
        under = np.zeros(cells, np.bool_)
        for k in range(len(segments)):
            if abs(u * directions[k, 1] - v * directions[k, 0]) > sine:
                continue
            low, high, off = math.inf, -math.inf, 0.0
            for e in range(2):
                x, y = segments[k, e, 0] - u0, segments[k, e, 1] - v0
                off = max(off, abs(x * v - y * u))
                low, high = min(low, x * u + y * v), max(high, x * u + y * v)
            if off <= tolerances[i]:
                for c in range(cells):
                    at = (c + 0.5) / cells * length
                    if low <= at <= high:
                        under[c] = True
        out[i] = np.sum(under) / cells
    return out


@dataclass(frozen=True, slots=True, eq=False)
class LineCheck:
    """What the segments of a picture say of the lines predicted at a pose.

    Attributes:
        agreement: which lines are matched, and how many would be by chance.
        sharp: the same within a pixel.
        coverage: covered part of their length in view, 0..1.
        projected_px: (m, 2, 2) the lines at this pose, NaN where not in view.
    """

    agreement: Agreement
    sharp: Agreement
    coverage: float
    projected_px: Floats


def check_lines(
    robot: RobotModel, lines_world: Floats, segments_px: Floats, world_from_robot: Pose2,
    errors: LineErrors | None = None,
    landmarks: Sequence[str] = (),
) -> LineCheck:
    """Compare model lines (m, 2, 3) [m, world], visible from a pose, with segments (k, 2, 2) of the picture.

    Where the model is inexact, by ``errors``, a segment may lie as much further off: at this pose, and at the wrong
    ones at which chance is counted. And of a thing of which no more is found than by chance one line is asked for: a
    shelf that was moved away is one difference, not thirty missed lines. ``landmarks``: m names, or none.
    """
    state, errors = world_from_robot.vector, errors or exact(len(lines_world))
    projected = _project(robot, lines_world, np.concatenate([state[None], _displace(state)]))
    plain, near = (find_tolerances_px(robot, lines_world, errors, world_from_robot, tolerance_px)
                   for tolerance_px in (LINE_TOLERANCE_PX, SHARP_TOLERANCE_PX))
    if not errors.is_exact:
        found = compute_agreement(projected[0], segments_px, projected[1:], plain)
        projected[:, _find_unasked(robot.world, projected[0], found, landmarks)] = np.nan
    here, displaced = np.split(projected, [1])
    agreement, sharp = (compute_agreement(here[0], segments_px, displaced, tolerances) for tolerances in (plain, near))
    lengths = np.linalg.norm(here[0, :, 1] - here[0, :, 0], axis=1)
    return LineCheck(agreement, sharp, agreement.covered_length(lengths), here[0])


def _find_unasked(building: Building, lines_px: Floats, found: Agreement, landmarks: Sequence[str]) -> Mask:
    """Which (m,) of the lines (m, 2, 2) are of things that are not there, but for the longest missed one of each."""
    unasked = np.zeros(len(lines_px), bool)
    missed = found.coverage < MIN_COVERED_FRACTION
    lengths = np.where(missed, np.linalg.norm(lines_px[:, 1] - lines_px[:, 0], axis=1), -1.0)
    for name in filter(partial(_is_thing, building), dict.fromkeys(landmarks)):
        own = np.flatnonzero([one == name for one in landmarks] & ~np.isnan(found.coverage))
        if compute_log_ratio(int(np.count_nonzero(~missed[own])), len(own), found.chance) < 0.0:
            unasked[own] = True
            unasked[own[np.argmax(lengths[own])]] = False
    return unasked


def _is_thing(building: Building, name: str) -> bool:
    """Whether a landmark is a thing, and no wall or door."""
    locale, is_within, _ = name.rpartition("/")
    return bool(is_within) and any(thing.name == name for thing in building.things_of(locale))


def project_lines(robot: RobotModel, lines_world: Floats, world_from_robot: Pose2) -> Floats:
    """(m, 2, 2) the lines (m, 2, 3) [m, world] as seen from a pose, NaN where not in view [px]."""
    return np.asarray(_project(robot, lines_world, world_from_robot.vector[None])[0])


def _project(robot: RobotModel, lines_world: Floats, states: Floats) -> Floats:
    """(p, m, 2, 2) the lines as seen from states (p, 3), world, NaN where not in view [px]."""
    turns, shifts = compute_camera_poses(states, robot.mount.camera_from_robot)
    lines_camera = lines_world.reshape(1, -1, 3) @ np.swapaxes(turns, 1, 2) + shifts[:, None]
    seen, _ = robot.camera.project_segments(lines_camera.reshape(-1, 2, 3), Pose.identity())
    return seen.reshape(len(states), -1, 2, 2)


def _displace(state: Floats) -> Floats:
    """(32, 3) wrong states around a state (x, y, heading): four directions, two distances, four turns."""
    c, s = np.cos(state[2]), np.sin(state[2])
    away = np.array([(by * x, by * y) for by in (DISPLACEMENT_M, 2.0 * DISPLACEMENT_M)
                     for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))])
    turns = DISPLACEMENT_RAD * np.array([-2.0, -1.0, 1.0, 2.0])
    shifts = np.repeat(away @ np.array([[c, s], [-s, c]]), len(turns), axis=0)
    return np.asarray(state + np.column_stack([shifts, np.tile(turns, len(away))]))


EPSILON_INFORMATION = 1e-6
"""Keeps the information matrix invertible where the lines leave a direction open."""


@dataclass(frozen=True, slots=True)
class ViewQuality:
    """Expected standard deviations of a pose from a view.

    Attributes:
        sigma_m: of the position, in its worst direction.
        sigma_rad: of the heading.
        lines: number of model lines.
    """

    sigma_m: float
    sigma_rad: float
    lines: int


def compute_view_quality(
    lines_world: Floats, camera: Camera, camera_from_robot: Pose, world_from_robot: Pose2, sigma_px: float
) -> ViewQuality:
    """Compute the Cramer-Rao bound of the pose from visible model lines (n, 2, 3) [m, world].

    Each end of a line is measured across the line with standard deviation ``sigma_px``. Infinite without lines.
    """
    n = len(lines_world)
    if n == 0:
        return ViewQuality(math.inf, math.inf, 0)
    _, pixels, slopes = compute_point_jacobian(lines_world.reshape(-1, 3), camera, world_from_robot, camera_from_robot)
    along = np.diff(pixels.reshape(n, 2, 2), axis=1)[:, 0]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    rows = np.einsum("nj,nejk->nek", across, slopes.reshape(n, 2, 2, 3)).reshape(-1, 3) / sigma_px
    covariance = np.linalg.inv(rows.T @ rows + EPSILON_INFORMATION * np.eye(3))
    return ViewQuality(
        math.sqrt(float(np.linalg.eigvalsh(covariance[:2, :2])[-1])), math.sqrt(float(covariance[2, 2])), n
    )
