"""Laws of rivals: a pose that repeats itself within the prior is found, and nothing wrong is verified beside it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.perception.locate_camera import PoseVerdict
from experiments.perception.repeats import locate
from experiments.perception.repeats_scenes import CAMERA, RepeatScene, draw_scene
from experiments.perception.rivals import compute_pose_score, find_rivals, find_self_motions, group_lines
from knowledge_sources.methods.matching.pose_pairs import build_camera_parameters
from world_models.frames import Pose

Array = NDArray[np.float64]

PITCH = 0.8
ONE_STAIR_OFF = (15, 36)
"""Seeds of staircases at which a pose one stair off agreed best by its lines alone."""


def build_row(marks: int = 0) -> Array:
    """Seven posts ahead of the camera, in its axes (m, 2, 3), and so many lines that do not repeat."""
    posts = [[[x, -1.0, 6.0], [x, 1.0, 6.0]] for x in PITCH * np.arange(-3, 4)]
    rails = [[[-2.4, y, 6.0], [2.4, y, 6.0]] for y in (-1.0, 1.0)]
    rng = np.random.default_rng(marks)
    own = [[[x, y, 5.0], [x + 0.5, y + 0.4, 5.5]] for x, y in rng.uniform(-0.8, 0.8, (marks, 2))]
    return np.array([*posts, *rails, *own], float)


def see(lines: Array, pose: Pose) -> Array:
    seen, visible = CAMERA.project_segments(lines, pose)
    return np.asarray(seen[visible])


def test_a_pose_one_pitch_away_is_found() -> None:
    parameters = build_camera_parameters(Pose.identity(), np.diag([0.02**2] * 3 + [0.5**2] * 3))
    motions = find_self_motions(build_row(), CAMERA, Pose.identity(), parameters)
    shifts = np.array([pose.translation for pose, _ in motions])
    for away in (PITCH, -PITCH):
        assert np.linalg.norm(shifts - [away, 0.0, 0.0], axis=1).min() < 0.02


def test_no_motion_beyond_the_prior_is_tried() -> None:
    parameters = build_camera_parameters(Pose.identity(), np.diag([0.001**2] * 3 + [0.05**2] * 3))
    assert find_self_motions(build_row(), CAMERA, Pose.identity(), parameters) == []


@pytest.mark.parametrize("marks", [2, 4, 8])
def test_lines_that_do_not_repeat_tell_a_pose_from_its_rivals(marks: int) -> None:
    parameters = build_camera_parameters(Pose.identity(), np.diag([0.02**2] * 3 + [0.5**2] * 3))

    def strongest(lines: Array) -> float:
        rivals = find_rivals(lambda _: lines, see(lines, Pose.identity()), CAMERA, parameters, Pose.identity(), 0.2,
                             same_m=0.2, same_rad=0.04)
        return rivals[0].lead

    assert strongest(build_row(marks)) > strongest(build_row())


def test_lines_that_coincide_count_once() -> None:
    line = np.array([[[10.0, 100.0], [200.0, 110.0]]])
    copies = np.concatenate([line, line + 1.0, line - 1.0])
    assert len(np.unique(group_lines(copies))) == 1
    once, thrice = (compute_pose_score(lines, line, 0.1).log_likelihood for lines in (line, copies))
    assert thrice == pytest.approx(once)


def test_pieces_of_one_line_count_once() -> None:
    pieces = np.array([[[10.0, 100.0], [90.0, 100.0]], [[120.0, 100.0], [200.0, 100.0]]])
    assert len(np.unique(group_lines(pieces))) == 1


def test_a_line_that_is_not_seen_speaks_against_a_pose() -> None:
    seen, missed = np.array([[[10.0, 100.0], [200.0, 110.0]]]), np.array([[[10.0, 300.0], [200.0, 310.0]]])
    with_it = compute_pose_score(np.concatenate([seen, missed]), seen, 0.1)
    assert with_it.log_likelihood < compute_pose_score(seen, seen, 0.1).log_likelihood


@pytest.mark.parametrize("seed", ONE_STAIR_OFF)
def test_a_pose_one_stair_off_is_not_verified(seed: int) -> None:
    scene = draw_scene("stairs", seed)
    before, was_right = locate(scene, with_rivals=False)
    assert before is not None and before.verdict is PoseVerdict.VERIFIED and not was_right  # by 1e-35 and less
    fix, is_right = locate(scene)
    assert fix is not None
    assert is_right or fix.verdict is not PoseVerdict.VERIFIED


def test_the_rival_is_named() -> None:
    lines = build_row()
    scene = RepeatScene("row", PITCH, lines, see(lines, Pose.identity()), Pose.identity(), Pose.identity(),
                        np.diag([0.02**2] * 3 + [0.5**2] * 3))
    fix, _ = locate(scene)
    assert fix is not None and fix.verdict is PoseVerdict.NOT_TESTABLE
    assert fix.rival is not None and "cm" in fix.reason


def test_few_lines_are_never_a_refutation() -> None:
    lines = build_row()[:7]
    scene = RepeatScene("row", PITCH, lines[:5], see(lines[2:4], Pose.identity()), Pose.identity(), Pose.identity(),
                        np.diag([0.01**2] * 3 + [0.02**2] * 3))
    fix, _ = locate(scene)
    assert fix is None or fix.verdict is PoseVerdict.NOT_TESTABLE
