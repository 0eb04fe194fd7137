"""Laws of the plan adjuster: within the plan level's bound the belief becomes the pose of the verified milestone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from blackboard import Entry, Level
from generated_boards import (
    Bench,
    covariances,
    effect_on,
    poses,
    reasons,
    to_world,
)
from harvey.testing import check_source, plain_robot
from knowledge_sources.milestone.plan_adjuster import plan_adjuster
from world_models.entries import Certificate, Discrepancy, Hypothesis, MilestoneVerdict, PoseFix
from world_models.entries.location import Covariance
from world_models.frames import Pose2

SOURCE = plan_adjuster
SLANTED = ((0.04, 0.01, 0.002), (0.01, 0.02, -0.001), (0.002, -0.001, 0.003))


def fix_at(bench: Bench, pose: Pose2, covariance: Covariance) -> Entry[PoseFix]:
    """A pose fix, of a pose and covariance in the hall's frame."""
    turn = to_world(Pose2(0.0, 0.0, 0.0)).heading_rad
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return bench.put(PoseFix("LineMatch-1", to_world(pose), rotation @ np.array(covariance) @ rotation.T,
                             np.ones(0, bool), np.zeros(0), ()))


def certify(bench: Bench, fix: str, verdict: MilestoneVerdict = "verified") -> Entry[Certificate]:
    return bench.put(Certificate("Milestone-1", fix, verdict, "", 9, 9, 9, 0.9, 1.0, 0.0, 0.0, 3.0, 30.0, 0.001, 0.001,
                                 0.006))


@settings(max_examples=40)
@given(poses, covariances)
def test_the_belief_is_the_pose_in_the_frame_of_its_locale_and_the_doubt_ends(
    pose: Pose2, spread: Covariance
) -> None:
    covariance = np.array(SLANTED) + np.array(spread)
    bench = Bench(plain_robot())
    belief, doubt = bench.believe(motion="MotionReport-7"), bench.doubt(Level.PLAN, 3.0)
    fix = fix_at(bench, pose, tuple(map(tuple, covariance.tolist())))
    certificate = certify(bench, fix.id)
    effects = bench.ask(SOURCE, certificate)
    change, end = effect_on(effects, Hypothesis), effect_on(effects, Discrepancy)
    here = change.value
    assert change.entry.id == belief.id
    assert (here.locale, here.basis, here.status, here.motion) == ("hall", "milestone", "held", "MotionReport-7")
    own = here.locale_from_robot
    assert (own.x_m, own.y_m, own.heading_rad) == pytest.approx((pose.x_m, pose.y_m, pose.heading_rad), abs=1e-9)
    assert np.allclose(here.covariance, covariance, atol=1e-12)
    assert reasons(change) == {certificate.id, fix.id, belief.id} and reasons(end) == {"Hypothesis"}
    assert end.entry.id == doubt.id and end.value == replace(doubt.value, status="corrected")
    bench.apply(*effects or ())
    assert bench.ask(SOURCE, certificate) is None


@pytest.mark.parametrize(("magnitude", "acts"), [(None, True), (29.999, True), (30.0, True), (30.001, False)])
def test_beyond_the_bound_the_level_above_decides(magnitude: float | None, acts: bool) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    certificate = certify(bench, fix_at(bench, Pose2(2.0, 2.0, 0.0), SLANTED).id)
    assert bench.ask(SOURCE, certificate) is None  # nothing differs
    bench.doubt(Level.PLAN, magnitude)
    assert (bench.ask(SOURCE, certificate) is not None) == acts


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.doubt(Level.PLAN, 3.0)
    check_source(SOURCE, bench, certify(bench, fix_at(bench, Pose2(2.0, 2.0, 0.0), SLANTED).id), without=("PoseFix-1",))
