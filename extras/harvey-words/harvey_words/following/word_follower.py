"""Following acts on a map: a beam of hypotheses of place and heading, each with its log odds.

What is not said is inferred: that one goes out of a room before going on, turns where the hall that is named begins,
walks until there is a way to the side. Each such inference has its price, so the reading that needs least of them wins.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from harvey_words.following.word_doors import WordDoors
from harvey_words.following.word_map import is_along, moved, turned
from harvey_words.following.word_places import (
    AGAIN,
    HERE_M,
    MISSED,
    NO_WAY,
    NOT_SEEN,
    POINTS,
    TURNS,
    UNKNOWN_HEAD,
    UNSAID_EXIT,
    UNSAID_WALK,
    WRONG_COUNT,
    State,
    best_of,
)
from harvey_words.reading.told_acts import COMPASS, Act, ThingWords

BEAM, DEEP = 80, 14.0
"""Hypotheses that are followed on after an act; none is whose log odds are so far below those of the best."""
ALL_ACTS = 800
"""A text with more acts than a tenth of these is followed with fewer hypotheses, so that it takes no longer."""
PASSED_M = 0.4
"""How far beyond what was passed one stands."""

ABREAST_M = 0.5
"""A door so near to what is passed may be passed with it, or come after it."""


class WordFollower(WordDoors):
    """Follows acts on one map."""

    def follow(self, begin: Iterable[State], acts: Sequence[Act]) -> list[State]:
        """The hypotheses after all acts, best first; none is left out that is nearly as good as the best."""
        states = list(begin)
        for number, act in enumerate(acts):
            best: dict[tuple[object, ...], State] = {}
            is_last = number == len(acts) - 1
            for state in states:
                for new in self._expand(state, act, is_last):
                    marked = new.misfits if new.odds > state.odds - 1.9 else (*new.misfits, number)
                    new = replace(new, misfits=marked)
                    if new.key not in best or best[new.key].odds < new.odds:
                        best[new.key] = new
            least = max((one.odds for one in best.values()), default=0.0) - DEEP
            likely = (one for one in best.values() if one.odds > least)
            states = best_of(likely, min(BEAM, max(4, ALL_ACTS // len(acts))))
        ended = [new for state in states for new in (self._halt(state) if state.moving else (state,))]
        return best_of(ended, len(ended))

    def is_goal_there(self, state: State, act: Act) -> bool:
        """Whether a thing that a text names last, and that the building has, is where it ends."""
        what = act.until if act.sort == "go" else act.what if act.sort == "see" else None
        if what is None or what.heads or what.side or what.is_door or not any(
                word.sort == "THING" and word.meaning in self.plan.vocabulary for word in what.names):
            return True
        return self.seen_from(state, what) > NOT_SEEN

    def _expand(self, state: State, act: Act, is_last: bool) -> Iterator[State]:
        if act.sort in ("turn", "go", "find") and not self.area(state).is_hall:
            for out in self.leave(state, None):  # through rooms, each once
                if self.area(out).is_hall or all(locale != out.locale for locale, *_ in state.way):
                    yield from self._expand(replace(out, odds=out.odds + UNSAID_EXIT), act, is_last)
        elif act.sort == "exit":
            yield from self._exit(state, act)
        elif act.sort == "turn":
            yield from self._turn(state, act)
        elif act.sort == "go":
            ends = list(self._go(state, act))
            stopped = [end for end in ends if not end.moving] if is_last and act.until is not None else []
            yield from stopped or ends
        elif act.sort == "find" and act.what is not None:
            yield from self.find(state, act.what)
        elif act.sort == "see" and act.what is not None:
            yield from self.see(state, act.what)
        elif act.sort == "note" and act.what is not None:
            best = max((cost for _, cost in self.candidates(state, replace(act.what, count=""))), default=NOT_SEEN)
            yield replace(state, odds=state.odds + max(best, NOT_SEEN), moving=True)
        elif act.sort == "orient" and act.what is not None:
            yield from self.orient(state, act.what)
        else:
            yield replace(state, moving=False)

    def _exit(self, state: State, act: Act) -> Iterator[State]:
        if self.area(state).is_hall:
            yield state
            return
        yield from self.leave(state, act.along)

    def _turn(self, state: State, act: Act) -> Iterator[State]:
        starts: Iterable[State] = (state,)
        for passed in act.past:
            starts = best_of(new for one in starts for new in self._pass(one, passed))
        if act.until is not None:
            starts = [new for one in starts for new in (*self.stay(one, act.until), *self.reach(one, act.until))]
        for one in starts:
            if act.way in COMPASS:
                yield from self._turn_to(one, POINTS[act.way], act, 0.0)
            elif act.units and act.way in TURNS:
                yield from self._turn_at(one, act)
            elif act.way:
                yield from self._turn_here_or_on(one, act)
            else:
                yield from self._take(one, act.along)

    def _take(self, state: State, along: ThingWords | None) -> Iterator[State]:
        """Facing a hall that is named, here or where it leaves further on."""
        yield from self.facings(replace(state, moving=False), along)
        for rank, sight in enumerate(self.nodes(state) if along is not None and along.names else ()):
            cost = UNSAID_WALK * (not state.moving) + AGAIN * rank
            there = self.stand(state, sight)
            yield from self.facings(replace(there, moving=False, odds=there.odds + cost), along)

    def _turn_to(self, state: State, heading: float, act: Act, cost: float) -> Iterator[State]:
        """Turned to a heading, where the hall that is named begins if one is."""
        new = replace(state, heading=turned(heading, 0.0), moving=False, begun=state.at)
        fit = 0.0 if act.along is None else self.match.fit_area(act.along, self.hall_ahead(new))
        yield replace(new, odds=state.odds + cost + fit)

    def _turn_here_or_on(self, state: State, act: Act) -> Iterator[State]:
        """Turn where one stands, or at the places ahead where there is a way to that side."""
        turn = TURNS[act.way]
        can = any(is_along(way, state.heading + turn) for way in self.ways(state))
        has_begun = state.moving and state.begun is not None and math.dist(state.begun, state.at) < 0.1
        waits = UNSAID_WALK if has_begun else 0.0
        yield from self._turn_to(state, state.heading + turn, act, waits if can else NO_WAY + waits)
        if act.way == "back":
            return
        rank = 0
        for sight in self.nodes(state):
            there = self.stand(state, sight)
            if any(is_along(way, state.heading + turn) for way in self.ways(there)):
                cost = (0.0 if state.moving else UNSAID_WALK + NO_WAY * can) + AGAIN * rank
                yield from self._turn_to(there, state.heading + turn, act, cost)
                rank += 1

    def _turn_at(self, state: State, act: Act) -> Iterator[State]:
        """``The second left``: the second hall to that side, or else the second door."""
        rank = 0
        for sight in self.nodes(state):
            there = self.stand(state, sight)
            if any(is_along(way, state.heading + TURNS[act.way]) for way in self.ways(there)):
                rank += 1
                if rank == act.units:
                    yield from self._turn_to(there, state.heading + TURNS[act.way], act, 0.0)
        if not rank:
            yield from self.find(state, ThingWords(frozenset(("door",)), count=str(act.units), side=act.way))

    def _go(self, state: State, act: Act) -> Iterator[State]:
        says_nothing = act.until is None and not act.past and not act.units and act.along is None
        if act.until is not None and act.along is None and not act.units and not act.past:
            yield from self.stay(state, act.until)
        ends_hall = act.until is not None and act.until.heads >= {"end", "hall"} and act.until.names
        for facing in self.facings(state, act.along or (act.until if ends_hall else None)):
            starts: Iterable[State] = (facing,)
            for passed in act.past:
                starts = best_of(new for one in starts for new in self._pass(one, passed))
            if act.units:
                starts = [new for one in starts for new in self._count(one, act)]
            if act.metres:
                starts = [self._walk(one, act.metres) for one in starts]
            for one in starts:
                if act.until is not None and (act.units or act.metres):
                    yield from self.see(replace(one, moving=False), act.until, is_there=True)
                elif act.until is not None:
                    yield from self.reach(one, act.until)
                elif act.units or act.metres:
                    yield replace(one, moving=False)
                else:
                    yield replace(one, moving=True, begun=one.at if says_nothing or act.along else None)

    def _walk(self, state: State, metres: float) -> State:
        sights = [sight for sight in self.sights(state) if sight.ahead_m <= metres]
        last = sights[-1] if sights else None
        locale = last.locale if last else state.locale
        return replace(state, locale=locale, at=moved(state.at, state.heading, metres))

    def _count(self, state: State, act: Act) -> Iterator[State]:
        """So many places on; what only leads straight on counts."""
        nodes = self.nodes(state, through=True)
        if len(nodes) >= act.units:
            yield self.stand(state, nodes[act.units - 1])
        elif nodes:
            yield replace(self.stand(state, nodes[-1]), odds=state.odds + MISSED)
        if act.until is not None and act.until.names:
            for new in self.reach(state, act.until):
                yield replace(new, odds=new.odds + WRONG_COUNT)

    def _pass(self, state: State, what: ThingWords) -> Iterator[State]:
        """Beyond what is passed."""
        any_seen = False
        doors = [one.ahead_m for one in self.sights(state) if one.feature is not None and one.feature.sort == "door"]
        for sight, cost in self.candidates(state, what):
            any_seen = True
            beyond = PASSED_M if sight.feature is None or sight.feature.sort != "opening" else 0.1
            there = self.stand(state, sight, beyond)
            yield replace(there, odds=state.odds + cost, moving=True)
            if sight.feature is not None and sight.feature.sort == "thing" and any(
                    abs(door - sight.ahead_m) < ABREAST_M for door in doors):  # which some count, some do not
                yield replace(self.stand(state, sight, -ABREAST_M), odds=state.odds + cost, moving=True)
        if not any_seen or what.names:
            known = any(word.meaning in self.plan.vocabulary for word in what.names)
            yield replace(state, odds=state.odds + (MISSED - 1.0 if known else UNKNOWN_HEAD), moving=True)

    def _halt(self, state: State) -> Iterator[State]:
        """Where a text that ends while one walks may end."""
        has_walked = state.begun is None or math.dist(state.begun, state.at) > HERE_M
        yield replace(state, odds=state.odds - (0.7 if has_walked else 2.5), moving=False)
        nodes = self.nodes(state)
        if nodes:
            yield replace(self.stand(state, nodes[-1]), odds=state.odds - 0.7, moving=False)
            yield replace(self.stand(state, nodes[0]), odds=state.odds - 1.2, moving=False)
