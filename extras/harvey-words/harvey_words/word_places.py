"""Hypotheses of place and heading on a map, and the ways that go on from there."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from harvey_words.matching import WordMatcher
from harvey_words.told_acts import ThingWords
from harvey_words.word_map import (
    Area,
    NamedFeature,
    NamedSight,
    Point,
    WordMap,
    is_along,
    is_level,
    moved,
    offsets,
    turned,
)

FEW = 12
"""Hypotheses that are followed on within an act."""
UNSAID_TURN, UNSAID_BACK, UNSAID_WALK, UNSAID_EXIT = -2.0, -2.6, -1.5, -0.3
"""What is done without being told: turning to the side, turning back, walking on, leaving a room."""
WRONG_RANK, WRONG_SIDE = -3.5, -4.0
"""Of what has another number, or lies on the other side."""
NEAR_M, HERE_M = 2.6, 1.3
"""What is at a place; what is the same place."""
LEAST_WAY_M = 1.0
"""A hall that goes on for less than this does not go on."""
TURNS = {"left": math.pi / 2, "right": -math.pi / 2, "back": math.pi, "behind": math.pi, "ahead": 0.0}
POINTS = {"east": 0.0, "north": math.pi / 2, "west": math.pi, "south": -math.pi / 2}


@dataclass(frozen=True)
class State:
    """A hypothesis.

    Attributes:
        locale, at, heading: where one stands and which way one faces.
        odds: log odds so far.
        moving: whether one walks on, and the next sentence says until where.
        door: the door that the text says it is.
        misfits: numbers of the acts that fitted badly.
        way: the places on the way (locale, x, y), each with the name of what the words named there, or "".
        begun: where the walk began about whose end nothing is said; came: the door by which one came out here.
    """

    locale: str
    at: Point
    heading: float
    odds: float = 0.0
    moving: bool = False
    door: str = ""
    misfits: tuple[int, ...] = ()
    way: tuple[tuple[str, float, float, str], ...] = ()
    begun: Point | None = None
    came: str = ""

    @property
    def key(self) -> tuple[object, ...]:
        """What makes two hypotheses one."""
        return (self.locale, round(self.at[0], 1), round(self.at[1], 1), round(self.heading, 2), self.moving, self.door)

    def by(self, locale: str, at: Point, mark: str = "") -> tuple[tuple[str, float, float, str], ...]:
        """Its way with one more place."""
        return (*self.way, (locale, round(at[0], 2), round(at[1], 2), mark))


def best_of(states: Iterable[State], count: int = FEW) -> list[State]:
    """The best of some hypotheses, in an order that does not depend on how they came."""
    return sorted(states, key=lambda one: (-one.odds, one.locale, one.at, one.heading))[:count]


class WordPlaces:
    """Where a hypothesis stands, and where it can go on to."""

    def __init__(self, plan: WordMap) -> None:
        self.plan = plan
        self.match = WordMatcher(plan)

    def area(self, state: State) -> Area:
        """Where a hypothesis stands."""
        return self.plan.areas[state.locale]

    def sights(self, state: State) -> tuple[NamedSight, ...]:
        """What it sees along its heading."""
        return self.plan.look(state.locale, state.at, state.heading)

    def ways(self, state: State) -> list[float]:
        """The directions in which one can go on from a place in a hall."""
        area = self.area(state)
        found = []
        for turn in (0.0, math.pi / 2, math.pi, -math.pi / 2):
            heading = turned(area.axis, turn)
            ahead, _ = offsets(state.at, heading, area.middle)
            goes_on = not area.is_tile and is_level(area.axis, heading) and ahead + area.half[0] > LEAST_WAY_M
            if goes_on or any(self._leads(state, feature, heading) for feature in area.features):
                found.append(heading)
        return found

    def _leads(self, state: State, feature: NamedFeature, heading: float) -> bool:
        """Whether an opening to another hall is here, in a direction."""
        if feature.sort != "opening" or feature.outward is None or not is_along(feature.outward, heading):
            return False
        return abs(offsets(state.at, heading, feature.at)[1]) < HERE_M

    def hall_ahead(self, state: State) -> Area:
        """The hall that is walked along when one goes on: the next one from a crossing."""
        area = self.area(state)
        for feature in area.features:
            if (feature.sort == "opening" and feature.outward is not None and is_along(feature.outward, state.heading)
                    and abs(offsets(state.at, state.heading, feature.at)[1]) < HERE_M and (
                        area.is_tile or offsets(state.at, state.heading, feature.at)[0] < HERE_M + area.half[1])):
                return self.plan.areas[feature.beyond or state.locale]
        return area

    def stand(self, state: State, sight: NamedSight, beyond_m: float = 0.0) -> State:
        """The same hypothesis at what it saw, in the middle of the hall there."""
        area = self.plan.areas[sight.locale]
        at = moved(state.at, state.heading, max(sight.ahead_m, 0.0) + beyond_m)
        if area.is_tile and area.half[0] < 2.5 and beyond_m == 0.0:
            at = area.middle
        elif area.is_hall and is_level(area.axis, state.heading):
            left = offsets(at, state.heading, area.middle)[1]
            at = moved(at, state.heading, 0.0, left)
        if sight.feature is None and sight.side == "ahead" and not area.is_tile:
            at = moved(at, state.heading, -0.8)
        name = area.name
        if name == state.locale and math.dist(at, state.at) < 0.01:
            return state
        mark = sight.feature.name if sight.feature is not None else ""
        return replace(state, locale=name, at=at, way=state.by(name, at, mark))

    def nodes(self, state: State, through: bool = False) -> list[NamedSight]:
        """The crossings, corners and the end ahead, nearest first; where one stands is none.

        ``through``: also what is as short as a crossing and only leads on.
        """
        found: list[NamedSight] = []
        for sight in self.sights(state):
            area = self.plan.areas[sight.locale]
            feature = sight.feature
            is_side = feature is not None and feature.sort == "opening" and sight.side in ("left", "right")
            is_tile = feature is None and sight.side == "in" and (
                bool(area.meanings & {"crossing", "corner"}) or (through and area.is_tile))
            is_end = feature is None and sight.side == "ahead"
            is_hall_across = feature is None and sight.side == "in" and area.is_hall and not area.is_tile and (
                not is_level(area.axis, state.heading))
            if not (is_side or is_tile or is_end or is_hall_across) or sight.ahead_m < HERE_M:
                continue
            if found and (sight.ahead_m - found[-1].ahead_m < HERE_M):
                continue
            found.append(sight)
        return found

    def halls_at(self, state: State, side: str) -> list[Area]:
        """The halls that leave a place to the sides, or to one of them."""
        turns = [TURNS[side]] if side in ("left", "right") else [TURNS["left"], TURNS["right"]]
        return [self.hall_ahead(replace(state, heading=way)) for way in self.ways(state)
                if any(is_along(way, state.heading + turn) for turn in turns)]

    def side_of(self, state: State, side: str) -> str:
        """Left or right; of a point of the compass, or of the side of what was named last, which of them it is."""
        if side in ("same", "other"):
            last = next((mark for *_, mark in reversed(state.way) if mark), "")
            own = next((one.side for one in self.sights(state) if one.feature and one.feature.name == last), "")
            return own if side == "same" else {"left": "right", "right": "left"}.get(own, "")
        if side not in POINTS:
            return side
        turn = math.remainder(POINTS[side] - state.heading, math.tau)
        return "left" if 0.8 < turn < 2.3 else "right" if -2.3 < turn < -0.8 else "ahead"

    def leave(self, state: State, by: ThingWords | None) -> Iterator[State]:
        """Out of a room by each of its open doors."""
        for feature in self.area(state).features:
            if feature.is_open and feature.beyond is not None:
                fit = self.match.fit(by, feature) if by else 0.0
                area = self.plan.areas[feature.beyond]
                at, heading = feature.at, state.heading if feature.outward is None else feature.outward
                if area.is_hall:
                    turn = math.remainder(area.axis - heading, math.tau)
                    ahead, left = offsets(at, heading, area.middle)
                    at = moved(at, heading, ahead if 0.8 < abs(turn) < 2.3 else 0.5,
                               0.0 if 0.8 < abs(turn) < 2.3 else left)
                else:
                    at = moved(at, heading, 0.5)
                yield replace(state, locale=area.name, at=at, heading=heading, odds=state.odds + fit,
                              moving=False, door="", begun=at, came=feature.name,
                              way=state.by(area.name, at, feature.name))

    def facings(self, state: State, along: ThingWords | None) -> Iterator[State]:
        """The hypothesis out in the hall, facing the ways that it may go on, those that are not said at a price."""
        if not self.area(state).is_hall:
            for out in self.leave(state, None):
                yield from self.facings(replace(out, odds=out.odds + UNSAID_EXIT), along)
            return
        ways = self.ways(state)
        fits_now = any(is_along(way, state.heading) for way in ways)
        for way in ways or [state.heading]:
            new = replace(state, heading=way)
            turn = math.remainder(way - state.heading, math.tau)
            cost = 0.0 if abs(turn) < 0.8 else UNSAID_BACK if abs(turn) > 2.3 else UNSAID_TURN
            if not fits_now and abs(turn) < 2.3:
                cost = -0.4
            if state.moving and abs(turn) > 2.3:
                cost *= 2.0  # nobody turns back in the middle of a walk and says nothing of it
            if along is not None and along.names:
                cost = 0.5 * cost + self.match.fit_area(along, self.hall_ahead(new))
            if not is_along(way, state.heading):
                new = replace(new, moving=False, begun=None)
            yield replace(new, odds=state.odds + cost)
