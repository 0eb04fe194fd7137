"""The world (§3.4): locales in a contained-by hierarchy, their doorways, faces and landmarks, and questions on them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from world_models import checks
from world_models.faces import Face
from world_models.frames import Pose, frozen
from world_models.landmarks import Landmark
from world_models.locales import Doorway, Locale
from world_models.scene import Scene, build_scene

ROBOT_TOP_M = 1.4
"""What hangs higher than this is no obstacle."""

FLUSH_M = 0.06
"""What stands out from its wall by no more than this is no obstacle: the robot keeps clear of the wall itself."""


@dataclass(frozen=True, slots=True)
class Fault:
    """Something wrong with a world that could be read: where (file:line) and what."""

    source: str
    what: str

    def __str__(self) -> str:
        return f"{self.source}: {self.what}"


@dataclass(frozen=True, slots=True, eq=False)
class Thing:
    """Furniture, a pillar, a board on the wall.

    Attributes:
        name: unique in the world.
        locale: where it stands.
        kind: the part that it is made from.
        footprint_world: (4, 2) rectangle on the floor that holds it [m].
        low_m, high_m: its extent above the floor.
        proud_m: how far it stands out from its wall; ``None`` for one that stands free.
        source: file:line where it is placed.
    """

    name: str
    locale: str
    kind: str
    footprint_world: NDArray[np.float64]
    low_m: float
    high_m: float
    proud_m: float | None
    source: str

    @property
    def in_the_way(self) -> bool:
        """Whether the robot could hit it."""
        return self.low_m < ROBOT_TOP_M and (self.proud_m is None or self.proud_m > FLUSH_M)


@dataclass(frozen=True, eq=False)
class World:
    """Everything that is known of the building; the root locale's frame is the world frame.

    Attributes:
        name: of the world and of its root locale.
        root: name of the locale that contains all others.
        locales: by name, root first, then in the order of the file.
        doorways: the open ones, through which one can pass.
        faces: barriers and doorways; what is drawn are their regions.
        landmarks: what can be recognised.
        things: what stands in the rooms.
        building_faults: what could not be built.
    """

    name: str
    root: str
    locales: Mapping[str, Locale]
    doorways: tuple[Doorway, ...]
    faces: tuple[Face, ...]
    landmarks: tuple[Landmark, ...]
    things: tuple[Thing, ...] = ()
    building_faults: tuple[Fault, ...] = ()

    def locale(self, name: str) -> Locale:
        """Raises ValueError where no locale has this name."""
        if name not in self.locales:
            raise ValueError(f"expected a locale of {self.name} ({', '.join(self.locales)}), got {name!r}")
        return self.locales[name]

    def path_of(self, name: str) -> tuple[str, ...]:
        """The locales that contain this one, from the root down to itself."""
        parent = self.locale(name).parent
        return (*self.path_of(parent), name) if parent is not None else (name,)

    def world_from_locale(self, name: str) -> Pose:
        """The frame of a locale."""
        self.locale(name)
        return self._poses[name]

    @cached_property
    def _poses(self) -> dict[str, Pose]:
        poses: dict[str, Pose] = {}
        for name in self.locales:
            pose = Pose.identity()
            for step in self.path_of(name):
                pose = pose @ self.locales[step].frame
            poses[name] = pose
        return poses

    @cached_property
    def rooms(self) -> tuple[str, ...]:
        """The locales that contain no other, in order."""
        parents = {locale.parent for locale in self.locales.values()}
        return tuple(name for name in self.locales if name not in parents)

    def locale_at(self, point_world: Any) -> str | None:
        """The deepest locale that contains a point (2,) on the floor or (3,) [m, world]."""
        p = np.asarray(point_world, float)
        if p.shape not in ((2,), (3,)):
            raise ValueError(f"expected a point (2,) or (3,), got shape {p.shape}")
        best: tuple[int, str] | None = None
        for name, locale in self.locales.items():
            world_from_locale = self._poses[name]
            lifted = p if p.size == 3 else np.array([*p, world_from_locale.translation[2]])
            depth = len(self.path_of(name))
            if locale.contains(self._inverses[name].apply(lifted)) and (best is None or depth > best[0]):
                best = depth, name
        return best[1] if best else None

    @cached_property
    def _inverses(self) -> dict[str, Pose]:
        return {name: pose.inverse() for name, pose in self._poses.items()}

    @cached_property
    def passages(self) -> nx.Graph:
        """Locales joined by open doorways; each edge carries ``doorways`` (tuple of Doorway)."""
        graph = nx.Graph()
        graph.add_nodes_from(self.rooms)
        for doorway in self.doorways:
            a, b = doorway.between
            known = graph.edges[a, b]["doorways"] if graph.has_edge(a, b) else ()
            graph.add_edge(a, b, doorways=(*known, doorway))
        return graph

    def doorways_of(self, locale: str) -> tuple[Doorway, ...]:
        """The open doorways of a locale."""
        self.locale(locale)
        return tuple(doorway for doorway in self.doorways if locale in doorway.between)

    def outline(self, locale: str) -> NDArray[np.float64]:
        """(k, 2) the free extent of a locale on the floor, counter-clockwise [m, world]."""
        own = self.locale(locale).outline
        return frozen(self._poses[locale].apply(np.column_stack([own, np.zeros(len(own))]))[:, :2])

    def obstacles(self, locale: str) -> tuple[NDArray[np.float64], ...]:
        """Footprints (4, 2) of what the robot could hit in a locale [m, world]."""
        self.locale(locale)
        return tuple(t.footprint_world for t in self.things if t.locale == locale and t.in_the_way)

    def landmark(self, name: str) -> Landmark:
        """Raises ValueError where no landmark has this name."""
        found = [mark for mark in self.landmarks if mark.name == name]
        if not found:
            raise ValueError(f"expected the name of a landmark of {self.name}, got {name!r}")
        return found[0]

    @cached_property
    def scene(self) -> Scene:
        """Model lines and surfaces in arrays, for :mod:`world_models.visibility`."""
        return build_scene(self.faces, self.landmarks)

    def check(self) -> list[Fault]:
        """What is wrong with this world, in the order of the file; empty for a sound one."""
        return [*self.building_faults, *(Fault(source, what) for source, what in checks.faults_of(self))]
