"""``[[walkers]]`` of a scenario: who walks there, on which way, and whether they make way for the robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from harvey_people.simulated.charged import CHARGED_S, OTHERS_S
from harvey_people.simulated.figure import Figure
from harvey_people.simulated.peopled import people_building
from harvey_people.simulated.walking import WIDTH_M, Pedestrian
from sim.body.collision import Obstacles
from sim.body.simulated_building import SimulatedBuilding
from sim.render.renderer import Renderer
from world_models.building.world import World
from world_models.entries import Place
from world_models.files.toml.settings_reader import read_settings, suggest_keys
from world_models.files.toml.source import Node
from world_models.frames import Pose2
from world_models.plugins import GUESTS_GROUP, list_plugins
from world_models.units import Bounded, bounded

MOST = 20
SOURCES = ("mover_watcher", "mover_explainer", "people_masker", "people_passer", "people_waiter")
"""The knowledge sources of the package."""


@dataclass(frozen=True, slots=True)
class WayPoint(Bounded):
    """A point of a walker's way, in the frame of a locale; "" for that of the walker's.

    Attributes:
        x_m, y_m: there.
    """

    locale: str = ""
    x_m: float = bounded(0.0, -1e4, 1e4)
    y_m: float = bounded(0.0, -1e4, 1e4)


@dataclass(frozen=True, slots=True)
class Walker(Bounded):
    """One of a scenario's ``[[walkers]]``.

    Attributes:
        name: as contacts tell it; "" for the number in the file.
        locale: of the points of the way that name none.
        way: points, walked in order; with one only, the person stands there.
        speed_m_per_s: wanted.
        starts_s: by the time of the run [s]; before, the person stands at the first point.
        stays_s: at each end before turning back [s].
        again: whether the person walks to and fro, or stays at the last point.
        makes_way: whether for the robot too; people make way for one another.
    """

    name: str = ""
    locale: str = ""
    way: tuple[WayPoint, ...] = ()
    speed_m_per_s: float = bounded(1.2, 0.3, 1.6)
    starts_s: float = bounded(0.0, 0.0, 1e6)
    stays_s: float = bounded(0.0, 0.0, 1e6)
    again: bool = False
    makes_way: bool = True


@dataclass(frozen=True)
class Walkers:
    """All of a scenario's walkers."""

    walkers: tuple[Walker, ...] = ()

    def read(self, node: Node) -> Walkers:
        """Those of a file. Raises WorldError."""
        items = node.items()
        if len(items) > MOST:
            raise node.fail(f"at most {MOST} walkers", str(len(items)))
        return Walkers(tuple(read_settings(item, Walker) for item in items))

    def enter(self, building: SimulatedBuilding, world: World, seed: int) -> SimulatedBuilding:
        """The building with them in it, for a run with this seed.

        Raises:
            ValueError: the building has no such place, a way leads through what is solid, or light cannot draw them.
        """
        if type(building.renderer) is not Renderer:
            raise ValueError("expected even light where people walk, got [light] that is not")
        people = tuple(self._enter(number, building, world, seed) for number in range(len(self.walkers)))
        return people_building(building, people, 0.0)

    @property
    def guests(self) -> Mapping[str, str]:
        """The package's knowledge sources, which a robot among people has."""
        return {name: package for name, package in list_plugins(GUESTS_GROUP).items() if name in SOURCES}

    def charge(self, who: str) -> float:
        """How long an act of a knowledge source takes [s]: people walk meanwhile."""
        return CHARGED_S.get(who, OTHERS_S)

    def _enter(self, number: int, building: SimulatedBuilding, world: World, seed: int) -> Pedestrian:
        walker = self.walkers[number]
        if not walker.way:
            raise ValueError(f"{number}.way: expected one point at least, got none")
        points = [self._place(number, point, world) for point in walker.way]
        floor_m = world.floor_m(walker.way[0].locale or walker.locale)
        check_way(number, points, building.obstacles if floor_m == building.floor_m else None)
        figure = Figure.draw(f"people/{walker.name or number}", walker.way[0].locale or walker.locale,
                             np.random.default_rng([seed, number]))
        return Pedestrian.start(figure, points, floor_m, walker.speed_m_per_s, starts_s=walker.starts_s,
                                stays_s=walker.stays_s, again=walker.again, makes_way=walker.makes_way)

    def _place(self, number: int, point: WayPoint, world: World) -> tuple[float, float]:
        """In the world frame [m]."""
        locale = point.locale or self.walkers[number].locale
        if locale not in world.frames:
            raise ValueError(f"{number}.way: expected {suggest_keys(locale, world.frames)}, got {locale!r}")
        pose = Place(locale, point.x_m, point.y_m).in_world(world)
        return pose.x_m, pose.y_m


WALKERS = Walkers()
"""What reads them, as an entry point."""


def check_way(number: int, points: list[tuple[float, float]], obstacles: Obstacles | None) -> None:
    """Raises ValueError where a person on a way would touch what is solid; None: it is on another floor."""
    if obstacles is None:
        return
    for start, end in zip(points, points[1:] or points, strict=False):
        length_m = float(np.hypot(end[0] - start[0], end[1] - start[1]))
        for part in np.linspace(0.0, 1.0, 2 + int(length_m / 0.1)):
            x, y = np.array(start) + part * (np.array(end) - np.array(start))
            if obstacles.clearance_m(Pose2(float(x), float(y), 0.0), WIDTH_M / 2.0) < 0.0:
                raise ValueError(f"{number}.way: expected {WIDTH_M} m of room for a person, got none at"
                                 f" ({x:.2f}, {y:.2f}) m of the world")
