"""Laws of the panorama builder: looks are carried along by the motions between them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings

from blackboard import Entry
from generated_boards import Bench, drive, effect_on, go, motions, reasons
from harvey.testing import check_source, plain_robot
from knowledge_sources.relocalizer.panorama_builder import PanoramaBuilder
from world_models.actuator import ActuatorModel
from world_models.entries import Panorama, Segments
from world_models.frames import Pose2

SOURCE = PanoramaBuilder()


def looked(bench: Bench, contrast: float = 40.0, brightness: float = 120.0, milestone: str = "") -> Entry[Segments]:
    return bench.put(Segments("CameraPicture-1", milestone, np.zeros((0, 2, 2)), np.zeros(0), contrast, brightness))


@settings(max_examples=30, deadline=None)
@given(motions)
def test_a_look_is_where_the_robot_was_as_seen_from_where_it_is(way: list[tuple[float, float]]) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    drive(bench, [(0.3, 0.2)])  # before it looked: no part of it
    doubt = bench.doubt()
    first = looked(bench)
    effect = effect_on(bench.ask(SOURCE, first), Panorama)
    (glimpse,) = effect.value.glimpses
    assert (glimpse.now_from_then, reasons(effect)) == (Pose2(0.0, 0.0, 0.0), {"Segments-1", doubt.id})
    bench.apply(effect)
    drive(bench, way)
    effect = effect_on(bench.ask(SOURCE, looked(bench)), Panorama)
    old, new = effect.value.glimpses
    assert new.now_from_then == Pose2(0.0, 0.0, 0.0) and not np.any(new.covariance)
    x, y, heading = 0.0, 0.0, 0.0  # of the robot now, as it was then
    for motion in way:
        x, y, heading = go(x, y, heading, ActuatorModel().predict_motion(*motion))
    c, s = math.cos(heading), math.sin(heading)
    then = old.now_from_then
    assert (then.x_m, then.y_m) == pytest.approx((-c * x - s * y, s * x - c * y), abs=1e-9)
    assert math.remainder(then.heading_rad + heading, math.tau) == pytest.approx(0.0, abs=1e-9)
    assert np.all(np.diag(old.covariance) >= 0.0) and old.covariance[2][2] > 0.0
    reports = {f"MotionReport-{k + 2}" for k in range(len(way))}
    assert reasons(effect) == {"Segments-2", doubt.id, "Panorama-1", *reports}


def test_lost_again_it_begins_a_new_panorama() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    doubt = bench.doubt()
    bench.apply(*bench.ask(SOURCE, looked(bench)) or ())
    bench.revise(doubt, status="corrected")
    bench.doubt()
    effect = effect_on(bench.ask(SOURCE, looked(bench)), Panorama)
    assert len(effect.value.glimpses) == 1 and "Panorama-1" not in reasons(effect)


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.doubt()
    check_source(SOURCE, bench, looked(bench))
    assert bench.ask(SOURCE, looked(bench, 0.0, 0.0)) is None  # it is dark
