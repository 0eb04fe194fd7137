"""Laws of matcher and Med-R-and-T: lines seen from a pose are matched each to its own, and tell that pose."""

from __future__ import annotations

import math

import numpy as np
import pytest

from blackboard.change import Posted
from blackboard.entry import Entry
from generated_boards import Bench, effect_on, mirrored, plain_robot, reasons, to_world, wakes
from knowledge_sources.plan.matcher import Matcher
from knowledge_sources.plan.med_r_and_t import MedRAndT
from knowledge_sources.plan.view_predictor import ViewPredictor
from world_models.entries.location import diagonal
from world_models.entries.percepts import LineMatch, PoseFix, Segments
from world_models.entries.task import Milestone, MilestoneStatus
from world_models.frames import Pose2

MATCHER, SOLVER, ROBOT = Matcher(), MedRAndT(), plain_robot()
BELIEF = Pose2(2.0, 1.6, 0.15)
OFFS = [Pose2(0.0, 0.0, 0.0), Pose2(0.04, 0.03, 0.008), Pose2(-0.03, 0.05, -0.01)]


def look(belief: Pose2, truth: Pose2) -> tuple[Bench, Entry[Segments], Entry[Milestone]]:
    """A board with the lines that are expected from the believed pose, and those seen from the true one; hall frame."""
    bench = Bench(ROBOT)
    bench.believe(belief, diagonal(0.03, 0.008))
    milestone = bench.await_milestone(look_heading_rad=to_world(belief).heading_rad)
    expected = bench.apply(effect_on(bench.ask(ViewPredictor(), milestone), Milestone))[0].entry
    lines = np.array(expected.value.expected)
    seen = ROBOT.camera.project_segments(lines, ROBOT.camera_from_world(to_world(truth)))[0]
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


def test_what_is_expected_of_nothing_matches_nothing() -> None:
    bench = Bench(ROBOT)
    bench.believe()
    milestone = bench.await_milestone(status="expected")
    segments = bench.put(Segments("CameraPicture-1", milestone.id, np.ones((3, 2, 2)), np.ones(3), 40.0))
    match = effect_on(bench.ask(MATCHER, segments), LineMatch).value
    assert match.pairs.shape == (0, 2) and len(match.lines_world) == len(match.segments_px) == 0


@pytest.mark.parametrize("status", ["turning", "expected", "verified", "withdrawn"])
@pytest.mark.parametrize("has_belief", [True, False])
def test_only_a_milestone_whose_picture_is_taken_is_matched(status: MilestoneStatus, has_belief: bool) -> None:
    bench = Bench(ROBOT)
    if has_belief:
        bench.believe()
    milestone = bench.await_milestone(status=status)
    segments = bench.put(Segments("CameraPicture-1", milestone.id, np.ones((3, 2, 2)), np.ones(3), 40.0))
    assert (bench.ask(MATCHER, segments) is not None) == (status == "expected" and has_belief)


def test_what_they_watch() -> None:
    bench = Bench()
    for milestone in ("", "Milestone-1"):
        segments = bench.put(Segments("CameraPicture-1", milestone, np.zeros((0, 2, 2)), np.zeros(0), 40.0))
        assert wakes(MATCHER, Posted(segments)) == bool(milestone)
