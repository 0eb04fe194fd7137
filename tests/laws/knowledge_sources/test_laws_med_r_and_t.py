"""Laws of Med-R-and-T: lines tell from where they were seen, outliers are named, and it says how sure it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Entry
from generated_boards import Bench, effect_on, mirrored, reasons, to_world
from harvey.testing import check_source, plain_robot
from knowledge_sources.methods.calibration import (
    SIGMA_ROLL_RAD,
    SIGMA_TILT_RAD,
    SIGMA_YAW_RAD,
    compute_camera_covariance,
    loosen,
    widen,
)
from knowledge_sources.methods.calibration.model_evidence import MAX_LOG_RATIO
from knowledge_sources.milestone import med_r_and_t
from knowledge_sources.milestone.med_r_and_t import MedRAndT
from knowledge_sources.milestone_selector.view_predictor import ViewPredictor
from world_models.building.model_errors import MEASURED_M
from world_models.camera import CAMERA_UNKNOWNS, move_camera
from world_models.entries import Evidence, LineMatch, Milestone, PoseFix, diagonal
from world_models.frames import Pose2

SOURCE, ROBOT, BELIEF = MedRAndT(), plain_robot(), Pose2(2.0, 1.6, 0.15)
SIGMA_M, SIGMA_RAD = 0.05, 0.02
FOCAL_STEP, TILT_STEP = (by * np.array([name == of for of in CAMERA_UNKNOWNS], float)
                         for name, by in (("focal", 0.04), ("tilt_rad", 0.03)))
MAX_CHI2 = 21.1
"""Of three unknowns: 99.99 % are below."""
offs = st.builds(Pose2, st.floats(-0.06, 0.06), st.floats(-0.06, 0.06), st.floats(-0.02, 0.02))


def match_lines(
    belief: Pose2, truth: Pose2, *, noise_px: float = 0.0, wrong: int = 0, seed: int = 0,
    walls_m: float = 0.0, camera: Sequence[float] = (0.0,) * 7, basis: str = "milestone",
) -> tuple[Bench, Entry[LineMatch], Entry[Milestone]]:
    """A board on which each expected line is matched to where it is truly seen; the first few wrongly.

    ``walls_m``: deviation of walls and doors from the model. ``camera``: its step from what is believed.
    """
    bench, rng = Bench(ROBOT), np.random.default_rng(seed)
    bench.believe(belief, diagonal(SIGMA_M, SIGMA_RAD), basis=basis)
    milestone = bench.await_milestone(look_heading_rad=to_world(belief).heading_rad)
    expected = bench.apply(effect_on(bench.ask(ViewPredictor(), milestone), Milestone))[0].entry
    lines = np.array(expected.value.expected)
    errors = expected.value.errors
    there = errors.displace(lines, walls_m / MEASURED_M * rng.uniform(0.7, 1.3, len(errors.displacement_modes))
                            * rng.choice((-1.0, 1.0), len(errors.displacement_modes)))
    lens, mount = move_camera(ROBOT.camera, ROBOT.mount, camera)
    seen = lens.project_segments(there, mount.camera_from_robot @ to_world(truth).lifted().inverse())[0]
    seen = np.where(np.isfinite(seen), seen, np.array(expected.value.expected_px))
    seen = seen + rng.normal(0.0, noise_px, seen.shape)
    seen[:wrong] += (25.0, -18.0)
    pairs = np.column_stack([np.arange(len(lines))] * 2)
    return bench, bench.put(LineMatch(expected.id, "Segments-1", pairs, lines, seen, 0.0, np.ones(len(lines))),
                            expected), expected


def solve(bench: Bench, match: Entry[LineMatch]) -> PoseFix:
    found: PoseFix = effect_on(bench.ask(SOURCE, match), PoseFix).value
    return found


def off_by(fix: PoseFix, truth: Pose2) -> np.ndarray:
    there = to_world(truth)
    turn = math.remainder(fix.world_from_robot.heading_rad - there.heading_rad, math.tau)
    return np.array([fix.world_from_robot.x_m - there.x_m, fix.world_from_robot.y_m - there.y_m, turn])


def measure_chi2(fix: PoseFix, truth: Pose2) -> float:
    """The squared error over the stated covariance: the belief and the camera are not known better than that."""
    error = off_by(fix, truth)
    return float(error @ np.linalg.solve(fix.covariance, error))


@settings(max_examples=12, deadline=None)
@given(offs)
def test_lines_tell_the_pose_from_which_they_were_seen(off: Pose2) -> None:
    bench, match, _ = match_lines(BELIEF, BELIEF @ off)
    fix = solve(bench, match)
    assert measure_chi2(fix, BELIEF @ off) < MAX_CHI2
    assert np.all(np.abs(off_by(fix, BELIEF @ off)) < (0.04, 0.04, 0.004))
    assert fix.match == match.id and np.all(fix.inliers) and not any(fix.rejected)


@settings(max_examples=8, deadline=None)
@given(offs)
def test_what_is_seen_in_a_mirror_is_solved_as_in_a_mirror(off: Pose2) -> None:
    truth = BELIEF @ off
    plain, other = (solve(*match_lines(belief, there)[:2]) for belief, there in (
        (BELIEF, truth), (mirrored(BELIEF), mirrored(truth))))
    one, two = off_by(plain, truth), off_by(other, mirrored(truth))
    assert np.hypot(*one[:2]) == pytest.approx(np.hypot(*two[:2]), abs=2e-3)
    assert one[2] == pytest.approx(-two[2], abs=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_pairs_that_are_wrong_are_named_and_do_not_count(seed: int) -> None:
    truth = BELIEF @ Pose2(0.03, -0.02, 0.01)
    bench, match, _ = match_lines(BELIEF, truth, noise_px=0.3, wrong=5, seed=seed)
    fix = solve(bench, match)
    assert not np.any(fix.inliers[:5]) and all(fix.rejected[:5])
    assert np.mean(fix.inliers[5:]) > 0.85
    assert measure_chi2(fix, truth) < MAX_CHI2


def test_it_is_no_surer_than_it_may_be() -> None:
    """Squared errors over the stated covariance, of 30 noisy pictures: three unknowns, 3 in the mean and no 25."""
    chi2 = []
    for seed in range(30):
        rng = np.random.default_rng(1000 + seed)
        truth = BELIEF @ Pose2(*rng.normal(0.0, (0.02, 0.02, 0.006)))
        bench, match, _ = match_lines(BELIEF, truth, noise_px=0.6, seed=seed)
        fix = solve(bench, match)
        chi2.append(measure_chi2(fix, truth))
    assert np.mean(chi2) < 6.0 and max(chi2) < MAX_CHI2


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 1000), st.booleans(), st.sampled_from(("chance", "wall", "focal length", "mounting")))
def test_a_model_that_is_wrong_is_not_blamed_on_the_camera_nor_a_camera_on_the_model(
    seed: int, is_mirrored: bool, cause: str
) -> None:
    """The rival that is true explains the picture best, also in a mirror; what is learnt of the camera is right."""
    step = {"focal length": FOCAL_STEP, "mounting": TILT_STEP}.get(cause, np.zeros(7))
    belief = mirrored(BELIEF) if is_mirrored else BELIEF
    bench, match, _ = match_lines(belief, belief @ Pose2(0.01, 0.005, 0.002), noise_px=0.3, seed=seed,
                                  walls_m=0.06 * (cause == "wall"), camera=tuple(step))
    effects = bench.ask(SOURCE, match)
    told = [e.value for e in effects if isinstance(e.value, Evidence)]
    assert cause == "wall" or bool(told) == (cause != "chance")
    for evidence in told:
        assert max(evidence.explanations, key=lambda e: e.log_ratio).kind == cause
        assert all(0.0 <= e.log_ratio <= MAX_LOG_RATIO for e in evidence.explanations)
    fix = effect_on(effects, PoseFix).value
    if fix.camera_step:  # else nothing is learnt, as the model is likelier wrong
        assert np.all(np.abs(fix.camera_step - step) < 4.0 * np.sqrt(np.diag(fix.camera_covariance)) + 1e-6)
    assert fix.camera_step or cause == "wall"
    assert [e.value for e in bench.ask(SOURCE, match) if isinstance(e.value, Evidence)] == told


@pytest.mark.parametrize("counted", ["never", "here", "elsewhere", "another way"])
@pytest.mark.parametrize("is_open", [False, True])
def test_the_camera_is_moved_by_a_picture_that_has_not_counted_and_adds_what_is_open_of_it(
    counted: str, is_open: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The covariance is that of a camera as it is, and by its slopes what is left open of the camera."""
    bench, match, _ = match_lines(BELIEF, BELIEF @ Pose2(0.03, -0.02, 0.01), noise_px=0.3)
    here = to_world(BELIEF)
    looks = {"here": here, "elsewhere": Pose2(here.x_m + 0.5, here.y_m, here.heading_rad),
             "another way": Pose2(here.x_m, here.y_m, here.heading_rad - 0.4)}
    if counted != "never":
        pose = looks[counted]
        bench.revise(bench.view["CameraState-1"], counted=((pose.x_m, pose.y_m, pose.heading_rad),))
    match = bench.revise(match, is_camera_open=is_open)
    found: dict[str, Any] = {}
    for name in ("estimate_camera_and_pose", "planar_from_lines"):
        plain = getattr(med_r_and_t, name)
        monkeypatch.setattr(med_r_and_t, name, lambda *given, _n=name, _p=plain, **named: found.setdefault(
            _n, (given, _p(*given, **named)))[1])
    fix = solve(bench, match)
    (given, learnt), (used, planar) = found["estimate_camera_and_pose"], found["planar_from_lines"]
    camera = bench.view["CameraState-1"].value
    known = compute_camera_covariance(camera)
    opened = known + np.diag(np.square((SIGMA_TILT_RAD, SIGMA_ROLL_RAD, SIGMA_YAW_RAD, 0.0, 0.0, 0.0, 0.0)))
    assert np.allclose(given[6], opened if is_open else known)
    assert given[5][2, 2] - loosen(bench.view["Hypothesis-1"].value.covariance_world(ROBOT.world))[2, 2] == (
        pytest.approx(SIGMA_YAW_RAD**2 if is_open else 0.0))
    moves = is_open or counted != "here"
    assert fix.camera_step == (tuple(learnt.step.tolist()) if moves else ())
    assert (fix.camera_covariance != ()) == moves and fix.camera_chi2 == (learnt.prior_chi2 if moves else 0.0)
    mount = (camera.moved(learnt.step.tolist()) if moves else camera).mount
    assert used[3].angle_to(mount.camera_from_robot) < 1e-9
    widened = widen(learnt, to_world(BELIEF), bench.view["Hypothesis-1"].value.covariance_world(ROBOT.world))
    open_of_it = widened if moves else known
    assert not moves or np.allclose(fix.camera_covariance, open_of_it)
    assert np.allclose(fix.covariance, planar.covariance + learnt.pose_slopes @ open_of_it @ learnt.pose_slopes.T)


def test_each_line_is_of_its_own_landmark_whichever_segment_shows_it(
    monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, match, milestone = match_lines(BELIEF, BELIEF)
    kept = np.arange(len(match.value.pairs))[::-1][:-3]
    pairs = np.column_stack([kept, np.roll(kept, 5)])
    given: dict[str, Any] = {}
    plain = med_r_and_t.planar_from_lines
    monkeypatch.setattr(med_r_and_t, "planar_from_lines", lambda *lines, **named: given.update(named) or plain(
        *lines, **named))
    solve(bench, bench.put(replace(match.value, pairs=pairs, lines_world=match.value.lines_world[kept],
                                   segments_px=match.value.segments_px[kept], coverage=np.ones(len(kept)))))
    assert given["landmark_ids"] == [milestone.value.landmark_of[i] for i in kept]


@pytest.mark.parametrize("basis", ["command", "odometry", "tracks", "milestone", "relocalization"])
def test_only_a_robot_that_was_just_put_down_cannot_have_been_pushed(basis: str) -> None:
    levels = [solve(*match_lines(BELIEF, BELIEF, noise_px=0.3, basis=of)[:2]).protection for of in (basis, "milestone")]
    assert levels[0] < levels[1] if basis == "command" else levels[0] == levels[1]


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench, match, milestone = match_lines(BELIEF, BELIEF)
    effects = check_source(SOURCE, bench, match, without=(milestone.id,))
    assert reasons(effects[0]) == {match.id, milestone.id, "Hypothesis-1"}
