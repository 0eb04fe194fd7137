"""The world (§3.4): locales in a contained-by hierarchy, their doorways, faces and landmarks, and queries on them.

A world takes locale data from a :class:`~world_models.building.locale_source.WorldSource`, one locale at a time and
only when asked, so that a robot in a room loads that room. The attributes that name everything (``faces``,
``things``, ``scene``, ...) are for drawing and checking.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, TypeVar

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from world_models.building.faces import Face
from world_models.building.landmarks import Landmark
from world_models.building.locale_source import LocaleGeometry, WorldSource
from world_models.building.locales import Doorway, Link, Locale
from world_models.building.passages import Route, find_route
from world_models.building.scene import Scene, build_scene, concatenate_scenes
from world_models.building.things import Finding, Thing
from world_models.frames import Pose, frozen

T = TypeVar("T")

FLOOR_MARGIN_M = 0.5
"""A camera this far above a room's ceiling or below its floor may still be in its doorway."""

MAX_SCENES = 32
"""Size of the cache of scenes."""


class World:
    """The model of a building; the root locale's coordinate frame is the world frame.

    Attributes:
        locale_source: where locale data come from.
        name: of the world and of its root locale.
        cache: results that others compute from the world once and keep with it, by name.
    """

    def __init__(self, locale_source: WorldSource) -> None:
        self.locale_source = locale_source
        self.name = locale_source.name
        self._poses: dict[str, tuple[Pose, Pose]] = {}
        self._landmarks: dict[int, Landmark] = {}
        self._scenes: dict[tuple[str, ...], Scene] = {}
        self.cache: dict[str, Any] = {}

    def cached(self, name: str, max_items: int, key: Hashable, compute: Callable[[], T]) -> T:
        """The result for a key from the cache ``name``, which keeps the last ``max_items``; computed if not there."""
        known: dict[Hashable, T] = self.cache.setdefault(name, {})
        if key not in known:
            if len(known) >= max_items:
                del known[next(iter(known))]
            known[key] = compute()
        return known[key]

    @property
    def root(self) -> str:
        """Name of the locale that contains all others."""
        return self.name

    # -- one locale ------------------------------------------------------------------------------------------------

    def locale(self, name: str) -> Locale:
        """A locale by name. Raises ValueError where there is none."""
        found = self.locale_source.locale(name)
        if found is None:
            names = self.locale_source.names()
            shown = ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
            raise ValueError(f"expected a locale of {self.name} ({shown}), got {name!r}")
        return found

    def is_room(self, name: str) -> bool:
        """Whether this is a locale that contains no other."""
        return self.locale_source.is_room(name)

    def children_of(self, name: str) -> tuple[str, ...]:
        """The locales that this one contains directly."""
        self.locale(name)
        return self.locale_source.children(name)

    def rooms_in(self, name: str) -> Iterator[str]:
        """The rooms within a locale, or the locale itself where it is a room."""
        if self.is_room(name):
            yield name
        for child in self.children_of(name):
            yield from self.rooms_in(child)

    def path_of(self, name: str) -> tuple[str, ...]:
        """The locales that contain this one, from the root down to itself."""
        path = [name]
        while (parent := self.locale(path[-1]).parent) is not None:
            path.append(parent)
        return tuple(reversed(path))

    def common(self, *names: str) -> str:
        """The smallest locale that contains all of these."""
        paths = [self.path_of(name) for name in names]
        shared = self.root
        for steps in zip(*paths, strict=False):
            if len(set(steps)) == 1:
                shared = steps[0]
        return shared

    def world_from_locale(self, name: str) -> Pose:
        """Pose of a locale's coordinate frame."""
        return self._pose(name)[0]

    def floor_m(self, name: str) -> float:
        """Height of a locale's floor [m, world]."""
        return float(self.world_from_locale(name).translation[2])

    def _pose(self, name: str) -> tuple[Pose, Pose]:
        """world_from_locale and locale_from_world; cached."""
        if name not in self._poses:
            locale = self.locale(name)
            above = self.world_from_locale(locale.parent) if locale.parent is not None else Pose.identity()
            pose = above @ locale.frame
            self._poses[name] = pose, pose.inverse()
        return self._poses[name]

    def doorways_of(self, locale: str) -> tuple[Doorway, ...]:
        """The open doorways of a locale."""
        self.locale(locale)
        return self.locale_source.doorways(locale)

    def links_of(self, locale: str) -> tuple[Link, ...]:
        """The elevators and stairs that stop in a locale."""
        self.locale(locale)
        return self.locale_source.links(locale)

    def things_of(self, locale: str) -> tuple[Thing, ...]:
        """The things that stand in a locale."""
        self.locale(locale)
        return self.locale_source.things(locale)

    def outline(self, locale: str) -> NDArray[np.float64]:
        """(k, 2) free extent of a locale on the floor, counter-clockwise [m, world]."""
        own = self.locale(locale).outline
        return frozen(self._pose(locale)[0].apply(np.column_stack([own, np.zeros(len(own))]))[:, :2])

    def obstacles(self, locale: str) -> tuple[NDArray[np.float64], ...]:
        """Footprints (4, 2) of the things in a locale that the robot could hit [m, world]."""
        return tuple(t.footprint_world for t in self.things_of(locale) if t.is_obstacle)

    # -- places and routes -----------------------------------------------------------------------------------------

    def locale_at(self, point_world: Any) -> str | None:
        """The deepest locale that contains a point (2,) on the floor or (3,) [m, world]."""
        p = np.asarray(point_world, float)
        if p.shape not in ((2,), (3,)):
            raise ValueError(f"expected a point (2,) or (3,), got shape {p.shape}")
        best: tuple[int, str] | None = None
        for name in self.locale_source.near(float(p[0]), float(p[1]), 0.0):
            world_from_locale, locale_from_world = self._pose(name)
            lifted = p if p.size == 3 else np.array([*p, world_from_locale.translation[2]])
            depth = len(self.path_of(name))
            if (best is None or depth > best[0]) and self.locale(name).contains(locale_from_world.apply(lifted)):
                best = depth, name
        return best[1] if best else None

    def rooms_near(self, point_world: Any, margin_m: float) -> tuple[str, ...]:
        """The rooms whose bounding rectangle is at most ``margin_m`` from a point (2,) or (3,) [m, world]."""
        x, y, *z = (float(value) for value in np.asarray(point_world, float))
        rooms = (name for name in self.locale_source.near(x, y, margin_m) if self.is_room(name))
        return tuple(name for name in rooms if not z or self._reaches(name, z[0]))

    def _reaches(self, name: str, z_m: float) -> bool:
        """Whether a height is between floor and ceiling of a locale, within FLOOR_MARGIN_M."""
        base = self.floor_m(name)
        return base - FLOOR_MARGIN_M <= z_m <= base + self.locale(name).height_m + FLOOR_MARGIN_M

    def route(self, origin: str, destination: str) -> Route | None:
        """The route from room to room at the highest level at which they differ; None where there is none."""
        for name in (origin, destination):
            self.locale(name)
        return find_route(self.locale_source, origin, destination)

    def walk(self, origin: str, destination: str) -> list[str] | None:
        """The rooms of the route with the fewest passages, stairs included; None where there is none.

        It searches the passages of the whole world.
        """
        passages: tuple[Doorway | Link, ...] = (*self.doorways, *self.links)
        ways: nx.Graph = nx.Graph(passage.between for passage in passages)
        try:
            way: list[str] = nx.shortest_path(ways, origin, destination)
        except (nx.NetworkXNoPath, nx.NodeNotFound):
            return None
        return way

    def passage(self, name: str) -> Doorway | Link:
        """A doorway or link by name. Raises ValueError where there is none."""
        found = self.locale_source.passage(name)
        if found is None:
            raise ValueError(f"expected a passage of {self.name}, got {name!r}")
        return found

    # -- what is seen ----------------------------------------------------------------------------------------------

    def scene_of(self, locales: Iterable[str]) -> Scene:
        """Model lines and surfaces of these locales, with those shared with neighbours, as arrays; cached."""
        names = tuple(sorted(locales))
        if names not in self._scenes:
            if len(self._scenes) >= MAX_SCENES:
                del self._scenes[next(iter(self._scenes))]
            self._scenes[names] = self._joined(names)
        return self._scenes[names]

    def _joined(self, locales: Sequence[str]) -> Scene:
        parts = self._geometry_of(locales)
        scenes = [self._scene_part(parts[key]) for key in sorted(parts, key=str)]
        return concatenate_scenes(scenes) if scenes else build_scene((), ())

    def _geometry_of(self, locales: Iterable[str]) -> dict[tuple[str, str | None], LocaleGeometry]:
        """The geometry of several locales, each part once, by (locale, neighbour)."""
        return {(part.locale, part.neighbour): part for name in locales for part in self.locale_source.geometry(name)}

    def _scene_part(self, part: LocaleGeometry) -> Scene:
        self._landmarks.update(part.landmarks)
        return part.scene

    @cached_property
    def landmarks(self) -> Sequence[Landmark]:
        """All landmarks by number; those of locales that were loaded are at hand."""
        return _Landmarks(self)

    def landmark(self, name: str) -> Landmark:
        """A landmark by name. Raises ValueError where there is none."""
        found = [mark for mark in self.landmarks if mark.name == name]
        if not found:
            raise ValueError(f"expected the name of a landmark of {self.name}, got {name!r}")
        return found[0]

    # -- everything ------------------------------------------------------------------------------------------------

    @cached_property
    def locales(self) -> Mapping[str, Locale]:
        """All locales by name, root first, then in the order of the file; each is loaded when asked for."""
        return _Locales(self.locale_source)

    @cached_property
    def rooms(self) -> tuple[str, ...]:
        """The locales that contain no other, in the order of the file."""
        return tuple(name for name in self.locale_source.names() if self.is_room(name))

    @property
    def doorways(self) -> tuple[Doorway, ...]:
        """All open doorways."""
        return self.locale_source.all_doorways()

    @property
    def links(self) -> tuple[Link, ...]:
        """All elevators and stairs."""
        return self.locale_source.all_links()

    @property
    def things(self) -> tuple[Thing, ...]:
        """All things."""
        return self.locale_source.all_things()

    @cached_property
    def faces(self) -> tuple[Face, ...]:
        """All barriers and doorways, by number; their regions are what is drawn."""
        return _in_order(pair for part in self.locale_source.all_geometry() for pair in part.faces)

    def faces_within(self, name: str) -> tuple[Face, ...]:
        """The faces of all rooms in a locale and of the rooms beyond its doorways, by number."""
        inside = tuple(self.rooms_in(name))
        beyond = [doorway.other(room) for room in inside for doorway in self.locale_source.doorways(room)]
        parts = self._geometry_of(dict.fromkeys((*inside, *beyond)))
        return _in_order(pair for part in parts.values() for pair in part.faces)

    def faces_of(self, name: str) -> tuple[Face, ...]:
        """The faces of a locale, without those that belong to its neighbours."""
        return tuple(face for p in self.locale_source.geometry(name) if p.locale == name for _, face in p.faces)

    @cached_property
    def scene(self) -> Scene:
        """Model lines and surfaces of the whole world."""
        scenes = [self._scene_part(part) for part in self.locale_source.all_geometry()]
        return concatenate_scenes(scenes or [build_scene((), ())])

    @cached_property
    def passages(self) -> nx.Graph:
        """Rooms joined by open doorways; each edge carries ``doorways`` (tuple of Doorway)."""
        graph = nx.Graph()
        graph.add_nodes_from(self.rooms)
        for doorway in self.doorways:
            a, b = doorway.between
            known = graph.edges[a, b]["doorways"] if graph.has_edge(a, b) else ()
            graph.add_edge(a, b, doorways=(*known, doorway))
        return graph

    def counts(self) -> Mapping[str, int]:
        """Numbers of rooms, open doorways, things, faces and landmarks."""
        return self.locale_source.counts()

    @property
    def building_faults(self) -> tuple[Finding, ...]:
        """Parts of the description that could not be built."""
        return self.locale_source.faults()


def _in_order(numbered: Iterable[tuple[int, T]]) -> tuple[T, ...]:
    """Items by their number in the world."""
    return tuple(item for _, item in sorted(numbered, key=lambda pair: pair[0]))


class _Locales(Mapping[str, Locale]):
    """Locales by name, each loaded when asked for."""

    def __init__(self, locale_source: WorldSource) -> None:
        self._locale_source = locale_source

    def __getitem__(self, name: str) -> Locale:
        found = self._locale_source.locale(name)
        if found is None:
            raise KeyError(name)
        return found

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._locale_source.locale(name) is not None

    def __iter__(self) -> Iterator[str]:
        return iter(self._locale_source.names())

    def __len__(self) -> int:
        return len(self._locale_source.names())


class _Landmarks(Sequence[Landmark]):
    """Landmarks by number; one of a locale that was not loaded yet loads all."""

    def __init__(self, world: World) -> None:
        self._world = world

    def __getitem__(self, number: Any) -> Any:
        if isinstance(number, slice):
            return [self[i] for i in range(*number.indices(len(self)))]
        known = self._world._landmarks
        if number not in known:
            for part in self._world.locale_source.all_geometry():
                known.update(part.landmarks)
        if number not in known:
            raise IndexError(f"expected the number of one of {len(self)} landmarks, got {number}")
        return known[number]

    def __len__(self) -> int:
        return self._world.counts()["landmark"]
