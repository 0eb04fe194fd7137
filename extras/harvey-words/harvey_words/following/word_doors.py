"""The goal: at which door, crossing or thing a description may be meant."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from harvey_words.following.word_map import NamedSight, is_along, moved, offsets, turned
from harvey_words.following.word_places import (
    AGAIN,
    MISFIT,
    OPPOSITE_M,
    TURNS,
    UNKNOWN_HEAD,
    WORST,
    WRONG_RANK,
    WRONG_SIDE,
    State,
    WordPlaces,
)
from harvey_words.reading.told_acts import ThingWords

NO_DEAD_END = -3.0
"""What is called a dead end, and has another way out."""
UNTOLD = -4.0
"""A goal out of sight to which no way is told."""
OPEN_ONLY = -1.8
"""That only open doors were counted."""
BEHIND = 1.5
"""Off for a thing that lies behind when the walk begins, where a door after it is meant."""
BEFORE_M = 4.0
"""A door before a thing that was reached lies no further back."""


class WordDoors(WordPlaces):
    """Finds the doors and places that a text may mean."""

    def find(self, state: State, what: ThingWords) -> Iterator[State]:
        """At each door, or thing, that may be meant."""
        if what.heads & {"crossing", "corner", "end"} and not what.heads & {"door"}:
            yield from self._anywhere(state, what)
            return
        if state.is_at_door and what.side in ("left", "right") and not any(
                is_along(way, state.heading) for way in self.ways(state)):
            # come out of a door, what lies to the left lies in that direction, on either side of the hall
            there = replace(state, heading=turned(state.heading, TURNS[what.side]), odds=state.odds - 0.5)
            yield from self._find_from([there], replace(what, side=""))
        yield from self._find_from(self.facings(state, None), what)
        yield from self._anywhere(state, what)
        yield replace(state, odds=state.odds + WORST)

    def _anywhere(self, state: State, what: ThingWords) -> Iterator[State]:
        """What is named and out of sight, wherever it is: a goal without a way."""
        if not what.names:
            return
        for area in self.plan.areas.values():
            here = replace(state, locale=area.name, at=area.middle, odds=state.odds + UNTOLD, moving=False, door="")
            here = replace(here, way=state.by(area.name, area.middle))
            if what.heads & {"crossing", "corner", "end"}:
                if area.is_tile and (area.meanings & {"crossing", "corner"} or len(self.ways(here)) != 2):
                    yield from self._named_crossing(here, what)
                continue
            for feature in area.features if area.is_hall else ():
                fit = self.match.fit(what, feature)
                if fit > UNKNOWN_HEAD and feature.sort == "door":
                    ahead = feature.outward if feature.outward is not None else 0.0
                    before = replace(here, at=feature.at, heading=ahead)
                    yield self._at_door(before, NamedSight(feature, 0.0, 0.0, "ahead", area.name),
                                        here.odds + fit)
                elif fit > UNKNOWN_HEAD and feature.sort == "thing" and area.is_tile:
                    yield replace(here, odds=here.odds + fit)

    def _named_crossing(self, state: State, what: ThingWords) -> Iterator[State]:
        """A crossing or end of halls, each word of which is said of one that leaves here or of what stands here."""
        ways = self.ways(state)
        halls = [self.hall_ahead(replace(state, heading=way)) for way in ways]
        fit = self.fit_place(state, what, halls) + NO_DEAD_END * ("dead-end" in what.heads and len(ways) > 1)
        if fit > WORST:
            yield replace(state, odds=state.odds + fit)

    def _find_from(self, facings: Iterable[State], what: ThingWords) -> Iterator[State]:
        """The doors that may be meant from where one stands, along the ways that one may face."""
        least = -BEFORE_M if any(relation == "before" for relation, _ in what.relations) else -0.2
        for facing in facings:
            doors = [sight for sight in self.sights(facing) if sight.feature is not None
                     and sight.feature.sort == "door" and sight.side != "behind"
                     and sight.ahead_m > (OPPOSITE_M if facing.is_at_door else least)
                     and sight.feature.name != facing.came]
            for sight in doors:
                cost = self._weigh_door(facing, sight, doors, what)
                if cost > WORST:
                    yield self._at_door(facing, sight, facing.odds + cost)

    def _weigh_door(self, state: State, sight: NamedSight, doors: Sequence[NamedSight], what: ThingWords) -> float:
        """Words, side, rank and relations of a door, together."""
        assert sight.feature is not None
        cost = self.match.fit(what, sight.feature)
        side = self.side_of(state, what.side)
        sided = side in ("left", "right") or what.side == "ahead"
        if sided and sight.side != (side or "ahead"):
            cost += WRONG_SIDE
        row = [one for one in doors if not sided or one.side == (side or "ahead")]
        if sight in row and (what.count or not what.names):
            rank = row.index(sight) + 1
            opened = [one for one in row if one.feature is not None and one.feature.is_open]
            open_rank = opened.index(sight) + 1 if sight in opened else 0
            only_open = any(word.meaning == "open" for word in what.names)
            own = self._weigh_rank(what, rank, len(row), open_rank, len(opened), only_open)
            called = [one for one in row if what.names and one.feature and self.match.fit(what, one.feature) > -1.0]
            if len(called) > 1 and sight in called:  # "the second closet"
                rank = called.index(sight) + 1
                own = max(own, self._weigh_rank(what, rank, len(called), rank, len(called), False))
            cost += own
        between = [other for relation, other in what.relations if relation == "between"]
        if len(between) == 2:
            cost += self._weigh_between(state, sight, doors, between[0], between[1])
        for relation, other in what.relations if len(between) != 2 else ():
            cost += self._weigh_relation(state, sight, doors, relation, other)
        return cost

    def _weigh_rank(self, what: ThingWords, rank: int, count: int, open_rank: int, open_count: int,
                    only_open: bool) -> float:
        related = bool(what.relations)
        if what.count == "last":
            return 0.0 if rank == count else OPEN_ONLY if open_rank == open_count and open_rank else WRONG_RANK
        number = what.number
        if number and not (related and number == 1):
            exact = (open_rank if only_open else rank) == number
            return 0.0 if exact else OPEN_ONLY if open_rank == number else WRONG_RANK
        return 0.0 if what.names or related else AGAIN * min(rank - 1, 3)

    def _weigh_between(self, state: State, sight: NamedSight, doors: Sequence[NamedSight], one: ThingWords,
                       other: ThingWords) -> float:
        """How well a door lies between two things: on their side, with no other door there."""
        best = WRONG_SIDE
        marks = [mark for mark in self.sights(state) if mark.feature is not None and mark.feature.sort != "opening"]
        fits = [[(mark, fit) for mark in marks if mark.feature and mark is not sight and (
            fit := self.match.fit(what, mark.feature)) > MISFIT] for what in (one, other)]
        for first, fit in fits[0]:
            for second, more in fits[1]:
                low, high = sorted((first.ahead_m, second.ahead_m))
                if low < sight.ahead_m < high:
                    rivals = sum(low < door.ahead_m < high and door.side == sight.side for door in doors) - 1
                    sides = (first.side != sight.side) + (second.side != sight.side)
                    best = max(best, fit + more + AGAIN * rivals + AGAIN * sides)
        return best

    def _weigh_relation(self, state: State, sight: NamedSight, doors: Sequence[NamedSight], relation: str,
                        other: ThingWords) -> float:
        """How well a door lies to other things as it is said."""
        if relation == "across" and not other.names and other.heads <= {"hall"}:
            own = next((one.side for one in self.sights(state) if one.feature and one.feature.name == state.came), "")
            return WRONG_SIDE if sight.side == own else max(-2.0 * abs(sight.ahead_m), WRONG_SIDE)
        best = -2.0 if not any(word.meaning in self.plan.vocabulary for word in other.names) else -3.5
        rank = 0
        for mark in self.sights(state):
            if mark.feature is None or mark.feature.sort == "opening" or mark is sight:
                continue
            fit = self.match.fit(other, mark.feature)
            gap = sight.ahead_m - mark.ahead_m
            walked_m = offsets(state.begun or state.at, state.heading, mark.feature.at)[0]
            least_m = OPPOSITE_M if state.came and state.begun is not None else -OPPOSITE_M
            if walked_m > max(least_m, 0.0) and fit > -1.0:
                fit += AGAIN * rank  # the first of several columns is meant
                rank += 1
            between = [one for one in doors if one is not sight and one is not mark and one.side == sight.side
                       and min(sight.ahead_m, mark.ahead_m) - 0.05 < one.ahead_m < max(sight.ahead_m, mark.ahead_m)]
            if relation == "past":
                fit += AGAIN * 1.5 * len(between) - BEHIND * (walked_m < least_m) if gap > -0.3 else -3.0
            elif relation == "before":
                fit += AGAIN * 1.5 * len(between) if gap < 0.3 else -3.0
            elif relation == "across":
                fit += -abs(gap) / 2.0 - 2.0 * (mark.side == sight.side)
            else:
                fit += -max(abs(gap) - 1.5, 0.0) / 2.0
            best = max(best, fit)
        return best

    def _at_door(self, state: State, sight: NamedSight, odds: float) -> State:
        """At a door: in the room behind it where it is open, else before it."""
        feature = sight.feature
        assert feature is not None
        front = self.stand(state, sight)
        heading = state.heading if feature.outward is None else feature.outward
        locale = feature.beyond if feature.is_open and feature.beyond else sight.locale
        at = moved(feature.at, heading, 0.5) if feature.is_open else front.at
        return replace(front, locale=locale, at=at, heading=heading, odds=odds, moving=False,
                       door=feature.name, way=front.by(locale, at, feature.name))
