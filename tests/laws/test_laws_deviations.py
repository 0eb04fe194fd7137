"""Each stated deviation counts: where one is made large, alone, something is wider, is refused, or more is let through.

One table; a method that takes a standard deviation has its row.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import pytest
import shapely

from blackboard import Post
from generated_boards import LENGTH_M, WIDTH_M, Bench
from harvey.testing import HALL, STUDY, plain_robot
from knowledge_sources.methods.floor.footprints import find_same
from knowledge_sources.methods.floor.revise_frame import is_width
from knowledge_sources.model.door_toucher import door_toucher
from knowledge_sources.reads.motion_between import MOTION, bound_wheels_m
from knowledge_sources.senses.bumper_monitor import bumper_monitor
from world_models.actuator import ActuatorModel
from world_models.entries import (
    Contact,
    Difference,
    DoorPicture,
    DoorState,
    Drift,
    MotionReport,
    MotorCommand,
    Obstacle,
    Rival,
    diagonal,
)
from world_models.frames import Pose2


def refuse_touch(place_m: float, heading_rad: float, direction_rad: float) -> float:
    """Whether a touch near a jamb may have been the jamb."""
    bench, robot = Bench(plain_robot()), plain_robot()
    picture = DoorPicture("CameraPicture-1", (0.0, 0.0, 9.0, 9.0), 1.0, 0.0, 0.0, 4.5, "a leaf")
    bench.put(DoorState("study-door", (HALL, STUDY), "unknown", 0.6, 0.5, 1, picture, 1.0, -4.0, (picture,)))
    command, report = bench.move(0.0, 0.4)
    bench.put(Contact("bumper", 0.0, direction_rad, 1.0), command)
    here = Pose2(LENGTH_M + 0.05 - robot.radius_m, 0.5 * WIDTH_M + 0.25, 0.0)
    belief = bench.believe(here, diagonal(place_m, heading_rad), motion=report.id)
    return float(bench.ask(door_toucher, bench.revise(belief)) is None)


def learn_drift(before_per_m: float, turned_rad: float, heading_rad: float) -> float:
    """What is left open of the wheels' drift after a measured way."""
    drift = Drift(0.0, before_per_m, 0.0, 0.2, turned_rad**2, 1.0)
    return drift.update(ActuatorModel(), 0.2, heading_rad).sigma_per_m


def is_same_thing(known_m: float, seen_m: float) -> float:
    """Whether what is seen beside a thing is that thing."""
    known = Obstacle("hall/obstacle-1", HALL, ((0.0, 0.0), (0.3, 0.0), (0.3, 0.3), (0.0, 0.3)), known_m, 0.0, 0.0, 0.3)
    return float(find_same({"Obstacle-1": known}, shapely.box(0.4, 0.0, 0.7, 0.3), seen_m, 2.0) is not None)


def believe_wheels(wheels: float, reach: float) -> float:
    """Whether wheels that seem to go another part of the way leave nothing more open of it."""
    bench = Bench(plain_robot())
    bench.put(Difference(MOTION, (Rival("wheels", "wheels", 0.0, 0.3, 0.7, wheels),), (), 1.0))
    return float(bound_wheels_m(bench.view, ActuatorModel(reach=1.0, reach_sigma=reach), 1.0)[0] == 0.0)


def feel_one_side(earlier_rad: float, later_rad: float) -> float:
    """Whether two touches may have been of one side of the robot, before a turn and after it."""
    bench = Bench(plain_robot())
    bench.believe()
    for turn_rad, side_rad, sigma_rad in ((0.0, 0.0, earlier_rad), (2.0, 0.5, later_rad)):
        command = bench.put(MotorCommand(turn_rad, 0.4))
        felt, _ = bench.apply(Post(Contact("bumper", side_rad, sigma_rad, 1.0), (command,)),
                              Post(MotionReport(turn_rad, 0.0, 1.0, 1.0), (command,)))
    return float(bench.ask(bumper_monitor, felt.entry) is not None)


def doubt_walls(wall_m: float, camera_m: float) -> float:
    """Whether walls that seem farther apart may stand where the file has them."""
    found = Difference("walls", (Rival("wall", "walls farther apart", 9.0, 0.9999, 0.05, wall_m),), (), 1.0)
    return float(not is_width(found, camera_m))


ROWS: Mapping[str, tuple[Callable[..., float], dict[str, Any]]] = {
    "a touch in a doorway": (refuse_touch, {"place_m": 0.005, "heading_rad": 0.005, "direction_rad": 0.05}),
    "the drift of the wheels": (learn_drift, {"before_per_m": 0.002, "turned_rad": 0.002, "heading_rad": 0.002}),
    "two sights of a thing": (is_same_thing, {"known_m": 0.005, "seen_m": 0.005}),
    "wheels that are suspected": (believe_wheels, {"wheels": 0.005, "reach": 0.005}),
    "walls that seem farther apart": (doubt_walls, {"wall_m": 0.002, "camera_m": 0.002}),
    "two touches on one side": (feel_one_side, {"earlier_rad": 0.05, "later_rad": 0.05}),
}
LARGE = 100.0


@pytest.mark.parametrize("row", ROWS)
def test_each_deviation_that_is_large_alone_counts(row: str) -> None:
    measure, sigmas = ROWS[row]
    plain = measure(**sigmas)
    assert [name for name in sigmas if not measure(**{**sigmas, name: LARGE * sigmas[name]}) > plain] == []
