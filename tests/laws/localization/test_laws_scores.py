"""Laws of what a view is worth: the deviations that it promises and the odds of its lines, against scipy's numbers."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import approx_fprime
from scipy.stats import bernoulli, binom

from experiments.perception import rivals
from experiments.perception.rivals import compute_line_odds, compute_pose_score, group_lines
from knowledge_sources.methods.localization import refinement
from knowledge_sources.methods.localization.refinement import compute_log_ratio
from knowledge_sources.methods.verification.line_check import (
    EPSILON_INFORMATION,
    LINE_TOLERANCE_RAD,
    compute_coverage,
    compute_view_quality,
)
from knowledge_sources.settings import DEFAULT
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0))
MOUNT = CameraMount(1.0, 0.1)
Floats = NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)
some = settings(max_examples=60, deadline=None)


def draw_lines_ahead(rng: np.random.Generator, pose: Pose2, count: int) -> Floats:
    """(count, 2, 3) lines of any direction in front of the robot [m, world]."""
    foot = np.stack([rng.uniform(2.0, 6.0, count), rng.uniform(-1.0, 1.0, count), rng.uniform(0.3, 1.5, count)], axis=1)
    lines = np.stack([foot, foot + rng.uniform(-0.6, 0.6, (count, 3))], axis=1)
    return np.asarray(pose.lifted().apply(lines))


def draw_crossing_lines(rng: np.random.Generator, count: int) -> Floats:
    """(count, 2, 2) lines in the picture, many of them nearly on the extension of another [px]."""
    leaders = rng.uniform(100.0, 400.0, (3, 2, 2))
    lines = leaders[rng.integers(0, 3, count)]
    along = rng.uniform(-0.5, 1.5, (count, 2, 1))
    lines = lines[:, :1] + along * (lines[:, 1:] - lines[:, :1]) + rng.normal(0.0, 2.0, (count, 2, 2))
    lines[rng.random(count) < 0.1] = np.nan
    return np.asarray(lines)


@some
@given(seed=seeds, count=st.integers(1, 12), sigma_px=st.floats(0.2, 3.0))
def test_a_view_promises_the_bound_of_its_lines_by_finite_differences(seed: int, count: int, sigma_px: float) -> None:
    rng = np.random.default_rng(seed)
    pose = Pose2(*rng.uniform(-5.0, 5.0, 2), rng.uniform(-math.pi, math.pi))
    lines = draw_lines_ahead(rng, pose, count)

    def project(state: Floats) -> Floats:
        return CAMERA.project((MOUNT.camera_from_robot @ Pose2(*state).lifted().inverse()).apply(lines))

    state = np.array([pose.x_m, pose.y_m, pose.heading_rad])
    along = np.diff(project(state), axis=1)[:, 0]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    slopes = approx_fprime(state, lambda s: np.einsum("nej,nj->ne", project(s), normal).ravel(), 1e-7)
    covariance = np.linalg.inv(slopes.T @ slopes / sigma_px**2 + EPSILON_INFORMATION * np.eye(3))
    found = compute_view_quality(lines, CAMERA, MOUNT.camera_from_robot, pose, sigma_px)
    worst = math.sqrt(np.linalg.norm(covariance[:2, :2], 2))
    assert found.lines == count
    if worst < 50.0:  # what no line fixes is left to rounding
        assert math.isclose(found.sigma_m, worst, rel_tol=1e-2)
        assert math.isclose(found.sigma_rad, math.sqrt(covariance[2, 2]), rel_tol=1e-2)


@some
@given(seed=seeds, count=st.integers(0, 30))
def test_lines_on_one_line_of_the_picture_are_one_observation(seed: int, count: int) -> None:
    """Against plain angles and distances: the longest leads, the first leader in whose reach a line lies takes it."""
    lines = draw_crossing_lines(np.random.default_rng(seed), count)
    lengths = [math.dist(*line) for line in lines]
    leaders: list[int] = []
    expected = np.full(count, -1)
    for i in sorted((i for i in range(count) if not math.isnan(lengths[i])), key=lambda i: (-lengths[i], i)):
        own = math.atan2(*(lines[i, 1] - lines[i, 0])[::-1])
        for g, k in enumerate(leaders):
            angle = math.atan2(*(lines[k, 1] - lines[k, 0])[::-1])
            across = np.array([-math.sin(angle), math.cos(angle)])
            turn = abs((own - angle + 0.5 * math.pi) % math.pi - 0.5 * math.pi)
            off = np.abs((lines[i] - lines[k, 0]) @ across)
            if turn <= rivals.SAME_LINE_RAD and np.all(off <= rivals.SAME_LINE_PX):
                expected[i] = g
                break
        else:
            expected[i] = len(leaders)
            leaders.append(i)
    assert np.array_equal(group_lines(lines), expected)


@some
@given(seed=seeds, count=st.integers(1, 25), chance=st.floats(0.0, 1.0))
def test_the_score_of_a_pose_is_that_of_its_observations(seed: int, count: int, chance: float) -> None:
    """Each group counts once, by the covered part of its length, and fully from a certain length on."""
    tuning, rng = DEFAULT.verification, np.random.default_rng(seed)
    lines, segments = draw_crossing_lines(rng, count), draw_crossing_lines(rng, 10)
    segments = np.concatenate([segments[~np.isnan(segments[:, 0, 0])], lines[~np.isnan(lines[:, 0, 0])][::2]])
    score = compute_pose_score(lines, segments, chance)
    p = min(max(chance, rivals.MIN_SCORE_CHANCE), rivals.MAX_SCORE_CHANCE)
    odds = [float(bernoulli.logpmf(k, rivals.DETECTION_RATE) - bernoulli.logpmf(k, p)) for k in (1, 0)]
    assert np.allclose(compute_line_odds(chance), odds)
    covered = compute_coverage(lines, segments, tuning.line_tolerance_px, LINE_TOLERANCE_RAD)
    total, groups = 0.0, group_lines(lines)
    for group in range(int(groups.max()) + 1):
        members = np.flatnonzero(groups == group)
        lengths = np.array([math.dist(*lines[i]) for i in members])
        part = float(np.average(covered[members], weights=lengths))
        total += min(1.0, lengths.sum() / rivals.FULL_LINE_PX) * (part * odds[0] + (1.0 - part) * odds[1])
    assert score.count == int(groups.max()) + 1 and np.array_equal(score.groups, groups)
    assert math.isclose(score.log_likelihood, rivals.LINE_INDEPENDENCE * total, rel_tol=1e-9, abs_tol=1e-9)


@some
@given(visible=st.integers(0, 60), part=st.floats(0.0, 1.0), chance=st.floats(0.0, 1.0))
def test_matched_lines_are_worth_their_binomial_odds(visible: int, part: float, chance: float) -> None:
    matched = round(part * visible)
    p = min(max(chance, refinement.MIN_CHANCE), refinement.MAX_CHANCE)
    odds = binom.logpmf(matched, visible, refinement.DETECTION_RATE) - binom.logpmf(matched, visible, p)
    assert math.isclose(compute_log_ratio(matched, visible, chance), refinement.LINE_INDEPENDENCE * odds, abs_tol=1e-7)
