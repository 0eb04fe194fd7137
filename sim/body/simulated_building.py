"""The building as the body needs it: what is seen, what is solid, where its locales are, and rides."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from sim.body.collision import Obstacles
from sim.render.mesh import FaceLike
from sim.render.renderer import Renderer
from sim.truth import Truth
from world_models.building.geometry.faces import Face
from world_models.building.locales import Link
from world_models.entries import LocalePoses, Place, Ride
from world_models.frames import Pose2, flattened
from world_models.units import Bounded, bounded


@dataclass(frozen=True, slots=True)
class Helper(Bounded):
    """One of a scenario's ``[[rides]]``: a person who presses the button that the robot asks for.

    Attributes:
        passage: the elevator ride that this person helps with; "" for any.
        comes_s: time until the person comes [s].
        takes_s: time from pressing the button until the doors open [s].
        presses: the locale whose button is pressed by mistake; "" for the one that is asked for.
        times: how many rides this person helps with.
    """

    passage: str = ""
    comes_s: float = bounded(4.0, 0.0, 1e6)
    takes_s: float = bounded(12.0, 0.0, 1e6)
    presses: str = ""
    times: int = bounded(1000, 0, 10**9)


@dataclass(frozen=True, slots=True)
class RideOutcome:
    """What a ride does to the robot.

    Attributes:
        world_from_robot: pose at the end; locale: of the car there; floor_m: height of its floor [m].
        comes_s, takes_s: time until a helper came, and from then on [s].
        helper: which of the scenario's, by its position in the file.
    """

    world_from_robot: Pose2
    locale: str
    floor_m: float
    comes_s: float
    takes_s: float
    helper: int


@dataclass(frozen=True, eq=False)
class Elevators:
    """All elevators of a building.

    Attributes:
        cars: (world_from_car, height of its floor [m]) at each landing, by the car's locale there.
        rides: the two landings that each ride joins, by the passage's name.
        helpers: of the scenario, in the order of the file.
    """

    cars: Mapping[str, tuple[Pose2, float]]
    rides: Mapping[str, tuple[str, str]]
    helpers: tuple[Helper, ...] = ()

    @staticmethod
    def of_links(links: Sequence[Link], world: LocalePoses, helpers: Sequence[Helper]) -> Elevators:
        """The elevators among the links of a world."""
        found = [link for link in links if link.kind == "elevator"]
        landings = sorted({name for link in found for name in link.between})
        frames = {name: world.world_from_locale(name) for name in landings}
        cars = {name: (flattened(frame), float(frame.translation[2])) for name, frame in frames.items()}
        return Elevators(cars, {link.name: link.between for link in found}, tuple(helpers))

    def carry(self, ride: Ride, truth: Truth, helped: Mapping[int, int]) -> RideOutcome | str:
        """What a ride does to the robot at its true place, or why there is none, in words.

        ``helped``: how many rides each helper has helped with before.
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
                return RideOutcome(pose, there, floor_m, helper.comes_s, helper.takes_s, number)
        return "nobody comes by who could press the button"


NO_ELEVATORS = Elevators({}, {})


def no_locale_at(_: Pose2) -> str:
    """For a building without named locales."""
    return ""


def no_world_from_place(place: Place) -> Pose2:
    """For a building without named locales. Raises ValueError."""
    raise ValueError(f"expected a place of the building, which has no named locales, got {place}")


@dataclass(frozen=True, eq=False)
class SimulatedBuilding:
    """A building for one body to be in.

    Attributes:
        renderer: how it looks.
        obstacles: what is solid.
        locale_at: the name of the locale at a pose in the world frame, "" outside all of them.
        world_from_place: the pose of a robot at a place in a locale.
        floor_m: height of the floor that the body stands on [m]; obstacles and locales are those of this floor.
        elevators: the rides to other floors.
        on_floor: the building for a body on the floor of this height [m].
        at_time: the building on this floor at a time of the run [s], with the robot there; None where nothing changes.
        added, gone: faces that are there, or not, otherwise than in the building's files.
        news: what who walks in it has just done to the robot, in words.
    """

    renderer: Renderer
    obstacles: Obstacles
    locale_at: Callable[[Pose2], str] = no_locale_at
    world_from_place: Callable[[Place], Pose2] = no_world_from_place
    floor_m: float = 0.0
    elevators: Elevators = NO_ELEVATORS
    on_floor: Callable[[float], SimulatedBuilding] | None = field(default=None, repr=False)
    at_time: Callable[[float, Pose2], SimulatedBuilding] | None = field(default=None, repr=False)
    added: tuple[Face, ...] = ()
    gone: tuple[Face, ...] = ()
    news: tuple[str, ...] = ()

    @staticmethod
    def of_faces(
        faces: Sequence[FaceLike], locale_at: Callable[[Pose2], str] = no_locale_at, samples: int = 8
    ) -> SimulatedBuilding:
        """A building with these faces; see :meth:`~sim.render.renderer.Renderer.of_faces` for ``samples``."""
        return SimulatedBuilding(Renderer.of_faces(faces, samples), Obstacles.of_faces(faces), locale_at=locale_at)
