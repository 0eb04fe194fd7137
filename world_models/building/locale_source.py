"""Where locale data come from (§3.4): the interfaces of memory and compiled files.

The paper keeps a frame of slots for each locale (its place, contents and neighbours). Here "frame" means a coordinate
frame only; the paper's frame of a locale is its ``Locale`` with doorways, links, geometry and things.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from world_models.building.extents import LocaleExtent
from world_models.building.geometry.faces import Face
from world_models.building.geometry.landmarks import Landmark
from world_models.building.geometry.scene import Scene, build_scene
from world_models.building.locales import Doorway, Link, Locale
from world_models.building.things import Finding, Thing


@dataclass(frozen=True, eq=False)
class LocaleGeometry:
    """The faces and landmarks of a locale, or those that it shares with one neighbour (around an open door).

    Attributes:
        locale: the locale that they belong to.
        neighbour: the second locale from which they are seen; None for those of one locale only.
        faces, landmarks: each with its number in the world, ascending.
    """

    locale: str
    neighbour: str | None
    faces: tuple[tuple[int, Face], ...]
    landmarks: tuple[tuple[int, Landmark], ...]

    @cached_property
    def scene(self) -> Scene:
        """Its model lines and surfaces as arrays; cached."""
        return build_scene(self.faces, self.landmarks)


@dataclass(frozen=True, slots=True)
class PassageEdge:
    """An edge of a container's passage graph (Figure 8).

    A node is (locale, component): a locale that cannot be crossed between all of its doorways has several components.

    Attributes:
        passage: name of the doorway or link.
        between: the two nodes.
        rooms: the two rooms that the passage joins, each within the locale of its node.
    """

    passage: str
    between: tuple[tuple[str, int], tuple[str, int]]
    rooms: tuple[str, str]


class LocaleSource(Protocol):
    """Locale data by name, one locale at a time. An unknown name gives None or an empty result."""

    def locale(self, name: str, /) -> Locale | None: ...

    def children(self, name: str, /) -> tuple[str, ...]:
        """The locales that this one contains directly, in order."""

    def is_room(self, name: str, /) -> bool:
        """Whether this is a locale that contains no other."""

    def number(self, name: str, /) -> int:
        """The place of a locale in the order of the file; the root's is 0. Raises ValueError where there is none."""

    def extent(self, name: str, /) -> LocaleExtent:
        """Where a locale lies. Raises ValueError where there is none."""

    def extents_in(self, name: str, /) -> tuple[LocaleExtent, ...]:
        """Where the locales lie that this one contains directly, in the order of ``children``."""

    def near(self, x_m: float, y_m: float, margin_m: float, z_m: float | None = None, /) -> Sequence[str]:
        """Locales whose bounding rectangle, grown by a margin, holds a point [m, world]; in the order of the file.

        With ``z_m`` those that are on other floors than that height may be left out.
        """

    def doorways(self, locale: str, /) -> tuple[Doorway, ...]:
        """Its open doorways, in order."""

    def links(self, locale: str, /) -> tuple[Link, ...]:
        """Elevators and stairs that stop in it."""

    def geometry(self, locale: str, /) -> tuple[LocaleGeometry, ...]:
        """Its own geometry and what it shares with each neighbour."""

    def things(self, locale: str, /) -> tuple[Thing, ...]: ...

    def passage_edges(self, container: str, /) -> tuple[PassageEdge, ...]:
        """The passages between the locales directly in a container."""

    def components(self, locale: str, /) -> tuple[int, ...]:
        """For each component of a locale, in order, the component of its container; () for the root."""


class WorldSource(LocaleSource, Protocol):
    """Locale data by name, with what takes a search of the whole world."""

    @property
    def name(self) -> str:
        """Name of the world and of its root locale."""

    def names(self) -> Sequence[str]:
        """All locales, root first, then in the order of the file."""

    def passage(self, name: str, /) -> Doorway | Link | None: ...

    def named(self, words: str, /) -> Sequence[str]:
        """Locales with all these words in their name, kind or properties."""

    def all_doorways(self) -> tuple[Doorway, ...]: ...

    def all_links(self) -> tuple[Link, ...]: ...

    def all_geometry(self) -> Iterable[LocaleGeometry]: ...

    def all_things(self) -> tuple[Thing, ...]: ...

    def counts(self) -> Mapping[str, int]:
        """Numbers of rooms, open doorways, things, faces and landmarks."""

    def faults(self) -> tuple[Finding, ...]:
        """Parts of the description that could not be built."""
