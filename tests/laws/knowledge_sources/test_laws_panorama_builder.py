"""Laws of the panorama builder: looks are carried along by the motions between them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

from blackboard import Entry
from generated_boards import Bench, drive, effect_on, go, reasons
from harvey.testing import check_source, plain_robot
from knowledge_sources.relocalizer.panorama_builder import PanoramaBuilder
from world_models.actuator import ActuatorModel
from world_models.entries import MotionReport, Panorama, Segments
from world_models.frames import Pose2

SOURCE = PanoramaBuilder()


def looked(bench: Bench, contrast: float = 40.0, brightness: float = 120.0, milestone: str = "") -> Entry[Segments]:
    return bench.put(Segments("CameraPicture-1", milestone, np.zeros((0, 2, 2)), np.zeros(0), contrast, brightness))


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.doubt()
    check_source(SOURCE, bench, looked(bench))
    assert bench.ask(SOURCE, looked(bench, 0.0, 0.0)) is None  # it is dark


class PanoramaMachine(RuleBasedStateMachine):
    """Looks and motions in any order: each look is where the robot was, as seen from where it is."""

    @initialize()
    def begin(self) -> None:
        self.bench, self.now = Bench(plain_robot()), Pose2(0.0, 0.0, 0.0)
        self.bench.believe()
        self.lose()

    def lose(self) -> None:
        self.doubt = self.bench.doubt()
        self.looks, self.known = list[Pose2](), ""

    @rule(turn_rad=st.floats(-1.5, 1.5), move_m=st.floats(0.0, 0.8))
    def drive(self, turn_rad: float, move_m: float) -> None:
        drive(self.bench, [(turn_rad, move_m)])
        self.now = Pose2(*go(self.now.x_m, self.now.y_m, self.now.heading_rad,
                             ActuatorModel().predict_motion(turn_rad, move_m)))

    @rule()
    def be_found_and_lost_again(self) -> None:
        self.bench.revise(self.doubt, status="corrected")
        self.lose()

    @rule()
    def look(self) -> None:
        cycle = self.bench.cycle if not self.known else self.bench.view[self.known].cycle
        since = self.bench.view.since(MotionReport, cycle) if self.known else ()
        seen = looked(self.bench)
        effect = effect_on(self.bench.ask(SOURCE, seen), Panorama)
        self.looks.append(self.now)
        for glimpse, then in zip(effect.value.glimpses, self.looks, strict=True):
            found, wanted = glimpse.now_from_then, self.now.inverse() @ then
            assert found.distance_to(wanted) < 1e-9
            assert math.remainder(found.heading_rad - wanted.heading_rad, math.tau) == pytest.approx(0.0, abs=1e-9)
            assert np.any(glimpse.covariance) or then == self.now
        named = {seen.id, self.doubt.id, *(report.id for report in since)}
        assert reasons(effect) == (named | {self.known} if self.known else named)
        self.known = self.bench.apply(effect)[0].entry.id


TestPanorama = PanoramaMachine.TestCase
TestPanorama.settings = settings(max_examples=25, stateful_step_count=10, deadline=None)
