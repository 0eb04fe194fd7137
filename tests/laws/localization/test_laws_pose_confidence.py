"""Laws of the judge's evidence: it is a set of lines and faces, and more of it never makes a pose less sure."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from experiments.generated.floors import generated_floor
from experiments.perception.milestones_calibrate import fit_weights, remove_colors
from knowledge_sources.methods.verification import (
    EVIDENCE_NAMES,
    LINE_TOLERANCE_PX,
    POSE_CONFIDENCE,
    TERMS,
    Agreement,
    PoseEvidence,
    check_colors,
    check_lines,
    compute_evidence,
    compute_terms,
    find_errors,
    list_names,
    predict_color_check,
    predict_face_colors,
    predict_lines,
    predict_milestone,
)
from knowledge_sources.methods.verification.color_check import NOT_TESTED, ColorCheck
from knowledge_sources.methods.verification.pose_confidence import P_REPAINTED, compute_motion_tolerance_px
from sim.render.renderer import Renderer
from sim.scenario import CameraSettings
from world_models.actuator import ActuatorModel
from world_models.entries import Milestone
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frames import Pose2
from world_models.robot import RobotModel

PARTS = st.floats(0.0, 1.0)
COUNTS = st.floats(1.0, 6.0)
EVIDENCE = st.builds(PoseEvidence, PARTS, PARTS, PARTS, PARTS, COUNTS)
SPREAD = np.diag([0.01, 0.01, 0.005]) ** 2


@cache
def _robot() -> RobotModel:
    settings_ = CameraSettings()
    return RobotModel(generated_floor(4, 2).world, settings_.camera, settings_.mount, ActuatorModel())


def _place() -> Pose2:
    corners = _robot().world.outline("corridor-0")
    x, y = corners.mean(axis=0)
    return Pose2(float(x), float(y), 0.2)


@cache
def _lines() -> np.ndarray:
    milestone = predict_milestone(_robot(), _place(), Milestone("", 0, "", 0.2))
    return np.array(milestone.expected)


def _segments(pose: Pose2) -> np.ndarray:
    robot = _robot()
    return np.nan_to_num(robot.camera.project_segments(_lines(), robot.camera_from_world(pose))[0], nan=-99.0)


def _evidence(lines: np.ndarray, segments: np.ndarray, pose: Pose2, faces: ColorCheck = NOT_TESTED) -> PoseEvidence:
    robot = _robot()
    checked = check_lines(robot, lines, segments, pose)
    return compute_evidence(pose, SPREAD, _place(), SPREAD, checked, faces)


@given(EVIDENCE, st.sampled_from(EVIDENCE_NAMES), st.floats(0.0, 0.5))
def test_more_evidence_never_makes_a_pose_less_certain(found: PoseEvidence, name: str, more: float) -> None:
    values = dict(zip(EVIDENCE_NAMES, found.values.tolist(), strict=True))
    values[name] += more
    assert POSE_CONFIDENCE.p_false(PoseEvidence(**values)) <= POSE_CONFIDENCE.p_false(found) + 1e-15


@given(EVIDENCE)
def test_the_probability_is_one_and_the_limits_are_in_order(found: PoseEvidence) -> None:
    assert 0.0 <= POSE_CONFIDENCE.p_false(found) <= 1.0
    assert 0.0 < POSE_CONFIDENCE.accept < POSE_CONFIDENCE.refute < 1.0


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_order_of_lines_and_segments_does_not_matter(seed: int) -> None:
    lines, segments, rng = _lines(), _segments(_place()), np.random.default_rng(seed)
    there = Pose2(_place().x_m + 0.02, _place().y_m, _place().heading_rad)
    mixed = _evidence(lines[rng.permutation(len(lines))], segments[rng.permutation(len(segments))], there)
    assert mixed.values == pytest.approx(_evidence(lines, segments, there).values, abs=1e-9)


def test_the_right_pose_is_more_certain_than_those_around_it() -> None:
    faces = ColorCheck(8, 1.0, 0.2, is_testable=True)
    here = POSE_CONFIDENCE.p_false(_evidence(_lines(), _segments(_place()), _place(), faces))
    for x, y, turn in ((0.3, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.1), (-0.5, 0.2, 0.05)):
        there = _place() @ Pose2(x, y, turn)
        assert POSE_CONFIDENCE.p_false(_evidence(_lines(), _segments(_place()), there, faces)) > 10.0 * here


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(1.3, 0.9 * LINE_TOLERANCE_PX))
def test_only_what_is_found_within_a_pixel_is_evidence(seed: int, off_px: float) -> None:
    """A segment beside its line, within what the matcher allows, covers it; but a right pose has it nearer."""
    rng, lines, segments = np.random.default_rng(seed), _lines(), _segments(_place())
    along = segments[:, 1] - segments[:, 0]
    aside = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    beside = segments + (off_px * rng.choice((-1.0, 1.0), len(segments)))[:, None, None] * aside[:, None, :]
    exact, near = (check_lines(_robot(), lines, found, _place()) for found in (segments, beside))
    assert near.agreement.matched == exact.agreement.matched == exact.sharp.matched
    assert near.sharp.matched < 0.5 * exact.sharp.matched  # but for others that lie there by chance
    values, worse = _evidence(lines, segments, _place()), _evidence(lines, beside, _place())
    assert worse.coverage < 0.5 * values.coverage
    assert POSE_CONFIDENCE.p_false(worse) > 100.0 * POSE_CONFIDENCE.p_false(values)


def test_the_tolerance_grows_with_the_covariance_of_the_motion() -> None:
    small, large = (compute_motion_tolerance_px(_robot(), _lines(), _place(), factor * SPREAD) for factor in (1.0, 9.0))
    assert 0.0 < small < large
    assert large == pytest.approx(3.0 * small)
    assert compute_motion_tolerance_px(_robot(), _lines()[:0], _place(), SPREAD) == 0.0


def test_the_fit_separates_right_from_wrong_with_no_negative_weight() -> None:
    rng = np.random.default_rng(0)
    right = rng.random(400) < 0.5
    found = rng.random((400, len(EVIDENCE_NAMES)))
    found[:, 0] = np.clip(0.3 + 0.4 * right + rng.normal(0.0, 0.1, 400), 0.0, 1.0)
    found[:, 1] = np.clip(0.7 - 0.4 * right + rng.normal(0.0, 0.1, 400), 0.0, 1.0)  # speaks against: must count nothing
    weights = fit_weights(found, right)
    assert len(weights.each) == len(TERMS) == compute_terms(found).shape[1]
    assert min(weights.each) >= 0.0 and weights.each[1] == 0.0
    assert np.mean((weights.p_false(found) < 0.5) == right) > 0.9
    colors = [EVIDENCE_NAMES.index(name) for name in ("color_agreement", "color_count")]
    assert not remove_colors(found)[:, colors].any()


@cache
def _picture() -> np.ndarray:
    robot = _robot()
    return Renderer.of_faces(robot.world.faces, 4).image(robot.camera, robot.camera_from_world(_place()))


@pytest.mark.parametrize("gain", [(1.0, 1.0, 1.0), (0.4, 0.4, 0.4), (1.3, 1.15, 1.2)])
def test_faces_have_the_models_colours_in_any_light(gain: tuple[float, float, float]) -> None:
    robot, looks = _robot(), predict_face_colors(_robot(), _place())
    lit = np.clip(_picture() * np.array(gain), 0.0, 255.0).astype(np.uint8)
    found = check_colors(robot, _place(), lit, looks)
    assert found.is_testable and found.agreeing >= 0.7 and found.agreeing > found.chance + 0.3


def test_faces_of_other_colours_do_not_agree() -> None:
    robot, looks = _robot(), predict_face_colors(_robot(), _place())
    strange = [((blue, 1.0 - red, green), points) for (red, green, blue), points in looks]
    right = check_colors(robot, _place(), _picture(), looks)
    assert check_colors(robot, _place(), _picture(), strange).agreeing < right.agreeing - 0.2


def test_one_colour_everywhere_is_not_testable() -> None:
    looks = predict_face_colors(_robot(), _place())
    same = [((0.5, 0.5, 0.5), points) for _, points in looks]
    assert not predict_color_check(same).is_testable
    assert predict_color_check(looks).agreeing == 1.0 and predict_color_check(looks).is_testable
    assert not check_colors(_robot(), _place(), _picture(), []).is_testable


def test_predicted_points_are_in_view() -> None:
    robot = _robot()
    points = np.array([p for _, some in predict_face_colors(robot, _place()) for p in some])
    pixels = robot.camera.project(robot.camera_from_world(_place()).apply(points))
    assert robot.camera.inside(pixels).all()
    assert math.isfinite(float(points.sum())) and len(points) > 10


@given(st.tuples(*[st.floats(-0.03, 0.03)] * 3), st.floats(0.005, 0.05), st.floats(0.005, 0.05))
@settings(max_examples=20, deadline=None)
def test_a_pose_is_near_the_belief_by_what_both_leave_open(
    off: tuple[float, float, float], own: float, believed: float
) -> None:
    """In standard deviations of the difference, of which both have their part; it is the same which has which."""
    robot, belief, lines = _robot(), _place(), _lines()
    pose = Pose2(belief.x_m + off[0], belief.y_m + off[1], belief.heading_rad + off[2])
    segments = _segments(belief)
    check = check_lines(robot, lines, segments, pose)
    spreads = [np.diag([own, own, 0.5 * own]) ** 2, np.diag([believed, believed, 0.2 * believed]) ** 2]
    one, other = (compute_evidence(pose, a, belief, b, check, NOT_TESTED).proximity
                  for a, b in (spreads, spreads[::-1]))
    sigmas = math.sqrt(sum(o * o / (spreads[0][k, k] + spreads[1][k, k]) for k, o in enumerate(off)))
    assert one == pytest.approx(other) == pytest.approx(1.0 - min(sigmas, 6.0) / 6.0, abs=1e-6)


def test_a_thing_that_is_not_there_is_one_line_that_is_missed_where_the_model_is_inexact() -> None:
    """All is seen but one thing of many lines; walls and doors that are not seen are missed line by line."""
    world, camera = read_world(Source.parse(f"sigma_cm = 5\n{generated_floor(4, 2).text}", "floor")), CameraSettings()
    robot = RobotModel(world, camera.camera, camera.mount, ActuatorModel())
    lines = predict_lines(robot, _place())
    errors, names = find_errors(robot, lines), list_names(lines)
    fixed = np.array([world.landmark(name).kind in ("wall", "door", "doorway") for name in names])

    def count(gone: np.ndarray, landmarks: list[str]) -> Agreement:
        return check_lines(robot, lines.lines_world, lines.segments_px[~gone], _place(), errors=errors,
                           landmarks=landmarks).agreement

    things = [name for name, is_fixed in zip(names, fixed, strict=True) if not is_fixed]
    gone = np.array([name == max(things, key=things.count) for name in names])
    by_line, by_thing = count(gone, []), count(gone, names)
    assert np.count_nonzero(gone) >= 3 and by_line.visible == len(lines)
    assert by_line.visible - by_thing.visible == np.count_nonzero(gone) - 1
    assert not np.isnan(count(fixed, names).coverage[fixed]).any()


@given(EVIDENCE)
def test_colours_speak_against_a_pose_by_no_more_than_that_it_may_be_painted(evidence: PoseEvidence) -> None:
    """What the lines say with paint that is another, or lines and colours together: what speaks less against it."""
    by_lines, by_both = (float(weights.p_false(evidence.values[None])[0])
                         for weights in (POSE_CONFIDENCE.lines_only, POSE_CONFIDENCE.lines_and_colors))
    odds = by_lines / (1.0 - by_lines) / P_REPAINTED
    painted, found = odds / (1.0 + odds), POSE_CONFIDENCE.p_false(evidence)
    event("painted" if painted < by_both else "as in the model")
    assert found == pytest.approx(min(painted, by_both)) and found <= painted + 1e-12 and found <= by_both + 1e-12
