"""Elevators: who is carried where, and what the body tells of it."""

from pathlib import Path

import numpy as np
import pytest

from harvey.runner.ports import BodyPort
from sim.body.faulty_body import FaultyBody
from sim.body.simulated_body import SimulatedBody
from sim.body.simulated_building import Helper
from sim.scenario import ScenarioError, parse_scenario, scenario_from_tables
from sim.stage import Stage, build_stage
from towers import tower
from world_models.entries import BodyFault, Ride, RideReport

SCENARIO = """
world = "tower.toml"
goal = "(ptrans (car-2 (3.5,3.2,0)) (hall-1 (13,4.3,0)))"
[start]
heading_deg = 90
"""
RIDES = '[[rides]]\npassage = "elevator-1-2"\ncomes_s = 3.0\ntakes_s = 9.0\ntimes = 1\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("tower")
    (path / "tower.toml").write_text(tower(3, turn_deg=30.0))
    return path


def stage(folder: Path, rides: str) -> Stage:
    return build_stage(parse_scenario(SCENARIO + rides, "tower", folder))


@pytest.fixture(scope="module")
def helped(folder: Path) -> Stage:
    return stage(folder, RIDES)


def ride(body: SimulatedBody, there: str = "car-1") -> RideReport | BodyFault:
    return body.ride(Ride("PlanSketch-1", 1, "elevator-1-2", "car-2", there))


def test_a_ride_takes_the_body_to_the_floor_and_the_picture_with_it(helped: Stage) -> None:
    body = helped.body(0)
    before, picture = body.truth, body.picture()
    assert ride(body) == RideReport("elevator-1-2", "car-1", 12.0, 12.0)
    after = body.truth
    assert (before.locale, after.locale, after.time_s, after.path_m) == ("car-2", "car-1", 12.0, 0.0)
    assert after.world_from_robot.distance_to(before.world_from_robot) < 1e-9
    assert body.picture() != picture


def test_after_the_ride_walls_and_doors_are_those_of_the_floor(helped: Stage) -> None:
    body = helped.body(0)
    ride(body)
    assert body.move(1.5).move_m == pytest.approx(1.5, rel=0.05) and body.truth.locale == "hall-1"
    assert body.truth.collisions == 0


def test_a_rider_who_helps_once_has_gone_home_after_it(helped: Stage) -> None:
    body = helped.body(0)
    ride(body)
    again = ride(body, "car-2")
    assert isinstance(again, BodyFault) and (again.part, again.what) == ("elevator", "no ride")


def test_nobody_rides_from_the_hall(helped: Stage) -> None:
    body = helped.body(0)
    body.move(1.5)
    found = ride(body)
    assert isinstance(found, BodyFault) and "nobody is in the car" in found.detail


def test_the_wrong_button_leads_elsewhere_and_nobody_says_so(folder: Path) -> None:
    body = stage(folder, RIDES + 'presses = "car-3"\n').body(0)
    told = ride(body)
    assert isinstance(told, RideReport) and told.destination == "car-1" and body.truth.locale == "car-3"


def test_without_anybody_the_port_tells_of_a_fault(folder: Path) -> None:
    body = stage(folder, "").body(0)
    found = FaultyBody(body).ride(Ride("PlanSketch-1", 1, "elevator-1-2", "car-2", "car-1"))
    assert isinstance(found, BodyFault) and "nobody comes by" in found.detail
    assert BodyPort(FaultyBody(body)).name == "body"


def test_the_same_noise_is_drawn_with_and_without_a_ride(helped: Stage) -> None:
    one, other = helped.body(5), helped.body(5)
    ride(other)
    poses = [body.turn(0.3) for body in (one, other)]
    assert np.isclose(poses[0].turn_rad, poses[1].turn_rad)


@pytest.mark.parametrize(("rides", "message"), [
    ('[[rides]]\npassage = "lift"\n', r"tower:7: rides\.0\.passage: expected one of .*, got 'lift'"),
    ('[[rides]]\npresses = "hall-1"\n', r"tower:7: rides\.0\.presses: expected one of car-1, got 'hall-1'"),
    ("[[rides]]\ncomes_s = -1\n", "rides.0.comes_s: expected a number from 0 to 1e\\+06, got -1"),
    ("[[rides]]\nwho = 3\n", "expected one of .*, got the key 'who'"),
])
def test_mistakes_in_rides_are_told(folder: Path, rides: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        stage(folder, rides)


def test_a_scenario_with_rides_is_read_again_from_its_tables(folder: Path) -> None:
    scenario = parse_scenario(SCENARIO + RIDES, "tower", folder)
    assert scenario.rides == (Helper("elevator-1-2", 3.0, 9.0, "", 1),)
    assert scenario_from_tables(scenario.source.data, "tower", folder).rides == scenario.rides
