"""Following acts on a map: a beam of hypotheses of place and heading, each with its log odds.

What is not said is inferred: that one goes out of a room before going on, turns where the hall that is named begins,
walks until there is a way to the side. Each such inference has its price, so the reading that needs least of them wins.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from harvey_words.acts import COMPASS, Act, ThingWords
from harvey_words.matching import MISFIT, UNKNOWN_HEAD, WORST, Senses, WordMatcher
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

BEAM, FEW = 80, 12
"""Hypotheses that are followed on: after an act, and within one."""
ALL_ACTS = 800
"""A text with more acts than a tenth of these is followed with fewer hypotheses, so that it takes no longer."""
AGAIN = -1.0
"""Of each further place that would do as well as the first."""
UNTOLD = -4.0
"""A goal out of sight to which no way is told."""
UNSAID_TURN, UNSAID_BACK, UNSAID_WALK, UNSAID_EXIT = -2.0, -2.6, -1.5, -0.3
NO_WAY, MISSED, NOT_SEEN = -2.0, -3.0, -2.5
"""A turn to a wall; a count or a place that there is not; a thing that is not where it should be."""
WRONG_RANK, WRONG_SIDE = -3.5, -4.0
MISCOUNT, WRONG_COUNT = -0.7, -1.5
"""A place that only leads on is counted, or is not; so many are counted, and the thing that is named is elsewhere."""
FLOOR_ENDS = -1.0
"""By the end of a hall, that of its floor is meant where it goes on with another."""
STRAIGHT_ON = -0.5
"""A hall that is reached where it goes straight on."""
ALONG, ALREADY = -0.7, -0.5
"""A crossing called by the hall that one walks along; one stands already at what is to be reached."""
OPEN_ONLY = -1.8
"""That only open doors were counted."""
BEHIND = 1.5
"""Off for a thing that lies behind when the walk begins, where a door after it is meant."""
SHUT = -0.5
"""A shut door without a name, as a goal: people are sent to rooms."""
NEAR_M, PASSED_M, BESIDE_M, HERE_M = 2.6, 0.4, 6.0, 1.3
"""What is at a place; how far beyond what was passed one stands; what is beside a thing; what is the same place."""
OPPOSITE_M = 0.3
"""What is hardly further along than the door one comes out of lies opposite, and is not counted."""
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
        inside: whether one has come in at it.
        senses: what the writer's words mean.
        misfits: numbers of the acts that fitted badly.
        way: the places on the way.
        begun: where the walk began about whose end nothing is said; came: the door by which one came out here.
    """

    locale: str
    at: Point
    heading: float
    odds: float = 0.0
    moving: bool = False
    door: str = ""
    senses: Senses = frozenset()
    misfits: tuple[int, ...] = ()
    way: tuple[tuple[str, float, float], ...] = ()
    begun: Point | None = None
    came: str = ""

    @property
    def key(self) -> tuple[object, ...]:
        """What makes two hypotheses one."""
        return (self.locale, round(self.at[0], 1), round(self.at[1], 1), round(self.heading, 2), self.moving, self.door)


def _best(states: Iterable[State], count: int = FEW) -> list[State]:
    """The best of some hypotheses, in an order that does not depend on how they came."""
    return sorted(states, key=lambda one: (-one.odds, one.locale, one.at, one.heading))[:count]


class WordFollower:
    """Follows acts on one map."""

    def __init__(self, plan: WordMap) -> None:
        self.plan = plan
        self._match = WordMatcher(plan)

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
            states = _best(best.values(), min(BEAM, max(4, ALL_ACTS // len(acts))))
        ended = [new for state in states for new in (self._halt(state) if state.moving else (state,))]
        return _best(ended, len(ended))

    def _expand(self, state: State, act: Act, is_last: bool) -> Iterator[State]:
        if act.sort == "exit":
            yield from self._exit(state, act)
        elif act.sort == "turn":
            yield from self._turn(state, act)
        elif act.sort == "go":
            ends = list(self._go(state, act))
            stopped = [end for end in ends if not end.moving] if is_last and act.until is not None else []
            yield from stopped or ends
        elif act.sort == "find" and act.what is not None:
            yield from self._find(state, act.what)
        elif act.sort == "see" and act.what is not None:
            yield from self._see(state, act.what)
        elif act.sort == "note" and act.what is not None:
            best = max((cost for _, cost, _ in self._candidates(state, replace(act.what, count=""))), default=NOT_SEEN)
            yield replace(state, odds=state.odds + max(best, NOT_SEEN), moving=True)
        elif act.sort == "orient" and act.what is not None:
            yield from self._orient(state, act.what)
        else:
            yield replace(state, moving=False)

    # -- places and ways ---------------------------------------------------------------------------------------------

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
        return replace(state, locale=name, at=at, way=(*state.way, (name, round(at[0], 2), round(at[1], 2))))

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

    def _facings(self, state: State, along: ThingWords | None) -> Iterator[State]:
        """The hypothesis out in the hall, facing the ways that it may go on, those that are not said at a price."""
        if not self.area(state).is_hall:
            for out in self._leave(state, None):
                yield from self._facings(replace(out, odds=out.odds + UNSAID_EXIT), along)
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
            if along is not None and (along.names or along.side in COMPASS):
                fit, senses = self._match.fit_area(along, self.hall_ahead(new), state.senses)
                if along.side in COMPASS:
                    fit += 0.0 if is_along(POINTS[along.side], way) else WRONG_SIDE
                new = replace(new, senses=senses)
                cost = 0.5 * cost + fit
            if not is_along(way, state.heading):
                new = replace(new, moving=False, begun=None)
            yield replace(new, odds=state.odds + cost)

    # -- acts --------------------------------------------------------------------------------------------------------

    def _exit(self, state: State, act: Act) -> Iterator[State]:
        if self.area(state).is_hall:
            yield state
            return
        yield from self._leave(state, act.along)

    def _leave(self, state: State, by: ThingWords | None) -> Iterator[State]:
        """Out of a room by each of its open doors."""
        for feature in self.area(state).features:
            if feature.is_open and feature.beyond is not None:
                fit, senses = self._match.fit(by, feature, state.senses) if by else (0.0, state.senses)
                area = self.plan.areas[feature.beyond]
                at, heading = feature.at, state.heading if feature.outward is None else feature.outward
                if area.is_hall:
                    turn = math.remainder(area.axis - heading, math.tau)
                    ahead, left = offsets(at, heading, area.middle)
                    at = moved(at, heading, ahead if 0.8 < abs(turn) < 2.3 else 0.5,
                               0.0 if 0.8 < abs(turn) < 2.3 else left)
                else:
                    at = moved(at, heading, 0.5)
                yield replace(state, locale=area.name, at=at, heading=heading, odds=state.odds + fit, senses=senses,
                              moving=False, door="", begun=at, came=feature.name,
                              way=(*state.way, (area.name, round(at[0], 2), round(at[1], 2))))

    def _turn(self, state: State, act: Act) -> Iterator[State]:
        if not self.area(state).is_hall:
            if act.way in TURNS:
                yield replace(state, heading=turned(state.heading, TURNS[act.way]), odds=state.odds - 1.5)
            for out in self._leave(state, None):
                yield from self._turn(replace(out, odds=out.odds + UNSAID_EXIT), act)
            return
        starts: Iterable[State] = (state,)
        for passed in act.past:
            starts = _best(new for one in starts for new in self._pass(one, passed))
        if act.until is not None:
            starts = [new for one in starts for new in (*self._stay(one, act.until), *self._reach(one, act.until))]
        for one in starts:
            if act.way in COMPASS:
                yield from self._turn_to(one, POINTS[act.way], act, 0.0)
            elif act.units and act.way in TURNS:
                yield from self._turn_at(one, act)
            elif act.way:
                yield from self._turn_here_or_on(one, act)
            else:
                yield from self._facings(replace(one, moving=False), act.along)

    def _turn_to(self, state: State, heading: float, act: Act, cost: float) -> Iterator[State]:
        """Turned to a heading, where the hall that is named begins if one is."""
        new = replace(state, heading=turned(heading, 0.0), moving=False, begun=state.at)
        fit, senses = 0.0, state.senses
        if act.along is not None:
            fit, senses = self._match.fit_area(act.along, self.hall_ahead(new), senses)
        yield replace(new, odds=state.odds + cost + fit, senses=senses)

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
            yield from self._find(state, ThingWords(frozenset(("door",)), count=str(act.units), side=act.way))
        elif rank < act.units:
            yield replace(state, odds=state.odds + MISSED)

    def _go(self, state: State, act: Act) -> Iterator[State]:
        says_nothing = act.until is None and not act.past and not act.units and act.along is None
        if act.until is not None and act.along is None and not act.units and not act.past:
            yield from self._stay(state, act.until)
        ends_hall = act.until is not None and act.until.heads >= {"end", "hall"} and act.until.names
        for facing in self._facings(state, act.along or (act.until if ends_hall else None)):
            starts: Iterable[State] = (facing,)
            for passed in act.past:
                starts = _best(new for one in starts for new in self._pass(one, passed))
            if act.units:
                starts = [new for one in starts for new in self._count(one, act)]
            if act.metres:
                starts = [self._walk(one, act.metres) for one in starts]
            for one in starts:
                if act.until is not None and (act.units or act.metres):
                    yield from self._see(replace(one, moving=False), act.until, is_there=True)
                elif act.until is not None:
                    yield from self._reach(one, act.until)
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
        """So many places on; what only leads straight on counts, or else only what is seen to be a crossing does."""
        for through in (True, False):
            nodes = self.nodes(state, through)
            if not through and len(nodes) == len(self.nodes(state, True)):
                return
            price = 0.0 if through else MISCOUNT
            if len(nodes) >= act.units:
                yield replace(self.stand(state, nodes[act.units - 1]), odds=state.odds + price)
            elif nodes:
                yield replace(self.stand(state, nodes[-1]), odds=state.odds + price + MISSED)
            if act.until is not None and act.until.names and through:
                for new in self._reach(state, act.until):
                    yield replace(new, odds=new.odds + WRONG_COUNT)

    def _pass(self, state: State, what: ThingWords) -> Iterator[State]:
        """Beyond what is passed."""
        any_seen = False
        for sight, cost, senses in self._candidates(state, what):
            any_seen = True
            beyond = PASSED_M if sight.feature is None or sight.feature.sort != "opening" else 0.1
            there = self.stand(state, sight, beyond)
            yield replace(there, odds=state.odds + cost, senses=senses, moving=True)
        if not any_seen or what.names:
            known = any(word.meaning in self.plan.vocabulary for word in what.names)
            yield replace(state, odds=state.odds + (MISSED - 1.0 if known else UNKNOWN_HEAD), moving=True)

    def _reach(self, state: State, what: ThingWords) -> Iterator[State]:
        """At what is to be reached."""
        if what.heads & {"end", "wall"} or (what.heads & {"corner"} and not what.number):
            yield from self._reach_end(state, what)
            return
        found = False
        for sight, cost, senses in self._candidates(state, what):
            found = True
            yield replace(self.stand(state, sight), odds=state.odds + cost, senses=senses, moving=False)
        known = any(word.meaning in self.plan.vocabulary for word in what.names)
        if not found or what.names:
            yield replace(state, odds=state.odds + (MISSED - 1.0 if known else UNKNOWN_HEAD), moving=True)

    def _reach_end(self, state: State, what: ThingWords) -> Iterator[State]:
        """At the wall ahead, or where the floor that one walks on ends."""
        nodes = self.nodes(state)
        walked, is_named = self.hall_ahead(state), "hall" in what.heads and bool(what.names)
        for sight in nodes[:-1]:
            there = replace(self.stand(state, sight), moving=False)
            if self.hall_ahead(there).meanings != walked.meanings and "end" in what.heads:
                price = 0.0 if is_named else FLOOR_ENDS
                yield from self._see(replace(there, odds=state.odds + price), replace(what, heads=frozenset()))
                break
        for sight in nodes[-1:]:
            there = replace(self.stand(state, sight), moving=False)
            if what.names:
                yield from self._see(there, replace(what, heads=what.heads - {"end", "wall"}))
            else:
                yield there
            if not self.plan.areas[sight.locale].is_tile:
                yield replace(state, odds=state.odds - 0.5, moving=True)  # what follows may be short of the end
        if not nodes:
            yield replace(state, odds=state.odds - 0.3, moving=False)  # it is here

    def _stay(self, state: State, what: ThingWords) -> Iterator[State]:
        """Where one stands, if what is to be reached is here."""
        is_end = bool(what.heads & {"end", "wall"})
        here, senses = self._seen_from(state, what) if what.names and not is_end else (WORST, state.senses)
        if is_end and not what.names and not self.nodes(state):
            here = -ALREADY
        if here > -1.0:
            yield replace(state, odds=state.odds + here + ALREADY, senses=senses, moving=False)

    def _candidates(self, state: State, what: ThingWords) -> Iterator[tuple[NamedSight, float, Senses]]:
        """What is seen ahead and fits, nearest first, each with its price."""
        found: list[tuple[NamedSight, float, Senses, int, int]] = []
        rank = 0
        taken = -math.inf
        for place, sight in enumerate(self._sights_for(state, what), 1):
            fit, senses = self._fit_sight(state, sight, what)
            if fit <= MISFIT or (sight.ahead_m - taken < 0.3 and not sight.feature):
                continue
            if what.side in ("left", "right") and sight.side in ("left", "right") and sight.side != what.side and (
                    not what.is_stretch):
                fit += WRONG_SIDE
            if fit > -1.0:
                rank += 1
                taken = sight.ahead_m
            found.append((sight, fit, senses, rank, place))
        for sight, fit, senses, own, place in found:
            number = rank if what.count == "last" else what.number
            miscount = MISCOUNT if "crossing" in what.heads and place == number else WRONG_RANK
            cost = fit + (miscount * (own != number) if number else AGAIN * max(own - 1, 0))
            if cost > WORST:
                yield sight, cost, senses

    def _sights_for(self, state: State, what: ThingWords) -> Iterable[NamedSight]:
        """The sights that a description may be of: crossings for a crossing or hall, features for the rest."""
        if what.heads & {"crossing", "corner"} or what.is_stretch or not (what.heads or what.names):
            return self.nodes(state)
        least = 0.3 if self.area(state).is_tile else -0.1
        return [sight for sight in self.sights(state) if sight.feature is not None and sight.feature.sort != "opening"
                and sight.ahead_m > least and sight.side != "behind"
                and (abs(sight.left_m) < NEAR_M or not self.area(state).is_hall)]

    def _fit_sight(self, state: State, sight: NamedSight, what: ThingWords) -> tuple[float, Senses]:
        if sight.feature is not None and sight.feature.sort != "opening":
            return self._match.fit(what, sight.feature, state.senses)
        there = self.stand(state, sight)
        halls = self._halls_at(there, "")
        if what.is_stretch:
            fits = [self._match.fit_area(what, hall, state.senses) for hall in self._halls_at(there, what.side)]
            onward, before = self.hall_ahead(there), self.hall_ahead(state)
            if what.names and not what.side and onward.meanings != before.meanings:
                fit, senses = self._match.fit_area(what, onward, state.senses)
                fits.append((fit + STRAIGHT_ON, senses))
            return max(fits, key=lambda pair: pair[0], default=(MISFIT, state.senses))
        cost = -1.5 if what.heads & {"crossing"} and not halls else 0.0
        fit, senses = self._fit_place(there, what, halls)
        return cost + fit, senses

    def _halls_at(self, state: State, side: str) -> list[Area]:
        """The halls that leave a place to the sides, or to one of them."""
        turns = [TURNS[side]] if side in ("left", "right") else [TURNS["left"], TURNS["right"]]
        return [self.hall_ahead(replace(state, heading=way)) for way in self.ways(state)
                if any(is_along(way, state.heading + turn) for turn in turns)]

    def _fit_place(self, state: State, what: ThingWords, halls: Sequence[Area]) -> tuple[float, Senses]:
        """How well a place fits: each word by a hall that leaves to the side, by what stands there, or straight on."""
        score, senses = 0.0, state.senses
        onward = [self.hall_ahead(replace(state, heading=way)) for way in self.ways(state)]
        for word in what.names:
            one = ThingWords(names=(word,))
            fits = [self._match.fit_area(one, hall, senses) for hall in halls]
            fits += [self._match.fit(one, feature, senses) for feature in self.area(state).features
                     if math.dist(feature.at, state.at) < NEAR_M and not (word.sort == "MOD" and "hall" in what.heads)]
            fits += [(fit + ALONG, own) for fit, own in (self._match.fit_area(one, hall, senses) for hall in onward)]
            fit, senses = max(fits, key=lambda pair: pair[0], default=(MISFIT, senses))
            score += fit
        return max(score, WORST), senses

    # -- the goal ------------------------------------------------------------------------------------------------------

    def _find(self, state: State, what: ThingWords) -> Iterator[State]:
        """At each door, or thing, that may be meant."""
        if what.heads & {"crossing", "corner", "end"} and not what.heads & {"door"}:
            for facing in self._facings(state, None):
                if not what.names:
                    yield from self._reach(facing, what)
                for node in self.nodes(facing) if what.names else ():
                    yield from self._named_crossing(replace(self.stand(facing, node), moving=False), what)
            yield from self._anywhere(state, what)
            return
        if not self.area(state).is_hall:
            for out in self._leave(state, None):
                yield from self._find(replace(out, odds=out.odds + UNSAID_EXIT), what)
            return
        at_door = bool(state.came) and state.begun is not None and math.dist(state.begun, state.at) < 0.1
        if at_door and what.side in ("left", "right") and not any(
                is_along(way, state.heading) for way in self.ways(state)):
            # come out of a door, what lies to the left lies in that direction, on either side of the hall
            there = replace(state, heading=turned(state.heading, TURNS[what.side]), odds=state.odds - 0.5)
            yield from self._find_from([there], replace(what, side=""))
        yield from self._find_from(self._facings(state, None), what)
        yield from self._anywhere(state, what)
        yield replace(state, odds=state.odds + WORST)

    def _anywhere(self, state: State, what: ThingWords) -> Iterator[State]:
        """What is named and out of sight, wherever it is: a goal without a way."""
        if not what.names:
            return
        for area in self.plan.areas.values():
            here = replace(state, locale=area.name, at=area.middle, odds=state.odds + UNTOLD, moving=False, door="")
            here = replace(here, way=(*state.way, (area.name, round(area.middle[0], 2), round(area.middle[1], 2))))
            if what.heads & {"crossing", "corner", "end"}:
                if area.is_tile and (area.meanings & {"crossing", "corner"} or len(self.ways(here)) != 2):
                    yield from self._named_crossing(here, what)
                continue
            for feature in area.features:
                fit, senses = self._match.fit(what, feature, state.senses)
                if fit > UNKNOWN_HEAD and feature.sort == "door" and area.is_hall:
                    ahead = feature.outward if feature.outward is not None else 0.0
                    before = replace(here, at=feature.at, heading=ahead)
                    yield self._at_door(before, NamedSight(feature, 0.0, 0.0, "ahead", area.name),
                                        here.odds + fit, senses)

    def _named_crossing(self, state: State, what: ThingWords) -> Iterator[State]:
        """A crossing or end of halls, each word of which is said of one that leaves here or of what stands here."""
        ways = self.ways(state)
        if (what.heads & {"end"} and len(ways) > 2) or (what.heads & {"corner"} and len(ways) != 2):
            return
        halls = [self.hall_ahead(replace(state, heading=way)) for way in ways]
        fit, senses = self._fit_place(state, what, halls)
        if fit > WORST:
            yield replace(state, odds=state.odds + fit, senses=senses)

    def _find_from(self, facings: Iterable[State], what: ThingWords) -> Iterator[State]:
        """The doors that may be meant from where one stands, along the ways that one may face."""
        for facing in facings:
            doors = [sight for sight in self.sights(facing) if sight.feature is not None
                     and sight.feature.sort == "door" and sight.side != "behind"
                     and sight.ahead_m > (OPPOSITE_M if facing.came and facing.begun == facing.at else -0.2)
                     and sight.feature.name != facing.came]
            for sight in doors:
                cost, senses = self._weigh_door(facing, sight, doors, what)
                if cost > WORST:
                    yield self._at_door(facing, sight, facing.odds + cost, senses)

    def _weigh_door(self, state: State, sight: NamedSight, doors: Sequence[NamedSight],
                    what: ThingWords) -> tuple[float, Senses]:
        """Words, side, rank and relations of a door, together."""
        assert sight.feature is not None
        cost, senses = self._match.fit(what, sight.feature, state.senses)
        if not what.names and not sight.feature.is_open:
            cost += SHUT
        side = self._side_of(state, what.side)
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
            if not sided and what.count:
                same = [one for one in row if one.side == sight.side]  # "the next" may be that of its side
                rank = same.index(sight) + 1
                own = max(own, self._weigh_rank(what, rank, len(same), 0, 0, only_open) - 0.5)
            cost += own
        between = [other for relation, other in what.relations if relation == "between"]
        if len(between) == 2:
            cost += self._weigh_between(state, sight, doors, between[0], between[1])
        for relation, other in what.relations if len(between) != 2 else ():
            cost += self._weigh_relation(state, sight, doors, relation, other)
        return cost, senses

    def _side_of(self, state: State, side: str) -> str:
        """Left or right; of a point of the compass, which of them it is."""
        if side not in POINTS:
            return side
        turn = math.remainder(POINTS[side] - state.heading, math.tau)
        return "left" if 0.8 < turn < 2.3 else "right" if -2.3 < turn < -0.8 else "ahead"

    def _weigh_rank(self, what: ThingWords, rank: int, count: int, open_rank: int, open_count: int,
                    only_open: bool) -> float:
        related = any(relation in ("past", "before", "across", "next-to", "between") for relation, _ in what.relations)
        if what.count == "last":
            return 0.0 if rank == count else OPEN_ONLY if open_rank == open_count and open_rank else WRONG_RANK
        number = what.number
        if number and not (related and number == 1):
            if only_open:
                return 0.0 if open_rank == number else WRONG_RANK
            return 0.0 if rank == number else OPEN_ONLY if open_rank == number else WRONG_RANK
        return 0.0 if what.names or related else AGAIN * min(rank - 1, 3)

    def _weigh_between(self, state: State, sight: NamedSight, doors: Sequence[NamedSight], one: ThingWords,
                       other: ThingWords) -> float:
        """How well a door lies between two things: on their side, with no other door there."""
        best = WRONG_SIDE
        marks = [mark for mark in self.sights(state) if mark.feature is not None and mark.feature.sort != "opening"]
        fits = [[(mark, fit) for mark in marks if mark.feature and mark is not sight and (
            fit := self._match.fit(what, mark.feature, state.senses)[0]) > MISFIT] for what in (one, other)]
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
        best = -2.0 if not any(word.meaning in self.plan.vocabulary for word in other.names) else -3.5
        rank = 0
        for mark in self.sights(state):
            if mark.feature is None or mark.feature.sort == "opening" or mark is sight:
                continue
            fit, _ = self._match.fit(other, mark.feature, state.senses)
            if fit <= MISFIT:
                continue
            gap = sight.ahead_m - mark.ahead_m
            walked_m = offsets(state.begun or state.at, state.heading, mark.feature.at)[0]
            if walked_m > 0.0 and fit > -1.0:
                fit += 0.7 * AGAIN * rank  # the first of several columns is meant
                rank += 1
            between = [one for one in doors if one is not sight and one is not mark and one.side == sight.side
                       and min(sight.ahead_m, mark.ahead_m) - 0.05 < one.ahead_m < max(sight.ahead_m, mark.ahead_m)]
            if relation == "past":
                fit += AGAIN * 1.5 * len(between) - BEHIND * (walked_m < -0.3) if gap > -0.3 else -3.0
            elif relation == "before":
                fit += AGAIN * 1.5 * len(between) if gap < 0.3 else -3.0
            elif relation == "across":
                fit += -abs(gap) / 2.0 - 2.0 * (mark.side == sight.side)
            else:
                fit += -max(abs(gap) - 1.5, 0.0) / 2.0
            best = max(best, fit)
        if relation == "across" and not other.names:
            best = max(best, -2.0 * abs(sight.ahead_m))
        return best

    def _at_door(self, state: State, sight: NamedSight, odds: float, senses: Senses) -> State:
        """At a door: in the room behind it where it is open, else before it."""
        feature = sight.feature
        assert feature is not None
        front = self.stand(state, sight)
        heading = state.heading if feature.outward is None else feature.outward
        locale = feature.beyond if feature.is_open and feature.beyond else sight.locale
        at = moved(feature.at, heading, 0.5) if feature.is_open else front.at
        return replace(front, locale=locale, at=at, heading=heading, odds=odds, senses=senses, moving=False,
                       door=feature.name, way=(*front.way, (locale, round(at[0], 2), round(at[1], 2))))

    # -- what is seen --------------------------------------------------------------------------------------------------

    def _see(self, state: State, what: ThingWords, is_there: bool = False) -> Iterator[State]:
        """Where a thing is as it is said; walking on to where it is, at a price if nobody was walking."""
        here, senses = self._seen_from(state, what)
        if not state.moving:
            for there in self._reach(state, what) if here < UNSAID_WALK and what.names and not is_there else ():
                yield replace(there, odds=there.odds + UNSAID_WALK)
            kept = senses if here > NOT_SEEN else state.senses
            yield replace(state, odds=state.odds + max(here, NOT_SEEN), senses=kept)
            return
        found = list(self._candidates(state, what))
        for sight, cost, own in found:
            yield replace(self.stand(state, sight), odds=state.odds + cost, senses=own, moving=True)
        yield replace(state, odds=state.odds + max(here, NOT_SEEN) - 0.5 * bool(found), senses=senses)

    def _seen_from(self, state: State, what: ThingWords) -> tuple[float, Senses]:
        """The best fit of what is to be seen where one stands, on the side where it is said to be."""
        if not (what.heads - {"side"} or what.names):
            return 0.0, state.senses
        ways = self.ways(state) if self.area(state).is_hall else []
        if what.heads & {"wall", "end"} and (not what.names or (what.side == "behind" and "wall" in what.heads)):
            turn = state.heading + TURNS.get(what.side, 0.0)
            return (NOT_SEEN if any(is_along(way, turn) for way in ways) else 0.0), state.senses
        if what.heads & {"corner"} and not what.names:
            return (0.0 if len(ways) <= 2 else NOT_SEEN), state.senses
        if what.heads & {"crossing"} and not what.names:
            return (0.0 if len(ways) > 2 else -1.0), state.senses
        best: tuple[float, Senses] = (NOT_SEEN - 1.0, state.senses)
        side = self._side_of(state, what.side)
        for way in ways:
            if side not in TURNS or is_along(way, state.heading + TURNS[side]):
                fit = self._match.fit_area(what, self.hall_ahead(replace(state, heading=way)), state.senses)
                best = max(best, fit, key=lambda pair: pair[0])
        if what.is_stretch and what.heads:
            looking = replace(state, heading=turned(state.heading, TURNS.get(side, 0.0)))
            for node in self.nodes(looking) if what.names else ():
                own, senses = self._fit_sight(looking, node, what)
                best = max(best, (own - 0.7 - 0.02 * node.ahead_m, senses), key=lambda pair: pair[0])
            return best
        far = side in ("ahead", "behind", "left", "right") or not self.area(state).is_hall
        looking = replace(state, heading=turned(state.heading, TURNS.get(side, 0.0))) if side in TURNS else state
        for sight in self.sights(looking):
            if sight.feature is None or sight.feature.sort == "opening" or (
                    what.is_stretch and sight.feature.sort == "thing"):
                continue
            ahead = sight.ahead_m if far else abs(sight.ahead_m)
            if ahead < -0.5 or ahead > (40.0 if far else NEAR_M) or (far and ahead < 0.1 and side in ("left", "right")):
                continue
            if far and self.area(state).is_hall and abs(sight.left_m) > min(NEAR_M, max(ahead, HERE_M)):
                continue
            fit = self._match.fit(what, sight.feature, state.senses)
            best = max(best, (fit[0] - 0.02 * abs(sight.ahead_m), fit[1]), key=lambda pair: pair[0])
        return best

    def _orient(self, state: State, what: ThingWords) -> Iterator[State]:
        """Turned so that a thing is on the side where it is said to be; before that, where one was going is reached."""
        if not self.area(state).is_hall:
            yield state
            return
        headings = [turned(self.area(state).axis, turn) for turn in (0.0, math.pi / 2, math.pi, -math.pi / 2)]
        ways = self.ways(state)
        for heading in headings:
            new = replace(state, heading=heading, moving=False)
            fit, senses = self._seen_from(new, what)
            closed = 0.0 if any(is_along(way, heading) for way in ways) or what.side == "ahead" else -1.0
            yield replace(new, odds=state.odds + 1.5 * fit + closed, senses=senses)

    def _halt(self, state: State) -> Iterator[State]:
        """Where a text that ends while one walks may end."""
        has_walked = state.begun is None or math.dist(state.begun, state.at) > HERE_M
        yield replace(state, odds=state.odds - (0.7 if has_walked else 2.5), moving=False)
        nodes = self.nodes(state)
        if nodes:
            yield replace(self.stand(state, nodes[-1]), odds=state.odds - 0.7, moving=False)
            yield replace(self.stand(state, nodes[0]), odds=state.odds - 1.2, moving=False)
