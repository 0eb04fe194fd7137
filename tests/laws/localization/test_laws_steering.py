"""§5's law on the motion model, without images: correcting the heading alone keeps the position error bounded."""

from __future__ import annotations

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_sources.action.motor import LOOKAHEAD_M
from knowledge_sources.methods.motion import compute_bearing, find_aim_point, measure_progress
from knowledge_sources.methods.motion.pure_pursuit import compute_chord_turn, compute_curvature_to
from world_models.actuator import ActuatorModel, arc
from world_models.entries import Drift, Leg
from world_models.frames import Pose2

ACTUATOR, LOOKAHEAD_M = ActuatorModel(), LOOKAHEAD_M
STEP_M = ACTUATOR.reach * ACTUATOR.increment_m
errors = st.lists(st.tuples(*[st.floats(-1.0, 1.0)] * 4), min_size=20, max_size=60)
"""For each increment: of the believed place, heading, the turn and the curvature, as parts of their bounds."""
SLACK = 1.05
"""The law is stated for small angles."""


def compute_error_bound_m(
    *, increment_m: float, lookahead_m: float, place_m: float, heading_rad: float, curvature_per_m: float
) -> float:
    """Y of the law of pure pursuit: bound of the position error at the ends of increments [m].

    Args:
        place_m, heading_rad: largest error of the believed place, b, and of believed heading and turn together, h + t.
        curvature_per_m: largest error of the estimated drift, k.
    """
    return place_m + lookahead_m * heading_rad + 0.5 * curvature_per_m * increment_m * lookahead_m


def line(length_m: float) -> Leg:
    return Leg("", 0, 0.0, 0.0, length_m, 0.0, 0.01)


@settings(max_examples=60, deadline=None)
@given(
    errors=errors, start_m=st.floats(-0.1, 0.1), start_rad=st.floats(-0.05, 0.05), drift=st.floats(-0.015, 0.015),
    place_m=st.floats(0.0, 0.01), heading_rad=st.floats(0.0, 0.01), curvature=st.floats(0.0, 0.015),
)
def test_correcting_the_heading_alone_keeps_the_position_error_bounded_along_a_segment(
    errors: list[tuple[float, float, float, float]], start_m: float, start_rad: float, drift: float, place_m: float,
    heading_rad: float, curvature: float,
) -> None:
    """|y_n| <= (1 - d/L)^n |y_0| + Y, however long the segment is; ``pure_pursuit`` derives it."""
    leg, here = line(2.0 * STEP_M * len(errors)), Pose2(0.0, start_m, start_rad)
    bound = compute_error_bound_m(increment_m=STEP_M, lookahead_m=LOOKAHEAD_M, place_m=place_m,
                                  heading_rad=2.0 * heading_rad, curvature_per_m=curvature)
    for n, (b, h, t, k) in enumerate(errors, 1):
        believed = Pose2(here.x_m, here.y_m + b * place_m, here.heading_rad + h * heading_rad)
        along, _ = measure_progress(leg, believed)
        turn = compute_chord_turn(compute_bearing(find_aim_point(leg, along, LOOKAHEAD_M), believed), drift, STEP_M)
        here = here @ Pose2(0.0, 0.0, turn + t * heading_rad) @ arc(STEP_M, drift + k * curvature)
        assert abs(here.y_m) <= SLACK * ((1.0 - STEP_M / LOOKAHEAD_M) ** n * abs(start_m) + bound) + 1e-4


@given(drift=st.floats(0.0045, 0.0145))
def test_without_the_turns_the_error_grows_with_the_square_of_the_way(drift: float) -> None:
    """So that the law above is no matter of course; sizes are those of Table 1 (20 feet, 2 to 12 inches)."""
    here, places = Pose2(0.0, 0.0, 0.0), []
    for _ in range(20):
        here = here @ arc(STEP_M, drift)
        places.append(here.y_m)
    assert places[9] > 0.05 and places[19] > 3.5 * places[9]
    assert places[19] > compute_error_bound_m(increment_m=STEP_M, lookahead_m=LOOKAHEAD_M, place_m=0.0, heading_rad=0.0,
                                               curvature_per_m=drift)


@given(x=st.floats(0.5, 3.0), y=st.floats(-0.3, 0.3), heading=st.floats(-0.3, 0.3))
def test_the_arc_that_is_steered_on_the_move_leads_through_its_point(x: float, y: float, heading: float) -> None:
    here = Pose2(0.3, -0.2, heading)
    point = here @ Pose2(x, y, 0.0)
    curvature = compute_curvature_to((point.x_m, point.y_m), here)
    angle = 2.0 * math.atan2(y, x)
    length = math.hypot(x, y) if abs(curvature) < 1e-9 else angle / curvature
    there = here @ arc(length, curvature)
    assert math.hypot(there.x_m - point.x_m, there.y_m - point.y_m) < 1e-6


@given(drift=st.floats(-0.02, 0.02), turns=st.lists(st.floats(-0.02, 0.02), min_size=10, max_size=10))
def test_how_wheels_drift_is_learnt_from_how_the_heading_changes(drift: float, turns: list[float]) -> None:
    known, heading = Drift.unknown(ACTUATOR, 0.3), 0.3
    before = known.sigma_per_m
    for turn in turns:
        heading += turn + drift * STEP_M
        known = known.after_motion(ACTUATOR, turn, ACTUATOR.increment_m).update(ACTUATOR, heading, 3e-4)
        assert known.sigma_per_m <= before
        before = known.sigma_per_m
    assert abs(known.curvature_per_m - drift) <= 0.35 * abs(drift) + 1e-9
    assert abs(known.curvature_per_m - drift) <= 3.0 * known.sigma_per_m


def test_a_push_teaches_nothing_about_the_wheels() -> None:
    known = Drift.unknown(ACTUATOR, 0.0).after_motion(ACTUATOR, 0.0, ACTUATOR.increment_m)
    pushed = known.update(ACTUATOR, 0.3, 3e-4)
    assert pushed.curvature_per_m == 0.0 and pushed.sigma_per_m == ACTUATOR.curvature_sigma_per_m
    assert pushed.heading_rad == 0.3 and pushed.gone_m == 0.0
