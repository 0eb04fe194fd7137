"""Laws of the floor changer: in the car of the other floor the robot stands as it did in the one that it came from."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from generated_boards import Bench, covariances, effect_on, made, reasons
from harvey.testing import SURE, check_source, plain_robot
from knowledge_sources.action.floor_changer import ELEVATOR_SIGMA_M, ELEVATOR_SIGMA_RAD, floor_changer
from towers import tower
from world_models.building.world import World
from world_models.entries import Anchor, Hypothesis, Place, PlanSketch, Ride, RideReport, SketchStatus, Subgoal, Tracks
from world_models.entries.location import Covariance
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frames import Pose2

TURN_DEG = 90.0
RIDE = Subgoal(Place("car-1", 1.0, 1.0), Place("car-2", 1.0, 1.0), primitive=False, passage="elevator")
poses = st.builds(Pose2, st.floats(0.5, 1.6), st.floats(0.5, 1.6), st.floats(-3.1, 3.1))


@cache
def two_floors() -> World:
    """A tower that is turned in the world; the frame of its upper car is turned against that of the lower one."""
    text = tower(2, turn_deg=25.0).replace("at = [0, 0, 3.6]\nsize = [2.1, 2.1]", (
        f"at = [2.1, 0, 3.6]\nturn = {TURN_DEG}\nsize = [2.1, 2.1]"))
    return read_world(Source.parse(text, "tower.toml"))


def ride(pose: Pose2, covariance: Covariance, *, up: bool = True, at: int = 0, status: SketchStatus = "active",
         has_tracks: bool = True, index: int = 0) -> tuple[Bench, tuple[object, ...]]:
    bench = Bench(plain_robot(two_floors()))
    bench.believe(pose, covariance, locale="car-1" if up else "car-2", motion="MotionReport-7")
    sketch = bench.put(PlanSketch("Goal-1", (), "", (RIDE, RIDE), at, verified=True, status=status))
    if has_tracks:
        bench.put(Tracks("CameraPicture-1", 9, (), (Anchor("CameraPicture-1", 0.0, 0.0, covariance),), 4))
    origin, destination = ("car-1", "car-2") if up else ("car-2", "car-1")
    asked = bench.put(Ride(sketch.id, index, "elevator", origin, destination))
    effects = bench.ask(floor_changer, bench.put(RideReport("elevator", destination, 9.0, 30.0), asked))
    assert effects is not None
    return bench, effects


@settings(max_examples=40)
@given(poses, covariances, st.booleans())
def test_it_stands_in_the_other_car_as_in_this_one(pose: Pose2, covariance: Covariance, up: bool) -> None:
    """The stop has the same place and heading in the frame of either car."""
    (a, _, _), _, (_, _, h) = covariance
    both = 0.3 * math.sqrt(a * h)
    covariance = ((a, 0.2 * a, both), (0.2 * a, 2.0 * a, 0.0), (both, 0.0, h))
    _, effects = ride(pose, covariance, up=up)
    there = effect_on(effects, Hypothesis).value
    assert (there.locale, there.basis, there.motion) == ("car-2" if up else "car-1", "ride", "MotionReport-7")
    own = there.locale_from_robot
    assert np.allclose((own.x_m, own.y_m), (pose.x_m, pose.y_m))
    assert abs(math.remainder(own.heading_rad - pose.heading_rad, math.tau)) < 1e-9
    more = np.diag([ELEVATOR_SIGMA_M**2, ELEVATOR_SIGMA_M**2, ELEVATOR_SIGMA_RAD**2])
    assert np.allclose(there.covariance, covariance + more, atol=1e-12)


def test_it_names_the_report_and_the_belief() -> None:
    _, effects = ride(Pose2(1.0, 1.0, 0.0), ((1e-4, 0.0, 0.0), (0.0, 1e-4, 0.0), (0.0, 0.0, 1e-4)))
    named = {kind: reasons(effect_on(effects, kind)) for kind in (Hypothesis, Tracks, PlanSketch)}
    assert named == {Hypothesis: {"RideReport-1", "Hypothesis-1"}, Tracks: {"RideReport-1"},
                     PlanSketch: {"RideReport-1", "Hypothesis"}}


@pytest.mark.parametrize("has_tracks", [False, True])
def test_landmarks_of_the_floor_that_it_left_are_not_followed(has_tracks: bool) -> None:
    bench, effects = ride(Pose2(1.0, 1.0, 0.0), ((1e-4, 0.0, 0.0), (0.0, 1e-4, 0.0), (0.0, 0.0, 1e-4)),
                          has_tracks=has_tracks)
    assert [(t.items, t.anchors, t.half_px) for t in made(effects, Tracks)] == [((), (), 9)] * has_tracks
    assert len(bench.view.all(Tracks)) == has_tracks


@pytest.mark.parametrize(("at", "status", "advances"), [
    (0, "active", True), (1, "active", False), (0, "superseded", False), (0, "done", False)])
def test_the_sketch_goes_on_where_the_ride_was_its_next_subgoal(at: int, status: SketchStatus, advances: bool) -> None:
    _, effects = ride(Pose2(1.0, 1.0, 0.0), ((1e-4, 0.0, 0.0), (0.0, 1e-4, 0.0), (0.0, 0.0, 1e-4)), at=at,
                      status=status)
    sketches = made(effects, PlanSketch)
    assert [(s.at, s.verified) for s in sketches] == [(1, False)] * advances


def test_without_a_ride_a_report_tells_nothing_and_the_last_one_counts() -> None:
    bench = Bench(plain_robot(two_floors()))
    bench.believe(Pose2(1.0, 1.0, 0.0), locale="car-1")
    report = bench.put(RideReport("elevator", "car-2", 9.0, 30.0))
    assert bench.ask(floor_changer, report) is None
    bench.put(Ride("PlanSketch-1", 0, "elevator", "car-2", "car-1"))
    bench.put(replace(bench.view["Ride-1"].value, origin="car-1", destination="car-2"))
    effects = bench.ask(floor_changer, report)
    assert [h.locale for h in made(effects, Hypothesis)] == ["car-2"] and len(effects or ()) == 1


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench, _ = ride(Pose2(1.0, 1.0, 0.0), SURE)
    check_source(floor_changer, bench, bench.view["RideReport-1"], without=("Ride-1",))
