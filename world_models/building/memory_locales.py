"""Locale data in memory: the world of a TOML file."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from world_models.building.extents import LocaleExtent, bounding_box, bounding_rectangle, compute_reaches
from world_models.building.geometry.faces import Face
from world_models.building.geometry.landmarks import Landmark
from world_models.building.locale_source import LocaleGeometry, PassageEdge
from world_models.building.locales import Doorway, Link, Locale
from world_models.building.passages import PassageGraphs, build_passage_graphs, drivable_passages
from world_models.building.things import Finding, Thing
from world_models.frames import Pose

K = TypeVar("K")
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class MemoryLocales:
    """A :class:`world_models.building.locale_source.WorldSource` that holds all locales of a world."""

    name: str
    locales: Mapping[str, Locale]
    every_doorway: tuple[Doorway, ...]
    every_face: tuple[Face, ...]
    every_landmark: tuple[Landmark, ...]
    every_thing: tuple[Thing, ...] = ()
    every_link: tuple[Link, ...] = ()
    building_faults: tuple[Finding, ...] = ()

    def names(self) -> Sequence[str]:
        return tuple(self.locales)

    def locale(self, name: str) -> Locale | None:
        return self.locales.get(name)

    def children(self, name: str) -> tuple[str, ...]:
        return self._children.get(name, ())

    def is_room(self, name: str) -> bool:
        return name in self.locales and name not in self._children

    def near(self, x_m: float, y_m: float, margin_m: float, z_m: float | None = None) -> Sequence[str]:
        names, low, high = self._rectangles
        p = np.array([x_m, y_m])
        return [names[i] for i in np.flatnonzero(np.all((low - margin_m <= p) & (p <= high + margin_m), axis=1))]

    def number(self, name: str) -> int:
        return self.extent(name).number

    def extent(self, name: str) -> LocaleExtent:
        if name not in self.locales:
            raise ValueError(f"expected a locale of {self.name}, got {name!r}")
        return self._extents[name]

    def extents_in(self, name: str) -> tuple[LocaleExtent, ...]:
        return tuple(self._extents[child] for child in self.children(name))

    def doorways(self, locale: str) -> tuple[Doorway, ...]:
        return self._doorways.get(locale, ())

    def links(self, locale: str) -> tuple[Link, ...]:
        return tuple(link for link in self.every_link if locale in link.between)

    def geometry(self, locale: str) -> tuple[LocaleGeometry, ...]:
        return self._geometry.get(locale, ())

    def things(self, locale: str) -> tuple[Thing, ...]:
        return self._things.get(locale, ())

    def passage_edges(self, container: str) -> tuple[PassageEdge, ...]:
        return self._graphs.edges.get(container, ())

    def components(self, locale: str) -> tuple[int, ...]:
        return self._graphs.components.get(locale, ())

    def passage(self, name: str) -> Doorway | Link | None:
        return self._passages.get(name)

    def named(self, words: str) -> Sequence[str]:
        wanted = words_of(words)
        return [name for name, locale in self.locales.items() if wanted <= words_about(locale)]

    def all_doorways(self) -> tuple[Doorway, ...]:
        return self.every_doorway

    def all_links(self) -> tuple[Link, ...]:
        return self.every_link

    def all_geometry(self) -> Sequence[LocaleGeometry]:
        return self._all_geometry

    def all_things(self) -> tuple[Thing, ...]:
        return self.every_thing

    def counts(self) -> Mapping[str, int]:
        return {"room": len(self.locales) - len(self._children), "open doorway": len(self.every_doorway),
                "thing": len(self.every_thing), "face": len(self.every_face), "landmark": len(self.every_landmark)}

    def faults(self) -> tuple[Finding, ...]:
        return self.building_faults

    # -- indices ---------------------------------------------------------------------------------------------------

    @cached_property
    def _children(self) -> dict[str, tuple[str, ...]]:
        return _group((locale.parent, name) for name, locale in self.locales.items() if locale.parent is not None)

    @cached_property
    def _doorways(self) -> dict[str, tuple[Doorway, ...]]:
        return _group((name, doorway) for doorway in self.every_doorway for name in doorway.between)

    @cached_property
    def _things(self) -> dict[str, tuple[Thing, ...]]:
        return _group((thing.locale, thing) for thing in self.every_thing)

    @cached_property
    def _passages(self) -> dict[str, Doorway | Link]:
        passages: list[Doorway | Link] = [*self.every_link, *self.every_doorway]
        return {passage.name: passage for passage in passages}

    @cached_property
    def _graphs(self) -> PassageGraphs:
        parents = {name: locale.parent for name, locale in self.locales.items()}
        return build_passage_graphs(parents, drivable_passages((*self.every_doorway, *self.every_link)))

    @cached_property
    def _all_geometry(self) -> tuple[LocaleGeometry, ...]:
        faces = _group(((face.locale, face.neighbour), (i, face)) for i, face in enumerate(self.every_face))
        marks = _group(((mark.locale, mark.neighbour), (i, mark)) for i, mark in enumerate(self.every_landmark))
        keys = list(dict.fromkeys([*faces, *marks]))
        return tuple(LocaleGeometry(*key, faces.get(key, ()), marks.get(key, ())) for key in keys)

    @cached_property
    def _geometry(self) -> dict[str, tuple[LocaleGeometry, ...]]:
        return _group((name, part) for part in self._all_geometry
                      for name in dict.fromkeys((part.locale, part.neighbour)) if name is not None)

    @cached_property
    def _extents(self) -> dict[str, LocaleExtent]:
        poses: dict[str, Pose] = {}

        def pose_of(name: str) -> Pose:
            if name not in poses:
                parent, frame = self.locales[name].parent, self.locales[name].frame
                poses[name] = frame if parent is None else pose_of(parent) @ frame
            return poses[name]

        boxes = {name: bounding_box(locale, pose_of(name)) for name, locale in self.locales.items()}
        reaches = compute_reaches({name: locale.parent for name, locale in self.locales.items()}, boxes)
        return {name: LocaleExtent(name, number, self.is_room(name), bounding_rectangle(box), reaches[name])
                for number, (name, box) in enumerate(boxes.items())}

    @cached_property
    def _rectangles(self) -> tuple[tuple[str, ...], NDArray[np.float64], NDArray[np.float64]]:
        """Names of all locales, and low and high corners (n, 2) of their bounding rectangles [m, world]."""
        rectangles = np.array([extent.rectangle for extent in self._extents.values()]).reshape(-1, 4)
        return tuple(self._extents), rectangles[:, :2], rectangles[:, 2:]


def words_of(text: str) -> frozenset[str]:
    """The words of a name or a phrase in lower case, without a possessive's s."""
    return frozenset(word for word in re.split(r"[^a-z0-9]+", text.lower().replace("'s", "")) if word)


def words_about(locale: Locale) -> frozenset[str]:
    """The words by which people may name a locale: those of its name, kind and text properties."""
    texts = [locale.name, locale.kind, *(value for value in locale.properties.values() if isinstance(value, str))]
    return frozenset().union(*map(words_of, texts))


def _group(pairs: Iterable[tuple[K, T]]) -> dict[K, tuple[T, ...]]:
    """The values of each key, in order."""
    groups: dict[K, list[T]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return {key: tuple(values) for key, values in groups.items()}
