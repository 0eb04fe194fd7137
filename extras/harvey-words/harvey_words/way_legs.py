"""The shortest way on a map as people walk it: doors, and straight legs along the middles of halls."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count

from harvey_words.word_map import Area, NamedFeature, Point, WordMap, is_along, moved, offsets

Spot = tuple[str, Point]
"""A locale, and a place in it [m, world]."""
ROOM_COST_M = 40.0
"""A way through a room counts as so much longer: people are sent along halls."""
LEAST_LEG_M = 0.95
"""A shorter step to the side is no leg of its own."""


@dataclass(frozen=True)
class WayLeg:
    """A straight walk.

    Attributes:
        heading: of the walk [rad]; begin: where it begins; end: where it ends.
    """

    heading: float
    begin: Spot
    end: Spot


def find_way(plan: WordMap, begin: Spot, goal: Spot) -> list[NamedFeature] | None:
    """The doors and openings of the shortest way, one after the other; None where there is no way."""
    order = count()
    todo: list[tuple[float, int, Spot, tuple[NamedFeature, ...]]] = [(0.0, next(order), begin, ())]
    seen: set[Spot] = set()
    while todo:
        cost, _, spot, way = heapq.heappop(todo)
        if spot == goal:
            return list(way)
        if spot in seen:
            continue
        seen.add(spot)
        locale, at = spot
        if locale == goal[0]:
            heapq.heappush(todo, (cost + math.dist(at, goal[1]), next(order), goal, way))
        extra = 0.0 if plan.areas[locale].is_hall or not way else ROOM_COST_M
        for feature in plan.areas[locale].features:
            if feature.is_open and feature.beyond is not None and feature.outward is not None:
                heapq.heappush(todo, (cost + extra + math.dist(at, feature.at), next(order),
                                      (feature.beyond, feature.at), (*way, feature)))
    return None


def find_legs(plan: WordMap, begin: Spot, way: Sequence[NamedFeature], end: Point) -> list[WayLeg]:
    """The legs from a place through openings to another place; steps to the side are no legs."""
    spots = [begin]
    for feature in way:
        spots += _within(plan.areas[feature.locale], spots[-1][1], feature.at)
        spots.append((feature.beyond or feature.locale, feature.at))
    last = plan.areas[spots[-1][0]]
    spots += [*_within(last, spots[-1][1], end), (last.name, end)]
    legs: list[WayLeg] = []
    corner = spots[0]
    for spot in spots[1:]:
        long = math.dist(corner[1], spot[1])
        heading = math.atan2(spot[1][1] - corner[1][1], spot[1][0] - corner[1][0])
        if legs and is_along(legs[-1].heading, heading):
            legs[-1] = WayLeg(legs[-1].heading, legs[-1].begin, spot)
        elif long > LEAST_LEG_M:
            legs.append(WayLeg(heading, corner, spot))
        else:
            continue
        corner = spot
    return legs


def _within(area: Area, here: Point, there: Point) -> Iterator[Spot]:
    """The places between in a hall: its middle line, or its middle if it is a crossing."""
    if area.is_tile:
        yield area.name, area.middle
    elif area.is_hall:
        for point in (here, there):
            ahead, _ = offsets(area.middle, area.axis, point)
            yield area.name, moved(area.middle, area.axis, max(-area.half[0], min(area.half[0], ahead)))
