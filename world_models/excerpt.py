"""Part of a world: to draw, or to build what a robot stands in."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypeVar

from world_models.building.memory_frames import MemoryFrames
from world_models.building.world import World

T = TypeVar("T")


def within(world: World, name: str) -> World:
    """The rooms of a locale with what contains them; all of the world, itself, where that is the root."""
    if name == world.root:
        return world
    rooms = tuple(world.rooms_in(name))
    names = [*world.path_of(name)[:-1], *_below(world, name)]
    inside = set(names)
    packets = {(p.locale, p.neighbour): p for room in rooms for p in world.frames.packets(room) if p.locale in inside}
    doorways = {d.name: d for room in rooms for d in world.doorways_of(room) if set(d.between) <= inside}
    links = {k.name: k for room in rooms for k in world.links_of(room) if set(k.between) <= inside}
    return World(MemoryFrames(
        world.name, {n: world.locale(n) for n in names}, tuple(doorways.values()),
        _in_order(pair for p in packets.values() for pair in p.faces),
        _in_order(pair for p in packets.values() for pair in p.landmarks),
        tuple(thing for room in rooms for thing in world.things_of(room)), tuple(links.values()),
    ))


def _below(world: World, name: str) -> Iterator[str]:
    yield name
    for child in world.children_of(name):
        yield from _below(world, child)


def _in_order(numbered: Iterable[tuple[int, T]]) -> tuple[T, ...]:
    return tuple(item for _, item in sorted(numbered, key=lambda pair: pair[0]))
