"""Laws of routes with passages shut, in random hierarchies: as if the world had been built without these passages."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from world_models.building.locale_frame import LocaleFrame
from world_models.building.locales import Doorway, Link, Locale
from world_models.building.passages import Route, find_route
from world_models.building.world import build_frames
from world_models.frames import Pose

SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
THRESHOLDS = np.zeros((2, 2, 2))

Passages = tuple[Doorway | Link, ...]
Hierarchy = tuple[dict[str, str | None], Passages, Passages, list[str]]
Frames = Mapping[str, LocaleFrame]


def build_source(parents: dict[str, str | None], passages: Sequence[Doorway | Link]) -> Frames:
    locales = {name: Locale(name, "place", parent, Pose.identity(), SQUARE, 3.0) for name, parent in parents.items()}
    doorways = tuple(passage for passage in passages if isinstance(passage, Doorway))
    links = tuple(passage for passage in passages if isinstance(passage, Link))
    return build_frames(locales, doorways, links=links)


@st.composite
def hierarchies(draw: st.DrawFn) -> Hierarchy:
    """Parents, passages, some of these that are shut, and the rooms."""
    parents: dict[str, str | None] = {"world": None}
    containers = ["world"]
    for number in range(draw(st.integers(0, 6))):
        parents[f"c{number}"] = draw(st.sampled_from(containers))
        containers.append(f"c{number}")
    for number in range(draw(st.integers(2, 14))):
        parents[f"r{number}"] = draw(st.sampled_from(containers))
    rooms = [name for name in parents if name not in set(parents.values())]
    passages: list[Doorway | Link] = []
    for number in range(draw(st.integers(0, 24))):
        a, b = draw(st.sampled_from(rooms)), draw(st.sampled_from(rooms))
        kind = draw(st.sampled_from(["door", "door", "door", "elevator", "stairs"]))
        if a != b and kind == "door":
            passages.append(Doorway(f"p{number}", (a, b), THRESHOLDS, 2.0))
        elif a != b:
            passages.append(Link(f"p{number}", kind, (a, b), np.zeros((2, 3))))
    shut = tuple(passage for passage in passages if draw(st.integers(0, 3)) == 0)
    return parents, tuple(passages), shut, rooms


def steps_of(route: Route | None) -> tuple[str, list[tuple[str, str, str]]] | None:
    return route and (route.container, [(s.passage.name, s.origin, s.destination) for s in route.steps])


def refine_route(source: Frames, origin: str, destination: str, shut: Passages, depth: int = 0) -> Any:
    """(room, passage, room, ..., room) of a refined route; None where there is none."""
    route = find_route(source, origin, destination, shut)
    if route is None:
        return None
    assert depth < 20
    way, here = [origin], origin
    ends = [*((step.origin, step.passage.name, step.destination) for step in route.steps), (destination, None, None)]
    for at, passage, beyond in ends:
        if at != here:
            part = refine_route(source, here, at, shut, depth + 1)
            assert part is not None, "a route at a high level can always be refined"
            way += part[1:]
        if passage is not None:
            way += [passage, beyond]
            here = beyond
    return way


@settings(deadline=None, max_examples=300)
@given(hierarchies(), st.data())
def test_a_route_is_that_of_a_world_without_the_shut_passages(world: Hierarchy, data: st.DataObject) -> None:
    parents, passages, shut, rooms = world
    source = build_source(parents, passages)
    without = build_source(parents, [passage for passage in passages if passage not in shut])
    a, b = data.draw(st.sampled_from(rooms)), data.draw(st.sampled_from(rooms))
    assert steps_of(find_route(source, a, b, shut)) == steps_of(find_route(without, a, b))


@settings(deadline=None, max_examples=300)
@given(hierarchies(), st.data())
def test_a_route_exists_where_a_chain_of_open_passages_does(world: Hierarchy, data: st.DataObject) -> None:
    parents, passages, shut, rooms = world
    source = build_source(parents, passages)
    a, b = data.draw(st.sampled_from(rooms)), data.draw(st.sampled_from(rooms))
    usable = {passage.name: set(passage.between) for passage in passages
              if passage not in shut and not (isinstance(passage, Link) and passage.kind == "stairs")}
    flat = nx.Graph(tuple(between) for between in usable.values())
    flat.add_nodes_from(rooms)
    way = refine_route(source, a, b, shut)
    assert (way is not None) == nx.has_path(flat, a, b)
    if way is not None:
        assert way[0] == a and way[-1] == b
        for (here, there), passage in zip(pairwise(way[::2]), way[1::2], strict=True):
            assert usable[passage] == {here, there}


class WatchedFrame:
    """A frame that notes what was asked of it."""

    def __init__(self, frame: LocaleFrame, asked: set[tuple[str, str]]) -> None:
        self._frame, self._asked = frame, asked

    def __getattr__(self, name: str) -> Any:
        self._asked.add((name, self._frame.name))
        return getattr(self._frame, name)


class Watched(Mapping[str, Any]):
    """Frames that note of which what was asked."""

    def __init__(self, frames: Frames) -> None:
        self._frames = frames
        self.asked: set[tuple[str, str]] = set()

    def __getitem__(self, name: str) -> Any:
        return WatchedFrame(self._frames[name], self.asked)

    def __iter__(self) -> Iterator[str]:
        return iter(self._frames)

    def __len__(self) -> int:
        return len(self._frames)


@settings(deadline=None, max_examples=200)
@given(hierarchies(), st.data())
def test_only_containers_above_shut_passages_and_what_they_join_are_read(world: Hierarchy, data: st.DataObject) -> None:
    parents, passages, shut, rooms = world
    source = build_source(parents, passages)
    a, b = data.draw(st.sampled_from(rooms)), data.draw(st.sampled_from(rooms))
    watched = Watched(source)
    route = find_route(watched, a, b, shut)

    def above(room: str) -> list[str]:
        chain = [room]
        while (parent := parents[chain[-1]]) is not None:
            chain.append(parent)
        return chain

    changed = {name for passage in shut for name in set(above(passage.between[0])[1:]) & set(above(passage.between[1]))}
    ends = {room for name in changed for edge in source[name].edges for room in edge.rooms}
    read = {name for room in {a, b, *ends, *(end for p in shut for end in p.between)} for name in above(room)}
    searched = changed | ({route.container} if route is not None else set())
    stops = {step.origin for step in route.steps} if route is not None else set()
    for question, name in watched.asked:
        allowed = {"locale": read, "components": read, "edges": searched, "doorways": stops, "links": stops}
        assert name in allowed[question], (question, name)


def test_a_shut_door_parts_a_house_and_the_street_joins_it_again() -> None:
    """Two flats and an inner door: with it shut, the way leads round by the street, one level up."""
    parents = {"world": None, "house": "world", "kitchen": "house", "bedroom": "house", "street": "world"}
    doors = [Doorway(name, between, THRESHOLDS, 2.0) for name, between in (
        ("inner", ("kitchen", "bedroom")), ("front", ("street", "kitchen")), ("back", ("street", "bedroom")))]
    source = build_source(parents, doors)
    assert steps_of(find_route(source, "kitchen", "bedroom")) == ("house", [("inner", "kitchen", "bedroom")])
    assert steps_of(find_route(source, "kitchen", "bedroom", doors[:1])) == (
        "world", [("front", "kitchen", "street"), ("back", "street", "bedroom")])
    assert find_route(source, "kitchen", "bedroom", doors[:2]) is None
