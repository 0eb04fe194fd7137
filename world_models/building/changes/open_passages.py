"""Passage graphs without the passages that are shut (§3.4, Figure 8).

A container's components were computed with all passages open. With some of them shut, components of the container that
holds a shut passage may split, and so may those of the containers above it; all others are as they were. Only these
containers are looked at, when a route asks for them: their edges, and the locales between them and the rooms at the
ends of their edges.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import networkx as nx

from world_models.building.locales import Doorway, Link

if TYPE_CHECKING:
    from world_models.building.locale_source import LocaleSource, PassageEdge

Component = tuple[str, Hashable]
"""A locale and one of its components: its number, or the first component within it where a passage in it is shut."""


@dataclass(frozen=True, slots=True)
class OpenEdge:
    """An edge of a container's passage graph, with the components that it joins while some passages are shut."""

    edge: PassageEdge
    between: tuple[Component, Component]


class OpenPassages:
    """The passage graphs of a building, with some passages shut."""

    def __init__(self, source: LocaleSource, shut: Collection[Doorway | Link] = ()) -> None:
        """``shut``: doorways and links that cannot be used; each names the two rooms that it would join."""
        self._source = source
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
                for edge in self._source.passage_edges(container) if edge.passage not in self._shut)
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
        locale = self._source.locale(name)
        if locale is None or locale.parent is None:
            return None
        if locale.parent in self._changed:
            return locale.parent, self._first_of(locale.parent, component)
        assert isinstance(number, int)
        return locale.parent, self._source.components(name)[number]

    def _first_of(self, container: str, component: Component) -> Component:
        """The component by which all are named that open passages of a container join with this one."""
        if container not in self._groups:
            graph: nx.Graph = nx.Graph(edge.between for edge in self.edges(container))
            groups: dict[Component, Component] = {}
            for first in graph:
                if first not in groups:
                    groups |= dict.fromkeys(nx.node_connected_component(graph, first), first)
            self._groups[container] = groups
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
        while (locale := self._source.locale(out[-1])) is not None and locale.parent is not None:
            out.append(locale.parent)
        return out[1:]
