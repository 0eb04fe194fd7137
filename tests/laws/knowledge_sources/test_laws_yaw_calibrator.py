"""Laws of the yaw calibrator: when a way tells of the yaw, how much, on which side, and what turns with it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Effect, Entry
from generated_boards import INEXACT, Bench, effect_on, made, reasons
from harvey.testing import check_source, house, plain_robot
from knowledge_sources.methods.calibration import (
    LEAST_SIGMA_RAD,
    SIGMA_CENTRE_PX,
    SIGMA_FOCAL,
    SIGMA_HEIGHT_M,
    SIGMA_ROLL_RAD,
    SIGMA_TILT_RAD,
    SIGMA_YAW_RAD,
)
from knowledge_sources.senses.yaw_calibrator import (
    HEADING_SIGMA_RAD,
    MAX_TRAVEL_M,
    MAX_YAW_SIGMAS,
    MIN_LEARNT,
    MIN_STRAIGHTNESS,
    MIN_TRAVEL_M,
    YawCalibrator,
)
from world_models.camera import CAMERA_UNKNOWNS, YAW
from world_models.entries import CameraState, Drift, Hypothesis, Travel, covariance_tuple, diagonal
from world_models.frames import Pose2

SURE = diagonal(0.002, 0.001)
PRIOR = SIGMA_YAW_RAD**2
FORWARD_M = 0.12
SMALL = 1e-6


class Way(NamedTuple):
    """A board on which the robot has come a way, and what was made of it."""

    bench: Bench
    belief: Entry[Hypothesis]
    effects: tuple[Effect, ...] | None

    @property
    def camera(self) -> CameraState | None:
        found = made(self.effects, CameraState)
        return found[0] if found else None


def come(
    off_rad: float, length_m: float = 4.0, *, course_rad: float = 0.7, gone_m: float | None = None,
    is_broken: bool = False, variance: float = PRIOR, learnt: float | None = None, slip_m2: float = 0.0,
    modes: tuple[str, ...] = (), covariance: tuple[tuple[float, float, float], ...] = SURE, yaw_rad: float = 0.0,
    has_drift: bool = True, turn_rad: float = 0.0, believed_rad: float = 0.0,
) -> Way:
    """The robot came so far to the left of where the wheels and its headings say, in direction; seen from its begin."""
    bench = Bench(plain_robot())
    camera = bench.view["CameraState-1"]
    bench.revise(camera, mount=replace(camera.value.mount, yaw_rad=believed_rad))
    if learnt is not None:
        known = np.diag([1e-4, 1e-4, learnt, 1e-4, 1e-4, 1e-2, 1e-2])
        bench.revise(bench.view["CameraState-1"], covariance=tuple(map(tuple, known.tolist())))
    began = Pose2(4.0, -1.0, course_rad)
    x_m, y_m = length_m * math.cos(course_rad), length_m * math.sin(course_rad)
    bench.put(Travel(began, covariance, yaw_rad, variance, x_m, y_m, gone_m or length_m, 0.0, course_rad + turn_rad,
                     slip_m2, is_broken))
    if has_drift:
        bench.put(Drift(0.001, 0.004, course_rad))
    if modes:
        bench.await_milestone(status="verified", **(INEXACT if modes else {}))
    there = Pose2(began.x_m + length_m * math.cos(course_rad + off_rad),
                  began.y_m + length_m * math.sin(course_rad + off_rad), course_rad + turn_rad)
    belief = bench.put(Hypothesis.of_world(house(), "hall", there, np.array(covariance), "milestone"))
    belief = bench.revise(belief, evidence="a milestone")
    return Way(bench, belief, bench.ask(YawCalibrator(), belief))


def compute_noise(length_m: float, slip_m2: float) -> float:
    """Variance of the direction of a straight way: both ends aside, slip, heading at its begin, and on it."""
    return ((2 * 0.002**2 + slip_m2) / length_m**2 + 0.001**2 + HEADING_SIGMA_RAD**2 / length_m)


@settings(max_examples=60)
@given(st.floats(-0.05, 0.05), st.floats(1.1, 9.0), st.floats(-3.1, 3.1), st.floats(0.0, 1e-3), st.floats(-0.02, 0.02),
       st.floats(-0.02, 0.02))
def test_the_yaw_is_the_mean_of_what_was_known_and_what_the_way_says(
    off: float, length_m: float, course: float, slip_m2: float, yaw: float, believed: float
) -> None:
    way = come(off, length_m, course_rad=course, slip_m2=slip_m2, yaw_rad=yaw, believed_rad=believed)
    noise, camera = compute_noise(length_m, slip_m2), way.camera
    told = believed - off  # came to the left of where it heads: the heading is too small, the yaw too large
    if abs(told - yaw) > MAX_YAW_SIGMAS * math.sqrt(PRIOR + noise):
        assert camera is None
        return
    gain = PRIOR / (PRIOR + noise)
    if gain < MIN_LEARNT + SMALL:
        return
    assert camera is not None
    learnt = (yaw / PRIOR + told / noise) / (1 / PRIOR + 1 / noise)
    assert camera.mount.yaw_rad == pytest.approx(learnt, abs=1e-9)
    covariance = np.array(camera.covariance)
    assert covariance[YAW, YAW] == pytest.approx(max(1 / (1 / PRIOR + 1 / noise), LEAST_SIGMA_RAD**2))
    assert np.count_nonzero(covariance - np.diag(np.diag(covariance))) == 0
    others = [k for k in range(len(CAMERA_UNKNOWNS)) if k != YAW]
    told_state = CameraState(camera.lens, camera.mount)
    for k, sigma in zip(others, (SIGMA_TILT_RAD, SIGMA_ROLL_RAD, SIGMA_HEIGHT_M, SIGMA_FOCAL,
                                 SIGMA_CENTRE_PX, SIGMA_CENTRE_PX), strict=True):
        assert covariance[k, k] == pytest.approx(sigma**2)
    assert camera.lens == told_state.lens and replace(camera.mount, yaw_rad=believed) == camera.nominal_mount


@settings(max_examples=40)
@given(st.floats(-0.04, 0.04), st.floats(1.5, 9.0))
def test_the_camera_stays_where_it_was_and_looks_where_it_looked(off: float, length_m: float) -> None:
    """The robot's heading turns against the camera's yaw, about the camera; the drift's heading turns with it."""
    way = come(off, length_m)
    assert way.camera is not None
    step = way.camera.mount.yaw_rad
    before = way.belief.value.world_from_robot(house())
    effect = effect_on(way.effects, Hypothesis)
    after, drift = effect.value.world_from_robot(house()), effect_on(way.effects, Drift).value
    eyes = [(p.x_m + FORWARD_M * math.cos(p.heading_rad), p.y_m + FORWARD_M * math.sin(p.heading_rad))
            for p in (before, after)]
    assert math.dist(*eyes) < 1e-9
    assert after.heading_rad + step == pytest.approx(before.heading_rad)
    assert drift.heading_rad == pytest.approx(0.7 - step) and drift.curvature_per_m == 0.001
    assert (effect.value.basis, effect.value.motion) == ("milestone", way.belief.value.motion)
    assert effect.value.covariance == pytest.approx(np.array(way.belief.value.covariance))


@settings(max_examples=30)
@given(st.floats(-0.03, 0.03), st.floats(1.5, 9.0), st.floats(1.0, 4.0))
def test_the_way_goes_on_by_the_turned_headings_until_it_is_spent(off: float, length_m: float, bent: float) -> None:
    gone_m = length_m * (1.0 if bent < 2.0 else 1.0 / (MIN_STRAIGHTNESS - SMALL))
    way = come(off, length_m, gone_m=gone_m)
    effect = effect_on(way.effects, Travel)
    travel = effect.value
    assert reasons(effect) == {"Travel-1", way.belief.id}
    if bent >= 2.0:  # nothing was measured, and another way begins
        assert way.camera is None and travel.gone_m == 0.0 and (travel.x_m, travel.y_m) == (0.0, 0.0)
        here = way.belief.value.world_from_robot(house())
        assert np.allclose((travel.began.x_m, travel.began.y_m), here.position)
        assert travel.yaw_variance == pytest.approx(PRIOR)
        return
    assert way.camera is not None
    step = way.camera.mount.yaw_rad
    assert travel.gone_m == gone_m and travel.heading_rad == pytest.approx(0.7 - step)
    assert np.allclose((travel.x_m, travel.y_m), (length_m * math.cos(0.7 - step), length_m * math.sin(0.7 - step)))


@pytest.mark.parametrize("part", [0.5, 0.9, 4.0])
def test_no_yaw_is_known_better_than_a_camera_can_be(part: float) -> None:
    camera, least = come(0.0, 9.0, variance=part * LEAST_SIGMA_RAD**2).camera, LEAST_SIGMA_RAD**2
    assert camera is not None
    gain = part * least / (part * least + compute_noise(9.0, 0.0))
    assert camera.covariance[YAW][YAW] == pytest.approx(max((1.0 - gain) * part * least, least))



def test_what_is_told_rests_on_the_way_and_where_it_ended() -> None:
    way = come(0.01)
    named = {kind.__name__: reasons(effect_on(way.effects, kind)) for kind in (CameraState, Hypothesis, Drift)}
    assert named == {"CameraState": {"Travel-1", way.belief.id, "CameraState-1"}, "Hypothesis": {way.belief.id},
                     "Drift": {"Drift-1"}}
    assert not made(come(0.01, has_drift=False).effects, Drift)


@pytest.mark.parametrize("more", [-SMALL, SMALL])
def test_the_bounds_of_a_way_that_tells(more: float) -> None:
    assert (come(0.01, MIN_TRAVEL_M + more).camera is not None) == (more > 0.0)
    straight = come(0.01, 4.0, gone_m=4.0 / (MIN_STRAIGHTNESS + more))
    assert (straight.camera is not None) == (more > 0.0)
    widest = MAX_YAW_SIGMAS * math.sqrt(PRIOR + compute_noise(4.0, 0.0))
    for side in (1.0, -1.0):
        assert (come(side * (widest + more)).camera is not None) == (more < 0.0)


@pytest.mark.parametrize("more", [-1e-3, 1e-3])
def test_it_learns_where_the_variance_shrinks_enough(more: float) -> None:
    noise = compute_noise(4.0, 0.0)
    after = 1 / (1 / PRIOR + 1 / noise)
    known = after / (1.0 - MIN_LEARNT) * (1.0 + more)
    assert (come(0.01, learnt=known).camera is not None) == (more > 0.0)


def test_only_what_is_open_aside_of_the_way_leaves_the_yaw_open() -> None:
    """The same places, known less well along the way, or across it."""
    variances = []
    for course_rad in (0.0, math.pi / 2.0):
        bench, ends = Bench(plain_robot()), np.diag([0.05**2, 0.002**2, 0.001**2])
        length_m = 4.0
        bench.put(Travel(Pose2(0.0, 0.0, course_rad), covariance_tuple(ends), 0.0, PRIOR,
                         length_m * math.cos(course_rad), length_m * math.sin(course_rad), length_m, 0.0, course_rad))
        there = Pose2(length_m * math.cos(course_rad), length_m * math.sin(course_rad), course_rad)
        belief = bench.put(Hypothesis.of_world(house(), "hall", there, ends, "milestone"))
        (camera,) = made(bench.ask(YawCalibrator(), bench.revise(belief)), CameraState)
        variances.append(camera.covariance[YAW][YAW])
    for variance, aside_m in zip(variances, (0.002, 0.05), strict=True):
        noise = 2 * aside_m**2 / 16.0 + 0.001**2 + HEADING_SIGMA_RAD**2 / 4.0
        assert variance == pytest.approx(1 / (1 / PRIOR + 1 / noise), rel=1e-6)


def test_a_way_that_is_too_long_is_measured_and_another_begins_with_the_yaw_as_it_was_learnt() -> None:
    assert made(come(0.0, MAX_TRAVEL_M - SMALL).effects, Travel)[0].gone_m > 0.0
    way = come(0.01, MAX_TRAVEL_M + SMALL)
    (travel,) = made(way.effects, Travel)
    assert way.camera is not None and way.camera.mount.yaw_rad < -0.005
    assert travel.yaw_rad == pytest.approx(way.camera.mount.yaw_rad) and travel.gone_m == 0.0
    assert travel.yaw_variance == pytest.approx(1 / (1 / PRIOR + 1 / compute_noise(MAX_TRAVEL_M, 0.0)), rel=1e-4)
    (turned,) = made(way.effects, Hypothesis)  # and where the robot is by the turned headings
    here = turned.world_from_robot(house())
    assert travel.began.distance_to(here) < 1e-9
    assert travel.heading_rad == travel.began.heading_rad == pytest.approx(here.heading_rad)


def test_a_short_bent_way_is_not_spent_yet() -> None:
    assert come(0.01, 0.5, gone_m=MIN_TRAVEL_M - SMALL).effects is None
    (travel,) = made(come(0.01, 0.5, gone_m=MIN_TRAVEL_M + SMALL).effects, Travel)
    assert travel.gone_m == 0.0


def test_a_broken_way_tells_nothing_and_another_begins() -> None:
    way = come(0.01, is_broken=True)
    (effect,) = way.effects or ()
    assert isinstance(effect.value, Travel) and not effect.value.is_broken and effect.value.gone_m == 0.0
    assert way.camera is None


def test_it_keeps_the_laws_of_all_sources() -> None:
    way = come(0.01)
    assert come(0.01, modes=("wall",)).effects is None  # an inexact model tells nothing
    check_source(YawCalibrator, way.bench, way.belief, without=("Travel-1", "CameraState-1"))
