"""What the simulator did to the robot and its building, as it is told afterwards."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from harvey.simulation.happenings import HappeningWatch
from sim.body.simulated_body import SimulatedBody
from sim.faults.built_in_faults import Bump, CameraUnplugged, Kidnap, LightsOff, Occlusion
from sim.faults.fault import Fault
from sim.scenario import load_scenario
from sim.stage import build_stage

SCENARIO = load_scenario("hallway-kidnap")


def happened(*faults: Fault) -> tuple[str, ...]:
    """What is told of a robot that waits for a second."""
    watch = HappeningWatch(body := build_stage(replace(SCENARIO, faults=faults)).body(0))
    assert watch.new_happenings() == ()
    body.wait(1.0)
    told = watch.new_happenings()
    assert watch.new_happenings() == ()
    return told


@pytest.mark.parametrize(("fault", "told"), [
    (LightsOff(duration_s=2.0), "the lights go off for 2 s"),
    (Occlusion(duration_s=5.0, part=0.2), "something covers 20% of the camera's picture for 5 s"),
    (CameraUnplugged(duration_s=3.0), "the camera fails for 3 s: no such device"),
    (Bump(left_m=0.3, turn_rad=math.radians(10.0)),
     "somebody bumps into the robot: it stands 0.30 m from where it stood, turned by 10.0 degrees"),
    (Kidnap(to_locale="hallway", to_x_m=5.0, to_y_m=1.2), "somebody kidnaps the robot: it stands"),
])
def test_each_fault_is_told_once_in_words(fault: Fault, told: str) -> None:
    (text,) = happened(fault)
    assert text.startswith(told)


def test_how_the_building_differs_is_told_when_it_does() -> None:
    def faces(*names: str) -> Any:
        return tuple(SimpleNamespace(name=f"{name}/0/0x+") for name in names)

    body = SimpleNamespace(happened=(), building=SimpleNamespace(added=faces("hallway/extra-0-box"), gone=()))
    watch = HappeningWatch(cast(SimulatedBody, body), [cast(Any, SimpleNamespace(thing="office/desk"))])
    assert watch.new_happenings() == ("the thing office/desk stands elsewhere than in the model",
                                      "the thing hallway/extra-0-box is there, and the model lacks it")
    body.building = SimpleNamespace(added=faces("a-door/true-leaf"), gone=faces("office/chair"))
    assert watch.new_happenings() == (
        "the door a-door is not as open as the model has it", "the thing hallway/extra-0-box is taken away again",
        "the thing office/chair is not there, and the model has it")
    body.building = SimpleNamespace(added=(), gone=())
    assert watch.new_happenings() == ("the door a-door is open again", "the thing office/chair is there again")
