"""Directions for a person: what to do at each place where one decides, by what is to be seen there.

There is more than one way to say each step. What is written is read again as a stranger would read it, and of what can
be said that is taken by which the right end is the surest.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count

from harvey_words.following.reading import SURE, Reading, RouteError, find_start, read_route
from harvey_words.following.word_follower import WordFollower
from harvey_words.following.word_map import (
    Area,
    NamedFeature,
    NamedSight,
    Point,
    WordMap,
    is_along,
    moved,
    offsets,
    turned,
)
from harvey_words.following.word_places import HERE_M, NEAR_M, OPPOSITE_M, State
from harvey_words.reading.lexicon import lexicon_data

ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth")
NUMBERS = ("one", "two", "three", "four", "five", "six", "seven", "eight", "nine")
SIDES = {"left": math.pi / 2, "right": -math.pi / 2, "behind": math.pi}
OUT_M = 2.5
"""So far out of a door one only comes into the hall."""
ROUNDS = 2
"""How often all steps are gone through for a better wording."""
Spot = tuple[str, Point]
"""A locale, and a place in it [m, world]."""
ROOM_COST_M = 40.0
"""A way through a room counts as so much longer: people are sent along halls."""
LEAST_LEG_M = 0.95
"""A shorter step to the side is no leg of its own."""


@dataclass(frozen=True, eq=False)
class Directions:
    """What was written.

    Attributes:
        text: for a person.
        reading: of it, from the same start, by the reader of routes.
        is_clear: whether that reading is sure, and of the right end.
    """

    text: str
    reading: Reading
    is_clear: bool


def write_directions(plan: WordMap, start: str, goal: str, heading_deg: float | None = None) -> Directions:
    """Directions from a place to another, each a locale, a door, a thing or x,y.

    Raises:
        RouteError: there is no such place, or no way.
    """
    begin, end = find_start(plan, start), find_start(plan, goal)
    way = find_way(plan, begin, end)
    if way is None or begin == end:
        raise RouteError(f"expected a way from {start} to another place, got none to {goal}")
    heading = None if heading_deg is None else math.radians(heading_deg)
    steps = list(_Teller(plan).tell(begin, way, end, heading))
    chosen = [0] * len(steps)

    def read() -> Directions:
        text = " ".join(said for step, number in zip(steps, chosen, strict=True) if (said := step[number]))
        reading = read_route(text, plan, start, heading_deg)
        return Directions(text, reading, _odds(reading, goal, end) >= SURE)

    best = read()
    for _ in range(ROUNDS):
        for place, step in enumerate(steps):
            kept = chosen[place]
            for number in range(len(step)):
                if best.is_clear and _odds(best.reading, goal, end) > 0.9:
                    return best
                chosen[place] = number
                tried = read()
                if _odds(tried.reading, goal, end) > _odds(best.reading, goal, end) + 1e-6:
                    best, kept = tried, number
            chosen[place] = kept
    return best


def _odds(reading: Reading, goal: str, end: Spot) -> float:
    """Of the right end in a reading."""
    place = f"{end[1][0]},{end[1][1]}"
    return sum(one.odds for one in reading.ends if one.is_at(goal) or one.is_at(place))


class _Teller:
    """Says the steps of a way."""

    def __init__(self, plan: WordMap) -> None:
        self.plan = plan
        self.follower = WordFollower(plan)
        data = lexicon_data()
        self._phrases = {meaning: said[0] for sort in ("MOD", "THING") for meaning, said in data[sort].items()}
        self._phrases |= {colour: colour for colour in data["COLOURS"]}

    def tell(self, begin: Spot, way: Sequence[NamedFeature], end: Spot, heading: float | None) -> Iterator[list[str]]:
        """The wordings of each step, the shortest first."""
        state = State(*begin, heading or 0.0)
        is_known = heading is not None
        while way or state.locale == end[0]:
            area = self.plan.areas[state.locale]
            if way and not area.is_hall:
                yield self._tell_exit(way[0])
                state = self._beyond(way[0])
                way, is_known = way[1:], True
                continue
            cut = next((number for number, one in enumerate(way) if one.sort == "door"), len(way))
            door = way[cut] if cut < len(way) else None
            legs = find_legs(self.plan, (state.locale, state.at), way[:cut], door.at if door else end[1])
            if door is not None and legs and door.outward is not None and is_along(legs[-1].heading, door.outward) and (
                    len(legs) > 1 or math.dist(state.at, door.at) < OUT_M):
                legs.pop()  # from the middle of the hall to its side
            if not legs and door is not None and not is_known:
                legs = [WayLeg(self.follower.ways(state)[0], (state.locale, state.at), (state.locale, state.at))]
            for number, leg in enumerate(legs):
                yield self._tell_turn(state, leg, is_known)
                came = state.came if math.dist(state.at, leg.begin[1]) < OUT_M else ""
                state, is_known = State(*leg.begin, leg.heading, came=came), True
                onward = legs[number + 1] if number + 1 < len(legs) else None
                if onward is not None or door is None:
                    yield self._tell_walk(state, leg, onward)
            if door is None:
                return
            yield self._tell_door(state, door)
            state, way = self._beyond(door), way[cut + 1:]
            if not way and not self.plan.areas[end[0]].is_hall:
                return

    def _beyond(self, door: NamedFeature) -> State:
        """Come out, or in, at a door."""
        assert door.outward is not None and door.beyond is not None
        return State(door.beyond, moved(door.at, door.outward, 0.5), door.outward, came=door.name)

    def _tell_exit(self, door: NamedFeature) -> list[str]:
        room = self.plan.areas[door.locale]
        others = [one for one in room.features if one.is_open and one is not door]
        if not others:
            return ["Leave the room."]
        return [*(f"Leave the room by the {word} door." for word in self._words(door.own, [one.own for one in others])),
                *(f"Leave the room by the door to the {word} hall."
                  for word in self._words(door.meanings, [one.meanings for one in others])), "Leave the room."]

    def _tell_turn(self, state: State, leg: WayLeg, is_known: bool) -> list[str]:
        there = State(*leg.begin, leg.heading)
        ways = self.follower.ways(there)
        own = self.follower.hall_ahead(there)
        others = [self.follower.hall_ahead(State(*leg.begin, way)) for way in ways if not is_along(way, leg.heading)]
        words = self._words(own.meanings, [other.meanings for other in others])
        side = _side_of_turn(state.heading, leg.heading)
        if is_known:
            if not side:
                return [""]
            turn = "Turn around." if side == "back" else f"Turn {side}."
            return [turn, *(f"{turn[:-1]} into the {word} hall." for word in words if side != "back")]
        seen = [name for sight in self.follower.sights(there) if sight.ahead_m > HERE_M and abs(sight.left_m) < NEAR_M
                and sight.feature is not None and (name := self._name(sight.feature))]
        wall = [] if any(is_along(way, leg.heading + math.pi) for way in ways) else ["Put your back to the wall."]
        alone = [""] if len(ways) == 1 else []
        return [*alone, *(f"Face the {word} hall." for word in words), *wall,
                *(f"Face the {name}." for name in dict.fromkeys(seen)), *self._tell_sides(there), ""]

    def _tell_sides(self, state: State) -> Iterator[str]:
        """What lies to the sides and behind, where it is nowhere else."""
        halls = {way: self.follower.hall_ahead(replace(state, heading=way)).meanings
                 for way in self.follower.ways(state)}
        for side, turn in SIDES.items():
            there, place = state.heading + turn, "behind you" if side == "behind" else f"on your {side}"
            for way in (way for way in halls if is_along(way, there)):
                others = [meanings for other, meanings in halls.items() if other != way]
                yield from (f"Turn so that the {word} hall is {place}." for word in self._words(halls[way], others))
            things = self._things(replace(state, heading=turned(there, 0.0)))
            yield from (f"Turn so that the {name} is {place}." for _, name in things)

    def _tell_walk(self, state: State, leg: WayLeg, onward: WayLeg | None) -> list[str]:
        """How far: to a thing, to a hall that leaves, so many blocks, to the end."""
        length = offsets(state.at, state.heading, leg.end[1])[0]
        said: list[str] = []
        nodes = self.follower.nodes(state, through=True)
        place = next((number for number, node in enumerate(nodes) if abs(node.ahead_m - length) < NEAR_M / 2), None)
        if place is not None and place == len(nodes) - 1:
            said.append("Go to the end of the hall.")
        said += [f"Go to the {name}." for name in self._marks(state, length)]
        if place is not None and place < len(NUMBERS):
            said.append(f"Go forward {NUMBERS[place]} block{'s' * (place > 0)}.")
        if onward is not None:
            taken = self.follower.hall_ahead(State(*onward.begin, onward.heading))
            said += [f"Go on to the {word} hall." for word in self._words(
                taken.meanings, [self.follower.hall_ahead(state).meanings])]
        metres = max(1, round(length))
        into_hall = [""] if state.came and onward is not None and length < OUT_M else []
        return [*into_hall, *said, *([""] if onward is not None and said else []),
                f"Go forward {metres} metre{'s' * (metres > 1)}."]

    def _tell_door(self, state: State, door: NamedFeature) -> list[str]:
        """Which door: by its rank on its side, by a mark before it, by what is written on it."""
        doors = [sight for sight in self.follower.sights(state) if sight.feature is not None
                 and sight.feature.sort == "door" and sight.side != "behind" and sight.feature.name != state.came
                 and sight.ahead_m > (OPPOSITE_M if state.came else -0.2)]
        own = next((sight for sight in doors if sight.feature is door), None)
        if own is None:
            return [f"It is the {word} door." for word in self._words(door.meanings, [])] or ["It is the door."]
        side = "" if own.side not in ("left", "right") else f" on the {own.side}"
        row = [sight for sight in doors if sight.side == own.side]
        rank = row.index(own)
        if not side:
            across = ["It is the door across the hall."] if state.came else []
            said = [*across, "Go through the door at the end.", "Go through the door ahead."]
            if state.came and abs(own.left_m) > OPPOSITE_M:
                turn = "left" if own.left_m > 0 else "right"
                beside = replace(state, heading=turned(state.heading, SIDES[turn]))
                said += [f"Turn {turn}. {one}" for one in self._tell_door(beside, door)]
        else:
            said = [f"It is the {ORDINALS[rank]} door{side}."] if rank < len(ORDINALS) else []
            said += [f"It is the last door{side}."] if own is row[-1] else []
            said += [f"Walk past the {name}. It is the next door{side}."
                     for name in self._marks_before(state, row, rank)]
        others = [sight.feature.meanings for sight in doors if sight.feature is not None and sight is not own]
        return said + [f"It is the {word} door{side}." for word in self._words(door.meanings, others)]

    # -- what can be named -------------------------------------------------------------------------------------------

    def _words(self, meanings: Iterable[str], others: Sequence[Iterable[str]]) -> list[str]:
        """Words for something that fit none of the others; properties and names."""
        taken = {meaning for other in others for meaning in other}
        return [self._phrases.get(meaning, meaning) for meaning in sorted(meanings)
                if meaning not in taken and (meaning in self._phrases or meaning in self.plan.lexicon.names)]

    def _name(self, thing: NamedFeature) -> str:
        """What a thing is called, where there is a word for it."""
        kind = self.plan.lexicon.meaning(thing.own_kind)
        return self._phrases.get(kind, "") if thing.sort == "thing" else ""

    def _things(self, state: State) -> list[tuple[NamedSight, str]]:
        """The things ahead that are the first of their name."""
        first: dict[str, NamedSight] = {}
        for sight in self.follower.sights(state):
            is_ahead = sight.ahead_m > 0.3 and abs(sight.left_m) < NEAR_M and sight.side != "behind"
            name = self._name(sight.feature) if sight.feature is not None and is_ahead else ""
            if name:
                first.setdefault(name, sight)
        return [(sight, name) for name, sight in first.items()]

    def _marks(self, state: State, length: float) -> list[str]:
        return [name for sight, name in self._things(state) if abs(sight.ahead_m - length) < HERE_M]

    def _marks_before(self, state: State, row: Sequence[NamedSight], rank: int) -> list[str]:
        """Things between a door and the one before it."""
        low = row[rank - 1].ahead_m if rank else 0.3
        return [name for sight, name in self._things(state) if low + 0.4 < sight.ahead_m < row[rank].ahead_m - 0.4]


def _side_of_turn(before: float, after: float) -> str:
    turn = turned(after, -before)
    return "" if abs(turn) < 0.8 else "back" if abs(turn) > 2.3 else "left" if turn > 0 else "right"


# -- the way -----------------------------------------------------------------------------------------------------------

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
