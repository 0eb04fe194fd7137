"""Passages at every level of the hierarchy (§3.4, Figure 8), and routes found there level by level (Figure 9).

A locale need not be connected within itself: two flats on one storey may meet only outdoors. Each locale therefore
has components, numbered from 0, within which one can get about without leaving it, and a container joins the
components of the locales in it by arcs. So a route found at a high level can always be refined at the lower ones, and
the search for it looks at one container, however large the campus is.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from world_models.building.locale_source import Arc
from world_models.building.locales import Doorway, Link

if TYPE_CHECKING:
    from world_models.building.locale_source import LocaleSource

Part = tuple[str, int]
"""A locale and the number of one of its components."""


@dataclass(frozen=True, slots=True)
class Network:
    """The arcs of every container, and for each part but the root's the component of its container."""

    arcs: Mapping[str, tuple[Arc, ...]]
    components: Mapping[Part, int]


def drivable_passages(passages: Iterable[Doorway | Link]) -> list[tuple[str, str, str]]:
    """(name, one locale, the other) of those that a robot on wheels can use."""
    return [(p.name, *p.between) for p in passages if isinstance(p, Doorway) or p.kind != "stairs"]


def network(parents: Mapping[str, str | None], passages: Iterable[tuple[str, str, str]]) -> Network:
    """From the container of every locale (root first) and the passages between rooms.

    Args:
        parents: container of each locale; None for the root.
        passages: (name, one locale, the other).
    """
    paths = _Paths(parents)
    crossing: dict[str, list[tuple[str, str, str]]] = {}
    for name, a, b in passages:
        crossing.setdefault(paths.common(a, b), []).append((name, a, b))
    children: dict[str, list[str]] = {}
    for name, parent in parents.items():
        if parent is not None:
            children.setdefault(parent, []).append(name)
    arcs: dict[str, tuple[Arc, ...]] = {}
    components: dict[Part, int] = {}
    sizes = {name: 1 for name in parents if name not in children}
    for container in sorted(children, key=paths.depth, reverse=True):
        own = [Arc(name, (paths.part_below(a, container, components), paths.part_below(b, container, components)))
               for name, a, b in crossing.get(container, ())]
        parts = [(child, number) for child in children[container] for number in range(sizes[child])]
        components |= _numbered(parts, own)
        sizes[container] = 1 + max((components[part] for part in parts), default=0)
        arcs[container] = tuple(own)
    return Network(arcs, components)


class _Paths:
    """The way up from each locale."""

    def __init__(self, parents: Mapping[str, str | None]) -> None:
        self._parents = parents
        self._depths: dict[str, int] = {}

    def depth(self, name: str) -> int:
        if name not in self._depths:
            parent = self._parents[name]
            self._depths[name] = 0 if parent is None else 1 + self.depth(parent)
        return self._depths[name]

    def common(self, a: str, b: str) -> str:
        """The smallest locale that contains both."""
        while a != b:
            deeper = a if self.depth(a) >= self.depth(b) else b
            above = self._parents[deeper] or deeper
            a, b = (above, b) if deeper is a else (a, above)
        return a

    def part_below(self, room: str, container: str, components: Mapping[Part, int]) -> Part:
        """The part directly in ``container`` that a room belongs to."""
        part: Part = (room, 0)
        while (parent := self._parents[part[0]]) != container:
            assert parent is not None
            part = (parent, components[part])
        return part


def _numbered(parts: list[Part], arcs: list[Arc]) -> dict[Part, int]:
    """The component of each part, numbered in their order."""
    leader = {part: part for part in parts}

    def found(part: Part) -> Part:
        while leader[part] != part:
            leader[part] = part = leader[leader[part]]
        return part

    for arc in arcs:
        leader[found(arc.between[0])] = found(arc.between[1])
    numbers: dict[Part, int] = {}
    return {part: numbers.setdefault(found(part), len(numbers)) for part in parts}


def parts_above(frames: LocaleSource, room: str) -> list[Part]:
    """The parts that a room belongs to, from itself up to the root."""
    parts: list[Part] = [(room, 0)]
    while (locale := frames.locale(parts[-1][0])) is not None and locale.parent is not None:
        parts.append((locale.parent, frames.component(*parts[-1])))
    return parts


@dataclass(frozen=True, eq=False)
class Step:
    """A passage, and from which of its two rooms into which it is taken."""

    passage: Doorway | Link
    origin: str
    destination: str


@dataclass(frozen=True, eq=False)
class Route:
    """A way at one level of the hierarchy.

    Attributes:
        container: the smallest locale within which there is a way; the room itself where no passage is needed.
        steps: the passages in order; what lies between two of them is left to a more detailed route.
    """

    container: str
    steps: tuple[Step, ...]


def find_route(frames: LocaleSource, origin: str, destination: str) -> Route | None:
    """The route with the fewest passages in the smallest locale that holds one; None where no passage leads there."""
    if origin == destination:
        return Route(origin, ())
    up, down = parts_above(frames, origin), parts_above(frames, destination)
    below = {part[0]: part for part in down}
    for step, (name, component) in enumerate(up):
        if step and below.get(name) == (name, component):
            start, goal = up[step - 1], down[down.index((name, component)) - 1]
            return Route(name, tuple(_step(frames, *step) for step in _fewest(frames.arcs(name), start, goal)))
    return None


def _step(frames: LocaleSource, name: str, side: int) -> Step:
    passage = frames.passage(name)
    assert passage is not None
    return Step(passage, passage.between[side], passage.between[1 - side])


def _fewest(arcs: Iterable[Arc], start: Part, goal: Part) -> list[tuple[str, int]]:
    """The shortest chain of arcs from part to part, which are known to be joined: (passage, side that it begins on)."""
    ahead: dict[Part, list[tuple[Part, str, int]]] = {}
    for arc in arcs:
        for side in (0, 1):
            ahead.setdefault(arc.between[side], []).append((arc.between[1 - side], arc.passage, side))
    came: dict[Part, tuple[Part, str, int]] = {start: (start, "", 0)}
    todo = deque([start])
    while todo and goal not in came:
        here = todo.popleft()
        for there, passage, side in ahead.get(here, ()):
            if there not in came:
                came[there] = (here, passage, side)
                todo.append(there)
    way: list[tuple[str, int]] = []
    while goal != start:
        goal, passage, side = came[goal]
        way.append((passage, side))
    return way[::-1]
