"""Laws of the correction monitor: pictures that stand still or lag, wheels that err and a push are told apart."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from blackboard import Entry
from generated_boards import Bench, made, reasons
from harvey.testing import check_source, plain_robot
from knowledge_sources.methods.belief import hedge, weigh_rivals
from knowledge_sources.reads import add_reports
from knowledge_sources.reads.motion_between import WHEELS_PART
from knowledge_sources.senses import correction_monitor as own
from knowledge_sources.senses.correction_monitor import correction_monitor
from world_models.actuator import ActuatorModel
from world_models.entries import (
    SHARED_SIGMA_M,
    CameraPicture,
    Certificate,
    Drift,
    Evidence,
    MotionReport,
    PoseFix,
    Rival,
)
from world_models.entries.body import MotorCommand
from world_models.frames import Pose2

SOURCE, WHEELS, HERE = correction_monitor, ActuatorModel(), Pose2(2.0, 1.5, 0.3)


def certify(bench: Bench, pose: Pose2, verdict: str = "verified", p_false: float = 1e-3) -> Entry[Certificate]:
    """A picture that tells a place to 4 mm."""
    fix = bench.put(PoseFix("LineMatch-1", pose, np.diag([1.6e-5, 1.6e-5, 1e-6]), np.ones(0, bool), np.zeros(0), ()))
    return bench.put(Certificate("Milestone-1", fix.id, verdict, "", 9, 9, 9, 0.9, 1.0, 0.0, 0.0, 3.0, 30.0,  # type: ignore[arg-type]
                                 p_false, p_false, 0.006))


def go(
    step: Pose2, turn_rad: float, move_m: float, before_m: float = 0.0, jump_m: float = 0.0, **told: object
) -> tuple[Bench, Entry[Certificate]]:
    """Pictures before and after a motion that the wheels counted and that moved the robot by a step, after another."""
    bench = Bench(plain_robot(actuator=WHEELS))
    bench.believe(HERE)
    bench.move(0.0, before_m)
    certify(bench, HERE, **told)  # type: ignore[arg-type]
    asked = bench.put(MotorCommand(turn_rad, move_m))
    bench.put(MotionReport(turn_rad, move_m + jump_m, 1.0, 2.0), asked)
    return bench, certify(bench, HERE @ step)


def say(*legs: tuple[Bench, Entry[Certificate]]) -> list[Evidence]:
    return [found for bench, last in legs for found in made(bench.ask(SOURCE, last), Evidence)]


def lead(seen: list[Evidence], legs: int = 4) -> Rival:
    """What so many such legs together are taken for."""
    return weigh_rivals("motion", seen * legs).leader


turns, ways = st.floats(-0.6, 0.6), st.floats(0.2, 1.5)
errors = st.builds(Pose2, st.floats(-0.008, 0.008), st.floats(-0.008, 0.008), st.floats(-0.003, 0.003))


@settings(max_examples=60, deadline=None)
@given(turns, ways, errors)
def test_of_wheels_and_pictures_that_agree_nothing_is_told(turn_rad: float, way_m: float, error: Pose2) -> None:
    assert not say(go(WHEELS.predict_motion(turn_rad, way_m) @ error, turn_rad, way_m))


@settings(max_examples=60, deadline=None)
@given(turns, ways, errors)
def test_pictures_that_never_change_are_told_by_each_leg(turn_rad: float, way_m: float, error: Pose2) -> None:
    seen = say(go(error, turn_rad, way_m))
    other = say(go(Pose2(error.x_m, -error.y_m, -error.heading_rad), -turn_rad, way_m))
    assert lead(seen).kind == lead(other).kind == "still camera" and lead(seen).p > 0.95
    for one, two in zip(seen[0].explanations, other[0].explanations, strict=True):
        assert two.log_ratio == pytest.approx(one.log_ratio, abs=1e-3)  # in a mirror it is the same
    assert 0.03 < weigh_rivals("motion", seen).p_misled < 0.1  # one leg may be misread


@settings(max_examples=60, deadline=None)
@given(turns, st.floats(0.0, 1.5), st.builds(Pose2, *[st.floats(-0.3, 0.3)] * 3))
def test_rivals_are_gaussians_about_what_the_wheels_count(turn_rad: float, way_m: float, error: Pose2) -> None:
    moved, picture = WHEELS.predict_motion(turn_rad, way_m), np.diag([1.6e-5, 1.6e-5, 1e-6])
    step = moved @ error
    bench, last = go(step, turn_rad, way_m)
    rolled = add_reports(WHEELS, Drift.unknown(WHEELS, 0.0), [one.value for one in bench.view.all(MotionReport)][-1:])
    arm = np.array([[1.0, 0.0, -step.y_m], [0.0, 1.0, step.x_m], [0.0, 0.0, 1.0]])
    shared = np.diag([SHARED_SIGMA_M, SHARED_SIGMA_M, own.SHARED_SIGMA_RAD]) ** 2
    spread = arm @ picture @ arm.T + picture + 2.0 * shared
    usual = spread + np.diag([rolled.sigma_m, rolled.sigma_m, rolled.sigma_rad]) ** 2
    along, turned = WHEELS_PART * np.array([*moved.position, 0.0]), abs(turn_rad)
    aside_m = own.ASIDE_M_PER_RAD * turned + own.BEND_RAD_PER_M * way_m**2 / 2.0
    bent = np.diag([aside_m, aside_m, WHEELS_PART * turned + own.BEND_RAD_PER_M * way_m]) ** 2
    wider = {"chance": 0.0, "wheels": np.outer(along, along), "turns": bent, "elsewhere": np.eye(3)}
    logs = {kind: multivariate_normal(np.zeros(3), usual + by).logpdf(step.minus(moved)) for kind, by in wider.items()}
    for told in ({one.kind: one for one in seen.explanations} for seen in made(bench.ask(SOURCE, last), Evidence)):
        hedged = hedge({kind: log - logs["chance"] for kind, log in logs.items()})  # type: ignore[misc]
        if max(told, key=lambda kind: told[kind].log_ratio) in wider:
            assert {kind: told[kind].log_ratio for kind in hedged} == pytest.approx(hedged, abs=1e-6)
        if (gone_m := math.hypot(*moved.position)) >= own.MIN_REACH_M:
            ahead = moved.position / gone_m
            wheels = np.array([ahead @ step.position, math.sqrt(ahead @ usual[:2, :2] @ ahead)])
            assert (told["wheels"].off, told["wheels"].sigma) == pytest.approx(wheels * WHEELS.reach / gone_m)


@settings(max_examples=60, deadline=None)
@given(ways, st.sampled_from((-0.25, -0.2, 0.2, 0.25)))
def test_wheels_that_count_wrongly_are_no_reason_to_mistrust_pictures(way_m: float, part: float) -> None:
    moved = WHEELS.predict_motion(0.0, way_m)
    seen = say(go(Pose2((1.0 + part) * moved.x_m, 0.0, 0.0), 0.0, way_m, way_m))
    assert not seen or weigh_rivals("motion", seen * 4).p_misled < 0.01
    assert way_m < 0.5 or lead(seen).kind == "wheels"


@settings(max_examples=60, deadline=None)
@given(st.floats(0.4, 1.5), st.floats(-0.5, 0.5).filter(lambda part: abs(part) > 0.15), errors)
def test_wheels_that_go_as_asked_and_count_otherwise_count_wrongly(way_m: float, part: float, error: Pose2) -> None:
    legs = (go(WHEELS.predict_motion(0.0, way_m) @ error, 0.0, way_m, jump_m=by * way_m) for by in (part, -part))
    assert lead(say(*legs)).kind == "odometry"


@settings(max_examples=10, deadline=None)
@given(st.integers(2, 5), st.integers(0, 99))
def test_pictures_that_move_while_the_wheels_stand_are_late_and_not_by_chance(moved_px: int, seed: int) -> None:
    def leg(*offs_px: int) -> list[Evidence]:
        bench, _ = go(WHEELS.predict_motion(0.0, 0.7), 0.0, 0.7)
        texture = np.kron(np.random.default_rng(seed).uniform(40.0, 200.0, (9, 12)), np.ones((60, 60)))
        for number, px in enumerate(offs_px):
            jpeg = bytes(cv2.imencode(".png", texture[:, 2 * px : 2 * px + 640].astype(np.uint8))[1])
            bench.put(CameraPicture(jpeg, number, 2.1 + 0.1 * number))
        return say((bench, bench.view.latest(Certificate)))  # type: ignore[arg-type]

    seen = leg(0, moved_px)
    assert not leg(0, 0) and lead(seen, 3).kind == "late pictures" and lead(seen, 3).p > 0.95
    assert weigh_rivals("motion", seen).p_misled < 0.03 < weigh_rivals("motion", seen * 2).p_misled


@given(st.sampled_from(("verified", "not testable", "refuted")), st.floats(0.0, 1.0))
def test_only_pictures_that_tell_the_place_count(verdict: str, p_false: float) -> None:
    tells = verdict != "refuted" and p_false <= 0.03
    legs = go(Pose2(0.0, 0.0, 0.0), 0.0, 1.0, verdict=verdict, p_false=p_false)
    assert bool(say(legs)) == tells


def test_it_rests_on_all_that_was_counted_and_keeps_the_laws_of_all_sources() -> None:
    bench, last = go(Pose2(0.0, 0.0, math.radians(1.0)), 0.0, 1.0)
    (effect,) = bench.ask(SOURCE, last) or ()
    assert reasons(effect) == {last.id, "PoseFix-1", "PoseFix-2", "MotionReport-2"}
    check_source(SOURCE, bench, last, without=("PoseFix-1", "MotionReport-2"))
