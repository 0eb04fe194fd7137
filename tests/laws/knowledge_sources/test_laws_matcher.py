"""Laws of matcher and Med-R-and-T: lines seen from a pose are matched each to its own, and tell that pose."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from blackboard import Entry
from generated_boards import Bench, effect_on, mirrored, reasons, to_world
from harvey.testing import check_source, plain_robot
from knowledge_sources.methods.belief import MAX_CAMERA_CHI2
from knowledge_sources.methods.calibration.camera_state import (
    PRIOR_COVARIANCE_FACTOR,
    PRIOR_SIGMA_M,
    PRIOR_SIGMA_RAD,
    SIGMA_ROLL_RAD,
    SIGMA_TILT_RAD,
    SIGMA_YAW_RAD,
)
from knowledge_sources.methods.localization import camera_matching
from knowledge_sources.methods.localization.camera_matching import CameraMatch
from knowledge_sources.milestone import matcher
from knowledge_sources.milestone.matcher import MAX_RIGID_SIGMA_PX, MIN_KNOCK_GAIN, MIN_SHARP_PART, Matcher
from knowledge_sources.milestone.med_r_and_t import MedRAndT
from knowledge_sources.milestone_selector.view_predictor import ViewPredictor
from world_models.entries import LineMatch, Milestone, PoseFix, Segments, diagonal
from world_models.entries.location import Covariance
from world_models.entries.task import MilestoneStatus
from world_models.frames import Pose2
from world_models.robot import RobotModel

MATCHER, SOLVER, ROBOT = Matcher(), MedRAndT(), plain_robot()
BELIEF = Pose2(2.0, 1.6, 0.15)
OFFS = [Pose2(0.0, 0.0, 0.0), Pose2(0.04, 0.03, 0.008), Pose2(-0.03, 0.05, -0.01)]


KNOWN = tuple(map(tuple, np.diag(np.square((1e-3, 1e-3, 2e-3, 3e-3, 2e-3, 0.5, 0.5))).tolist()))
"""The covariance of a camera that is well known, but for what may knock it."""
FIRM = diagonal(0.03, 0.008)


def look(belief: Pose2, truth: Pose2, knock: tuple[float, ...] | None = None,
         spread: Covariance = FIRM) -> tuple[Bench, Entry[Segments], Entry[Milestone]]:
    """A board with the lines that are expected from the believed pose, and those seen from the true one; hall frame.

    ``knock``: by how much a well known camera is turned since, (tilt, roll, yaw); by default it is not well known.
    """
    bench, robot = Bench(ROBOT), ROBOT
    bench.believe(belief, spread)
    if knock is not None:
        camera = bench.revise(bench.view["CameraState-1"], covariance=KNOWN).value.moved((*knock, 0.0, 0.0, 0.0, 0.0))
        robot = RobotModel(ROBOT.world, camera.pinhole, camera.mount, ROBOT.actuator)
    milestone = bench.await_milestone(look_heading_rad=to_world(belief).heading_rad)
    expected = bench.apply(effect_on(bench.ask(ViewPredictor(), milestone), Milestone))[0].entry
    lines = np.array(expected.value.expected)
    seen = robot.camera.project_segments(lines, robot.camera_from_world(to_world(truth)))[0]
    assert np.isfinite(seen).all()
    return bench, bench.put(Segments("CameraPicture-1", expected.id, seen, np.full(len(seen), 0.3), 40.0)), expected


@pytest.mark.parametrize("off", OFFS)
@pytest.mark.parametrize("is_mirrored", [False, True])
def test_each_line_is_matched_to_its_own_and_all_tell_the_pose(off: Pose2, is_mirrored: bool) -> None:
    belief, truth = BELIEF, BELIEF @ off
    if is_mirrored:
        belief, truth = mirrored(belief), mirrored(truth)
    bench, segments, milestone = look(belief, truth)
    matched = effect_on(bench.ask(MATCHER, segments), LineMatch)
    match = matched.value
    assert (match.milestone, match.segments) == (milestone.id, segments.id)
    assert reasons(matched) == {segments.id, milestone.id, "Hypothesis-1"}
    right = np.mean(match.pairs[:, 0] == match.pairs[:, 1])
    assert len(match.pairs) >= 0.8 * len(milestone.value.expected) and right > 0.9
    lines = np.array(milestone.value.expected)
    assert np.array_equal(match.lines_world, lines[match.pairs[:, 0]])
    assert np.array_equal(match.segments_px, segments.value.segments_px[match.pairs[:, 1]])
    entry = bench.apply(matched)[0].entry
    solved = effect_on(bench.ask(SOLVER, entry), PoseFix)
    here, there = solved.value.world_from_robot, to_world(truth)
    assert math.hypot(here.x_m - there.x_m, here.y_m - there.y_m) < 0.02
    assert abs(math.remainder(here.heading_rad - there.heading_rad, math.tau)) < 0.005
    assert solved.value.match == entry.id and reasons(solved) == {entry.id, milestone.id, "Hypothesis-1"}
    assert len(solved.value.inliers) == len(solved.value.rejected) == len(match.pairs)
    assert np.all(np.linalg.eigvalsh(solved.value.covariance) > 0.0)


def solve(bench: Bench, segments: Entry[Segments]) -> tuple[LineMatch, PoseFix]:
    """What matcher and solver make of segments."""
    match = bench.apply(effect_on(bench.ask(MATCHER, segments), LineMatch))[0].entry
    return match.value, effect_on(bench.ask(SOLVER, match), PoseFix).value


@pytest.mark.parametrize("off", OFFS)
@pytest.mark.parametrize("knock", [(0.0, 0.0, 0.0), (0.03, 0.0, 0.0), (-0.03, 0.0, 0.0), (0.03, 0.01, -0.05),
                                   (-0.02, -0.02, 0.05)])
def test_a_camera_that_was_knocked_is_found_out_and_the_pose_with_it(off: Pose2, knock: tuple[float, ...]) -> None:
    """Its tilt and roll are solved for; a turn of it is taken for the robot's, as nothing in the picture differs."""
    truth = BELIEF @ off
    match, fix = solve(*look(BELIEF, truth, knock)[:2])
    assert match.is_camera_open == any(knock)
    assert np.mean(match.pairs[:, 0] == match.pairs[:, 1]) > 0.9
    assert np.allclose(fix.camera_step[:3] or (0.0,) * 3, (*knock[:2], 0.0), atol=1e-3)
    there = to_world(truth)
    assert fix.world_from_robot.distance_to(there) < 0.015
    turned = math.remainder(fix.world_from_robot.heading_rad - there.heading_rad, math.tau)
    assert turned == pytest.approx(knock[2], abs=3e-3)


@pytest.mark.parametrize("kept", [0.45, 0.6, 1.0])
def test_where_lines_are_missing_or_the_belief_was_bold_no_camera_was_knocked(kept: float) -> None:
    """So much more must agree with another camera; that a pose is three deviations off is no such thing."""
    bench, segments, _ = look(BELIEF, BELIEF @ Pose2(0.03, -0.03, 0.01), (0.0, 0.0, 0.0), diagonal(0.01, 0.0035))
    seen = segments.value.segments_px
    few = bench.put(replace(segments.value, segments_px=seen[:math.ceil(kept * len(seen))],
                            sigma_px=segments.value.sigma_px[:math.ceil(kept * len(seen))]))
    match, fix = solve(bench, few)
    assert not match.is_camera_open and len(match.pairs) >= 0.8 * kept * len(seen)
    assert fix.world_from_robot.distance_to(to_world(BELIEF @ Pose2(0.03, -0.03, 0.01))) < 0.02


@pytest.mark.parametrize(("sharp", "chi2", "gain", "asks", "is_open"), [
    (MIN_SHARP_PART, MAX_CAMERA_CHI2, 0.4, False, False), (MIN_SHARP_PART - 1e-9, 0.0, MIN_KNOCK_GAIN, True, True),
    (MIN_SHARP_PART - 1e-9, 0.0, MIN_KNOCK_GAIN - 1e-6, True, False),
    (1.0, MAX_CAMERA_CHI2 + 1e-6, MIN_KNOCK_GAIN, True, True), (1.0, MAX_CAMERA_CHI2 + 1e-6, -0.1, True, False)])
def test_what_is_asked_before_a_camera_is_taken_for_knocked(
    sharp: float, chi2: float, gain: float, asks: bool, is_open: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The belief is loosened as a prior of lines, its heading as the camera's yaw is open; both sides of each bound."""
    asked: dict[str, Any] = {}
    match, other = (SimpleNamespace(pairs=np.zeros((0, 2), np.int64), e_match=error, coverage=0.0)
                    for error in (1.0, 2.0))
    monkeypatch.setattr(matcher, "rate_match", lambda *given: asked.update(rate=given) or CameraMatch(  # type: ignore[arg-type]
        match, 9, sharp, chi2))
    monkeypatch.setattr(matcher, "match_with_camera", lambda *given: asked.update(knock=given) or CameraMatch(
        other, 9, sharp + gain, 0.0))
    bench, segments, _ = look(BELIEF, BELIEF, (0.0, 0.0, 0.0))
    made = effect_on(bench.ask(MATCHER, segments), LineMatch).value
    assert (made.is_camera_open, made.error) == (is_open, 2.0 if is_open else 1.0)  # the pairs of the better one
    assert ("knock" in asked) == asks
    belief = bench.view["Hypothesis-1"].value
    plain = belief.covariance_world(ROBOT.world)
    more = np.diag(np.square((PRIOR_SIGMA_M, PRIOR_SIGMA_M, PRIOR_SIGMA_RAD)))
    assert asked["rate"][5] == to_world(BELIEF) and np.allclose(
        asked["rate"][6], PRIOR_COVARIANCE_FACTOR * plain + more) and np.allclose(asked["rate"][7], KNOWN)
    if asks:
        turns = np.square((SIGMA_TILT_RAD, SIGMA_ROLL_RAD, SIGMA_YAW_RAD))
        assert np.allclose(asked["knock"][5], plain + np.diag([0.0, 0.0, turns[2]]))
        assert np.allclose(asked["knock"][6], np.array(KNOWN) + np.diag([*turns, 0.0, 0.0, 0.0, 0.0]))


@pytest.mark.parametrize("agreeing", [(48, 64, 59), (9, 9, 7), (0, 0, 0)])
def test_of_several_focal_lengths_the_one_is_taken_with_which_most_pairs_agree(
    agreeing: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lines that are covered a little better, by pairs of which more are wrong, do not outweigh that."""
    tried = [CameraMatch(object(), count, 0.9 - 0.01 * k, 0.0) for k, count in enumerate(agreeing)]  # type: ignore[arg-type]
    left = iter(tried)
    monkeypatch.setattr(camera_matching, "match_in_space", lambda *_, **__: None)
    monkeypatch.setattr(camera_matching, "rate_match", lambda *_: next(left))
    lines = np.zeros((1, 2, 3))
    found = camera_matching.match_with_camera(
        lines, lines[..., :2], ROBOT.camera, ROBOT.mount, to_world(BELIEF), np.eye(3), 1e-4 * np.eye(7))
    assert found is tried[agreeing.index(max(agreeing))]


@pytest.mark.parametrize("more", [-0.02, 0.02])
@pytest.mark.parametrize("by_heading", [0.0, 0.5, 1.0])
def test_up_to_so_many_pixels_the_lines_are_one_figure_and_beyond_a_pose_on_the_floor(
    more: float, by_heading: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the belief leaves open of a thing 2.5 m away, by place and heading together."""
    px = MAX_RIGID_SIGMA_PX * (1.0 + more) / ROBOT.camera.fx
    sigma_rad, sigma_m = px * math.sqrt(by_heading), 2.5 * px * math.sqrt(1.0 - by_heading)
    asked = []
    for name in ("match_lines", "match_on_floor"):
        plain = getattr(matcher, name)
        monkeypatch.setattr(matcher, name, lambda *given, _n=name, _p=plain: asked.append(_n) or _p(*given))
    spread = diagonal(max(sigma_m, 1e-6), max(sigma_rad, 1e-6))
    bench, segments, _ = look(BELIEF, BELIEF, (0.0, 0.0, 0.0), spread)
    match, _ = solve(bench, segments)
    assert asked == ["match_lines" if more < 0.0 else "match_on_floor"] and len(match.pairs) > 10


@pytest.mark.parametrize("seed", [0, 1])
def test_the_order_of_the_segments_does_not_matter(seed: int) -> None:
    bench, segments, _ = look(BELIEF, BELIEF @ OFFS[1], (0.0, 0.0, 0.0))
    order = np.random.default_rng(seed).permutation(len(segments.value.segments_px))
    other = replace(segments.value, segments_px=segments.value.segments_px[order])
    (one, fix), (two, again) = solve(bench, segments), solve(bench, bench.put(other))
    assert {(i, order[k]) for i, k in two.pairs.tolist()} == {tuple(pair) for pair in one.pairs.tolist()}
    assert again.world_from_robot.distance_to(fix.world_from_robot) < 1e-6
    assert np.allclose(again.covariance, fix.covariance, rtol=1e-3)


def test_what_is_expected_of_nothing_matches_nothing() -> None:
    bench = Bench(ROBOT)
    bench.believe()
    milestone = bench.await_milestone(status="expected")
    segments = bench.put(Segments("CameraPicture-1", milestone.id, np.ones((3, 2, 2)), np.ones(3), 40.0))
    match = effect_on(bench.ask(MATCHER, segments), LineMatch).value
    assert match.pairs.shape == (0, 2) and len(match.lines_world) == len(match.segments_px) == 0
    assert match.error == 0.0 and not match.is_camera_open and len(match.coverage) == 0


@pytest.mark.parametrize("status", ["turning", "expected", "verified", "withdrawn"])
@pytest.mark.parametrize("has_belief", [True, False])
def test_only_a_milestone_whose_picture_is_taken_is_matched(status: MilestoneStatus, has_belief: bool) -> None:
    bench = Bench(ROBOT)
    if has_belief:
        bench.believe()
    milestone = bench.await_milestone(status=status)
    segments = bench.put(Segments("CameraPicture-1", milestone.id, np.ones((3, 2, 2)), np.ones(3), 40.0))
    assert (bench.ask(MATCHER, segments) is not None) == (status == "expected" and has_belief)


def test_it_keeps_the_laws_of_all_sources() -> None:
    check_source(MATCHER, *look(BELIEF, BELIEF)[:2], without=("Milestone-1",))
