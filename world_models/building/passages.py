"""Passages at every level of the hierarchy (§3.4, Figure 8), and routes found level by level (Figure 9).

A locale need not be connected within itself: two flats on one storey may meet only outdoors. Each locale therefore has
components, numbered from 0, within which one can move without leaving it. A container's passage graph joins the
components of the locales directly in it. So a route found at a high level can always be refined at the lower ones, and
a search looks at one container, however large the campus is.

Components were computed with all passages open. With some of them shut, components of the container that holds a shut
passage may split, and so may those of the containers above it; all others are as they were. Only these containers are
looked at, when a route asks for them: their edges, and the locales between them and the rooms at the ends of their
edges.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from world_models.building.locales import Doorway, Link

if TYPE_CHECKING:
    from world_models.building.locale_frame import LocaleFrame

Node = TypeVar("Node", bound=Hashable)
Numbered = tuple[str, int]
"""A locale and the number of one of its components, all passages open."""

Component = tuple[str, Hashable]
"""A locale and one of its components: its number, or the first component within it where a passage in it is shut."""


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


@dataclass(frozen=True, slots=True)
class PassageGraphs:
    """The passage graphs of all containers.

    Attributes:
        edges: of each container's graph.
        components: of each locale but the root: for each of its components the component of its container.
    """

    edges: Mapping[str, tuple[PassageEdge, ...]]
    components: Mapping[str, tuple[int, ...]]


def drivable_passages(passages: Iterable[Doorway | Link]) -> list[tuple[str, str, str]]:
    """(name, one locale, the other) of the passages that a robot on wheels can use: all but stairs."""
    return [(p.name, *p.between) for p in passages if isinstance(p, Doorway) or p.kind != "stairs"]


def build_passage_graphs(parents: Mapping[str, str | None], passages: Iterable[tuple[str, str, str]]) -> PassageGraphs:
    """The graphs of all containers, from the deepest up.

    Args:
        parents: container of each locale, root first; None for the root.
        passages: (name, one room, the other).
    """
    tree = _Hierarchy(parents)
    crossing: dict[str, list[tuple[str, str, str]]] = {}
    for name, a, b in passages:
        crossing.setdefault(tree.common(a, b), []).append((name, a, b))
    children: dict[str, list[str]] = {}
    for name, parent in parents.items():
        if parent is not None:
            children.setdefault(parent, []).append(name)
    edges: dict[str, tuple[PassageEdge, ...]] = {}
    components: dict[str, tuple[int, ...]] = {}
    sizes = {name: 1 for name in parents if name not in children}
    for container in sorted(children, key=tree.depth, reverse=True):
        own = [PassageEdge(name, (tree.component_below(a, container, components),
                                  tree.component_below(b, container, components)), (a, b))
               for name, a, b in crossing.get(container, ())]
        nodes = [(child, number) for child in children[container] for number in range(sizes[child])]
        numbers = _number_components(nodes, own)
        for child in children[container]:
            components[child] = tuple(numbers[child, number] for number in range(sizes[child]))
        sizes[container] = 1 + max(numbers.values(), default=0)
        edges[container] = tuple(own)
    return PassageGraphs(edges, components)


class _Hierarchy:
    """The contained-by hierarchy, from the container of each locale."""

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

    def component_below(self, room: str, container: str, components: Mapping[str, tuple[int, ...]]) -> Numbered:
        """The component directly in ``container`` that a room belongs to."""
        component: Numbered = (room, 0)
        while (parent := self._parents[component[0]]) != container:
            assert parent is not None
            component = parent, components[component[0]][component[1]]
        return component


def _number_components(nodes: list[Numbered], edges: list[PassageEdge]) -> dict[Numbered, int]:
    """The connected component of each node, numbered in the order of the nodes."""
    firsts = find_firsts(nodes, (edge.between for edge in edges))
    numbers = {first: number for number, first in enumerate(dict.fromkeys(firsts.values()))}
    return {node: numbers[firsts[node]] for node in nodes}


def find_firsts(nodes: Iterable[Node], pairs: Iterable[tuple[Node, Node]]) -> dict[Node, Node]:
    """For each node, also those of the pairs alone, the first of all that pairs join it with, if not itself."""
    beside: dict[Node, list[Node]] = {node: [] for node in nodes}
    for a, b in pairs:
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    firsts: dict[Node, Node] = {}
    for first in beside:
        todo = [] if first in firsts else [first]
        while todo:
            node = todo.pop()
            if node not in firsts:
                firsts[node] = first
                todo += beside[node]
    return firsts


@dataclass(frozen=True, eq=False)
class PassageTaken:
    """A passage, taken from room ``origin`` into room ``destination``."""

    passage: Doorway | Link
    origin: str
    destination: str


@dataclass(frozen=True, eq=False)
class Route:
    """A route at one level of the hierarchy.

    Attributes:
        container: the smallest locale that holds the route; the room itself where no passage is needed.
        steps: the passages in order; the way between two of them is left to a more detailed route.
    """

    container: str
    steps: tuple[PassageTaken, ...]


def find_route(
    frames: Mapping[str, LocaleFrame], origin: str, destination: str, shut: Collection[Doorway | Link] = ()
) -> Route | None:
    """The route with the fewest passages in the smallest locale that holds one; None where no passage leads there.

    Args:
        frames: of the locales, by name; those that are needed are asked for.
        shut: passages that cannot be used.
    """
    if origin == destination:
        return Route(origin, ())
    passages = OpenPassages(frames, shut)
    up, down = passages.components_above(origin), passages.components_above(destination)
    for depth, component in enumerate(up):
        if depth and component in down:
            start, goal = up[depth - 1], down[down.index(component) - 1]
            path = _shortest_path(passages.edges(component[0]), start, goal)
            return Route(component[0], tuple(_build_step(frames, edge, side) for edge, side in path))
    return None


def _build_step(frames: Mapping[str, LocaleFrame], edge: PassageEdge, side: int) -> PassageTaken:
    room = edge.rooms[side]
    passages: tuple[Doorway | Link, ...] = (*frames[room].doorways, *frames[room].links)
    return PassageTaken(next(p for p in passages if p.name == edge.passage), room, edge.rooms[1 - side])


def _shortest_path(edges: Iterable[OpenEdge], start: Component, goal: Component) -> list[tuple[PassageEdge, int]]:
    """Breadth-first search between connected nodes: each edge with the side on which it begins.

    Not networkx: of equally short paths the one over the first edges must be found, whatever library version.
    """
    ahead: dict[Component, list[tuple[Component, PassageEdge, int]]] = {}
    for item in edges:
        for side in (0, 1):
            ahead.setdefault(item.between[side], []).append((item.between[1 - side], item.edge, side))
    came: dict[Component, tuple[Component, PassageEdge, int]] = {}
    todo = deque([start])
    while todo and goal not in came:
        here = todo.popleft()
        for there, edge, side in ahead.get(here, ()):
            if there not in came and there != start:
                came[there] = here, edge, side
                todo.append(there)
    path: list[tuple[PassageEdge, int]] = []
    while goal != start:
        goal, edge, side = came[goal]
        path.append((edge, side))
    return path[::-1]


@dataclass(frozen=True, slots=True)
class OpenEdge:
    """An edge of a container's passage graph, with the components that it joins while some passages are shut."""

    edge: PassageEdge
    between: tuple[Component, Component]


class OpenPassages:
    """The passage graphs of the locales with these frames, with some passages shut."""

    def __init__(self, frames: Mapping[str, LocaleFrame], shut: Collection[Doorway | Link] = ()) -> None:
        """``shut``: doorways and links that cannot be used; each names the two rooms that it would join."""
        self._frames = frames
        self._shut = frozenset(passage.name for passage in shut)
        above = [[set(self._containers_of(room)) for room in passage.between] for passage in shut]
        self._changed: frozenset[str] = frozenset().union(*(first & second for first, second in above))
        self._edges: dict[str, tuple[OpenEdge, ...]] = {}
        self._groups: dict[str, dict[Component, Component]] = {}

    def edges(self, container: str) -> tuple[OpenEdge, ...]:
        """The open passages between the locales directly in a container, in order."""
        if container not in self._edges:
            self._edges[container] = tuple(
                OpenEdge(edge, (self._find_end(container, edge, 0), self._find_end(container, edge, 1)))
                for edge in self._frames[container].edges if edge.passage not in self._shut)
        return self._edges[container]

    def components_above(self, room: str) -> list[Component]:
        """The components that a room belongs to, from itself up to the root."""
        return list(self._climb(room))

    def _climb(self, room: str) -> Iterator[Component]:
        component: Component | None = (room, 0)
        while component is not None:
            yield component
            component = self._component_above(component)

    def _component_above(self, component: Component) -> Component | None:
        """The component of its container that a component belongs to; None for the root's."""
        name, number = component
        parent = self._frames[name].locale.parent
        if parent is None:
            return None
        if parent in self._changed:
            return parent, self._first_of(parent, component)
        assert isinstance(number, int)
        return parent, self._frames[name].components[number]

    def _first_of(self, container: str, component: Component) -> Component:
        """The component by which all are named that open passages of a container join with this one."""
        if container not in self._groups:
            self._groups[container] = find_firsts((), (edge.between for edge in self.edges(container)))
        return self._groups[container].get(component, component)

    def _find_end(self, container: str, edge: PassageEdge, side: int) -> Component:
        """The component directly in a container in which an edge ends."""
        known = edge.between[side]
        if known[0] not in self._changed:
            return known
        return next(found for found in self._climb(edge.rooms[side]) if found[0] == known[0])

    def _containers_of(self, room: str) -> list[str]:
        """The locales that contain a room, from the smallest to the root."""
        out = [room]
        while (parent := self._frames[out[-1]].locale.parent) is not None:
            out.append(parent)
        return out[1:]
