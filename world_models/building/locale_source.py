"""Where a world's frames come from (§3.4): memory or a file. A world asks for those of one locale at a time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from world_models.building.faces import Face
from world_models.building.landmarks import Landmark
from world_models.building.locales import Doorway, Link, Locale
from world_models.building.scene import Scene, build_scene
from world_models.building.things import Finding, Thing


@dataclass(frozen=True, eq=False)
class LocaleGeometry:
    """The faces and landmarks of a locale, or those that it shares with one neighbour (the frame of an open door).

    Attributes:
        locale: whose they are.
        neighbour: the locale from which they are seen too; None for those of one room only.
        faces, landmarks: each with its number in the world, ascending.
    """

    locale: str
    neighbour: str | None
    faces: tuple[tuple[int, Face], ...]
    landmarks: tuple[tuple[int, Landmark], ...]

    @cached_property
    def scene(self) -> Scene:
        """Its model lines and surfaces in arrays, worked out once."""
        return build_scene(self.faces, self.landmarks)


@dataclass(frozen=True, slots=True)
class Arc:
    """A passage as its container sees it (Figure 8): between two of its parts.

    A part is a locale with the number of one of its components: a locale that cannot be crossed from each of its
    doorways to each other is several parts.

    Attributes:
        passage: name of the doorway or link.
        between: the two parts, (name of the locale, component).
    """

    passage: str
    between: tuple[tuple[str, int], tuple[str, int]]


class LocaleSource(Protocol):
    """What a world needs of its memory. Names that it does not know give None or nothing."""

    @property
    def name(self) -> str:
        """Of the world and of its root locale."""

    def names(self) -> Sequence[str]:
        """All locales, root first, then in the order of the file."""

    def locale(self, name: str, /) -> Locale | None: ...

    def children(self, name: str, /) -> tuple[str, ...]:
        """The locales that this one directly contains, in order."""

    def is_room(self, name: str, /) -> bool:
        """Whether it is a locale that contains no other."""

    def near(self, x_m: float, y_m: float, margin_m: float, /) -> Sequence[str]:
        """Locales whose rectangle on the plan, grown by a margin, holds a point [m, world]; in the file's order."""

    def doorways(self, locale: str, /) -> tuple[Doorway, ...]:
        """Its open doorways, in order."""

    def links(self, locale: str, /) -> tuple[Link, ...]:
        """Elevators and stairs that stop in it."""

    def geometry(self, locale: str, /) -> tuple[LocaleGeometry, ...]:
        """Its own packet and those that it shares."""

    def things(self, locale: str, /) -> tuple[Thing, ...]: ...

    def arcs(self, container: str, /) -> tuple[Arc, ...]:
        """The passages between the parts of a locale."""

    def component(self, locale: str, component: int, /) -> int:
        """To which component of its container a component of a locale belongs."""

    def passage(self, name: str, /) -> Doorway | Link | None: ...

    def named(self, words: str, /) -> Sequence[str]:
        """Locales with all these words in their name, kind or owner."""

    def all_doorways(self) -> tuple[Doorway, ...]: ...

    def all_links(self) -> tuple[Link, ...]: ...

    def all_geometry(self) -> Iterable[LocaleGeometry]: ...

    def all_things(self) -> tuple[Thing, ...]: ...

    def counts(self) -> Mapping[str, int]:
        """How many rooms, doorways, things, faces and landmarks there are."""

    def faults(self) -> tuple[Finding, ...]:
        """What could not be built."""
