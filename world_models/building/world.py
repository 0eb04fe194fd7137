"""The world (§3.4): the whole building as a file describes it; the attributes name everything in it.

Files, drawings and the simulator use the whole. The robot knows the locale frames that it asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, TypeVar

import networkx as nx

from world_models.building.building import Building
from world_models.building.geometry.faces import Face
from world_models.building.geometry.landmarks import Landmark
from world_models.building.geometry.scene import Scene, build_scene, concatenate_scenes
from world_models.building.locale_source import WorldSource
from world_models.building.locales import Doorway, Link, Locale
from world_models.building.things import Finding, Thing

T = TypeVar("T")


class World(Building):
    """The model of a building.

    Attributes:
        locale_source: where locale data come from.
        name: of the world and of its root locale.
    """

    locale_source: WorldSource

    def __init__(self, locale_source: WorldSource) -> None:
        super().__init__(locale_source)
        self.name = locale_source.name
        self._results: dict[str, dict[Hashable, Any]] = {}

    def cached(self, name: str, max_items: int, key: Hashable, compute: Callable[[], T]) -> T:
        known: dict[Hashable, T] = self._results.setdefault(name, {})
        if key not in known:
            result = compute()
            while len(known) >= max_items:
                del known[next(iter(known))]
            known[key] = result
        return known[key]

    @property
    def root(self) -> str:
        return self.name

    def locale(self, name: str) -> Locale:
        found = self.locale_source.locale(name)
        if found is None:
            names = self.locale_source.names()
            shown = ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
            raise ValueError(f"expected a locale of {self.name} ({shown}), got {name!r}")
        return found

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
        scenes = [part.scene for part in self.locale_source.all_geometry()]
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
    """Landmarks by number."""

    def __init__(self, world: World) -> None:
        self._world = world

    @cached_property
    def _known(self) -> dict[int, Landmark]:
        return {number: mark for part in self._world.locale_source.all_geometry() for number, mark in part.landmarks}

    def __getitem__(self, number: Any) -> Any:
        if isinstance(number, slice):
            return [self[i] for i in range(*number.indices(len(self)))]
        known = self._known
        if number not in known:
            raise IndexError(f"expected the number of one of {len(self)} landmarks, got {number}")
        return known[number]

    def __len__(self) -> int:
        return self._world.counts()["landmark"]
