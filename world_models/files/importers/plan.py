"""What an importer found in a building file, before it becomes a world: spaces, openings, things, and what was said."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Steps = tuple[tuple[float, float, float, float, float, float], ...]
"""Boxes x0, x1, y0, y1, z0, z1 in a thing's own frame [m]."""


class BuildingError(ValueError):
    """A building file that cannot be read: names the file, what was expected and what came."""


@dataclass(frozen=True, slots=True)
class Storey:
    """A floor of the building and its height above the file's zero [m]."""

    name: str
    elevation_m: float


@dataclass(frozen=True, eq=False, slots=True)
class Space:
    """A room: ``outline`` (k, 2) on the plan of the building [m], counter-clockwise; ``floor_m`` above the file's zero.

    ``label`` is the file's own name for it.
    """

    name: str
    kind: str
    label: str
    storey: str
    outline: Floats
    floor_m: float
    height_m: float


@dataclass(frozen=True, eq=False, slots=True)
class Gap:
    """A door or another way through a wall of a storey.

    Attributes:
        name, storey: of the door.
        centre: (2,) on the plan [m].
        width_m, height_m: of the opening.
        rooms: the spaces that the file says it joins; empty where it says nothing.
        along: (2,) direction along its wall on the plan, where that is known.
        has_leaf: whether it is a door; else it is a passage, and nothing where it does not lead from space to space.
    """

    name: str
    storey: str
    centre: Floats
    width_m: float
    height_m: float
    rooms: tuple[str, ...] = ()
    along: Floats | None = None
    has_leaf: bool = True


@dataclass(frozen=True, eq=False, slots=True)
class Window:
    """A window: (2,) centre and (2,) direction along its wall on the plan, sill above the file's zero [m]."""

    name: str
    storey: str
    centre: Floats
    along: Floats
    width_m: float
    sill_m: float
    height_m: float


@dataclass(frozen=True, eq=False, slots=True)
class Furnishing:
    """Something that stands in a space: boxes round (2,) ``at`` on the plan, turned; z above the file's zero."""

    name: str
    kind: str
    room: str
    at: Floats
    turn_rad: float
    boxes: Steps


@dataclass(frozen=True, slots=True)
class Way:
    """A passage between two spaces that share no wall: kind is stairs or elevator."""

    name: str
    kind: str
    between: tuple[str, str]


@dataclass
class Account:
    """What was used of a file, what was guessed, and what was left out; each a sentence."""

    used: list[str] = field(default_factory=list)
    guessed: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        parts = (("used", self.used), ("guessed", self.guessed), ("left out", self.left_out))
        return "\n".join(f"{title}\n" + "\n".join(f"  {line}" for line in lines or ["nothing"])
                         for title, lines in parts)


@dataclass
class Plan:
    """Everything that was found; storeys from the lowest up.

    ``barriers`` are the shadows of walls and railings by storey: no wide opening is cut where one stands.
    """

    name: str
    source: str
    storeys: list[Storey] = field(default_factory=list)
    spaces: list[Space] = field(default_factory=list)
    gaps: list[Gap] = field(default_factory=list)
    without_wall: set[frozenset[str]] = field(default_factory=set)
    barriers: dict[str, list[shapely.Geometry]] = field(default_factory=dict)
    windows: list[Window] = field(default_factory=list)
    furnishings: list[Furnishing] = field(default_factory=list)
    ways: list[Way] = field(default_factory=list)
    account: Account = field(default_factory=Account)

    def on(self, storey: str) -> list[Space]:
        """The spaces of a storey."""
        return [space for space in self.spaces if space.storey == storey]

    def space(self, name: str) -> Space:
        return next(space for space in self.spaces if space.name == name)


class Names:
    """Names for locales and doors: words joined by hyphens, each given once."""

    def __init__(self, *taken: str) -> None:
        self._taken = set(taken)

    def new(self, text: str, otherwise: str) -> str:
        base = slug(text) or otherwise
        name, number = base, 1
        while name in self._taken:
            number += 1
            name = f"{base}-{number}"
        self._taken.add(name)
        return name


def slug(text: str) -> str:
    """Lower-case words joined by hyphens; letters of any script are kept."""
    return "-".join(re.findall(r"\w+", text.lower().replace("'", "").replace("_", " ")))[:60].strip("-")
