"""Elevators: somebody of the scenario presses the button, and the car carries the robot to another floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sim.truth import Truth
from world_models.bounds import Bounds, check_bounds
from world_models.building.locales import Link
from world_models.entries.body import Ride
from world_models.entries.location import Frames
from world_models.frames import Pose2, flattened


@dataclass(frozen=True, slots=True)
class Helper:
    """One of a scenario's ``[[rides]]``: somebody who is about, and presses the button that he is asked to.

    Attributes:
        passage: the ride that he helps with; "" for any.
        comes_s: how long the robot waits for him.
        takes_s: from pressing the button to the doors' opening.
        presses: the locale whose button he presses, by mistake; "" for the one that he is asked for.
        times: how often he helps; then he has gone home.
    """

    passage: str = ""
    comes_s: float = 4.0
    takes_s: float = 12.0
    presses: str = ""
    times: int = 1000

    def __post_init__(self) -> None:
        patience, often = Bounds(0.0, 1e6), Bounds(0, 10**9)
        check_bounds(self, {"comes_s": patience, "takes_s": patience, "times": often})


@dataclass(frozen=True, slots=True)
class Carried:
    """What a ride does.

    Attributes:
        world_from_robot: where the robot is then; locale: in which car; floor_m: at which height.
        comes_s, takes_s: how long until somebody came, and from then on.
        helper: which of the scenario's, by its place in the file.
    """

    world_from_robot: Pose2
    locale: str
    floor_m: float
    comes_s: float
    takes_s: float
    helper: int


@dataclass(frozen=True, eq=False)
class Elevators:
    """All of a building.

    Attributes:
        cars: (place of the car in the world, height of its floor) at each of its landings, by locale.
        rides: the landings that each ride joins, by the passage's name.
        helpers: those of the scenario.
    """

    cars: Mapping[str, tuple[Pose2, float]]
    rides: Mapping[str, tuple[str, str]]
    helpers: tuple[Helper, ...] = ()

    @staticmethod
    def of_links(links: Sequence[Link], world: Frames, helpers: Sequence[Helper]) -> Elevators:
        """The elevators among the links of a world."""
        found = [link for link in links if link.kind == "elevator"]
        landings = sorted({name for link in found for name in link.between})
        frames = {name: world.world_from_locale(name) for name in landings}
        cars = {name: (flattened(frame), float(frame.translation[2])) for name, frame in frames.items()}
        return Elevators(cars, {link.name: link.between for link in found}, tuple(helpers))

    def carry(self, ride: Ride, truth: Truth, helped: Mapping[int, int]) -> Carried | str:
        """Where a ride takes the robot that is truly there; why not, in words.

        ``helped``: how often each helper has helped before.
        """
        ends = self.rides.get(ride.passage)
        if ends is None or truth.locale not in ends or truth.locale == ride.destination:
            return "nobody is in the car to press a button for"
        for number, helper in enumerate(self.helpers):
            if helper.passage in ("", ride.passage) and helped.get(number, 0) < helper.times:
                there = helper.presses if helper.presses in self.cars else ride.destination
                car, _ = self.cars[truth.locale]
                landing, floor_m = self.cars[there]
                pose = landing @ (car.inverse() @ truth.world_from_robot)
                return Carried(pose, there, floor_m, helper.comes_s, helper.takes_s, number)
        return "nobody comes by who could press the button"
