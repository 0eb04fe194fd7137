"""Laws of rivals: where a model repeats itself other poses are found, and nothing wrong is verified beside them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.perception.locate_camera import PoseVerdict
from experiments.perception.repeats import locate
from experiments.perception.repeats_scenes import CAMERA, RepeatScene, draw_scene
from experiments.perception.rivals import compute_pose_score, find_self_motions, project_leaders
from world_models.frames import Pose

Array = NDArray[np.float64]

PITCH = 0.8
STAIRS = (15, 36)
"""Seeds of staircases at which a pose one stair off agrees best by its lines alone."""


def build_row(marks: int = 0) -> Array:
    """Seven posts ahead of the camera, in its axes (m, 2, 3), and so many lines that do not repeat."""
    posts = [[[x, -1.0, 6.0], [x, 1.0, 6.0]] for x in PITCH * np.arange(-3, 4)]
    rails = [[[-2.4, y, 6.0], [2.4, y, 6.0]] for y in (-1.0, 1.0)]
    rng = np.random.default_rng(marks)
    own = [[[x, y, 5.0], [x + 0.5, y + 0.4, 5.5]] for x, y in rng.uniform(-0.8, 0.8, (marks, 2))]
    return np.array([*posts, *rails, *own], float)


def see(lines: Array) -> Array:
    seen, visible = CAMERA.project_segments(lines, Pose.identity())
    return np.asarray(seen[visible])


def build_scene(model: Array, seen: Array, sigma_m: float, shift_m: float = 0.0) -> RepeatScene:
    """A camera at the origin, put down so far to the right."""
    prior = Pose.identity().perturbed(np.zeros(3), [-shift_m, 0.0, 0.0])
    covariance = np.diag([0.02**2] * 3 + [sigma_m**2] * 3)
    return RepeatScene("row", PITCH, model, see(seen), Pose.identity(), prior, covariance)


def count_observations(ends_px: list[list[list[float]]]) -> float:
    """Of lines in the picture, put one metre ahead of the camera."""
    ends = np.array(ends_px)
    lines = np.concatenate([(ends - [CAMERA.cx, CAMERA.cy]) / [CAMERA.fx, CAMERA.fy], np.ones((*ends.shape[:2], 1))], 2)
    leaders = project_leaders(lines, CAMERA, Pose.identity())
    return compute_pose_score(leaders, ends, 0.1).count


@pytest.mark.parametrize("away", [PITCH, -PITCH])
def test_a_pose_one_pitch_away_is_found(away: float) -> None:
    poses, _ = find_self_motions(build_row(), CAMERA, Pose.identity())
    assert min(math.dist(pose.translation, [away, 0.0, 0.0]) for pose in poses) < 0.02


def test_lines_that_coincide_and_pieces_of_one_are_one_observation() -> None:
    line = [[10.0, 100.0], [200.0, 110.0]]
    copy, piece = [[10.0, 102.0], [200.0, 112.0]], [[220.0, 111.0], [400.0, 120.0]]
    other = [[10.0, 300.0], [200.0, 310.0]]
    assert count_observations([line]) == count_observations([line, copy]) == count_observations([line, piece]) == 1.0
    assert count_observations([line, other]) == 2.0


def test_a_line_that_should_be_seen_and_is_not_speaks_against_a_pose() -> None:
    seen, missed = np.array([[[10.0, 100.0], [200.0, 110.0]]]), np.array([[[10.0, 300.0], [200.0, 310.0]]])
    with_it = compute_pose_score(np.concatenate([seen, missed]), seen, 0.1)
    assert with_it.log_likelihood < compute_pose_score(seen, seen, 0.1).log_likelihood


@pytest.mark.parametrize("sigma_m", [0.05, 0.5])
@pytest.mark.parametrize("shift_m", [0.0, PITCH])
def test_a_row_that_may_be_one_pitch_off_is_not_verified_whatever_the_prior_says(
        sigma_m: float, shift_m: float) -> None:
    fix, _ = locate(build_scene(build_row()[1:6], build_row()[:7], sigma_m, shift_m))
    assert fix is None or fix.verdict is not PoseVerdict.VERIFIED


def test_lines_that_do_not_repeat_tell_a_pose_from_its_rivals() -> None:
    fix, is_right = locate(build_scene(build_row(12), build_row(12), 0.1))
    assert fix is not None and fix.verdict is PoseVerdict.VERIFIED and is_right
    plain, _ = locate(build_scene(build_row(), build_row(), 0.1))
    assert plain is not None and plain.verdict is PoseVerdict.NOT_TESTABLE
    assert plain.rival is not None and "cm away" in plain.reason


@pytest.mark.parametrize("seed", STAIRS)
def test_a_pose_one_stair_off_is_not_verified(seed: int) -> None:
    fix, is_right = locate(draw_scene("stairs", seed))
    assert fix is not None
    assert is_right or fix.verdict is not PoseVerdict.VERIFIED


@pytest.mark.parametrize("seed", range(6))
def test_the_right_pose_of_a_box_is_never_refuted(seed: int) -> None:
    fix, is_right = locate(draw_scene("box", seed))
    assert fix is not None and is_right and fix.verdict is not PoseVerdict.REFUTED
