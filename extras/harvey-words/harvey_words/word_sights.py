"""What is seen from a hypothesis, and where what is to be reached may be."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from harvey_words.matching import MISFIT, UNKNOWN_HEAD, WORST
from harvey_words.told_acts import ThingWords
from harvey_words.word_map import Area, NamedSight, is_along, turned
from harvey_words.word_places import HERE_M, NEAR_M, TURNS, UNSAID_WALK, WRONG_RANK, WRONG_SIDE, State, WordPlaces

AGAIN = -1.0
"""Of each further place that would do as well as the first."""
NO_WAY, MISSED, NOT_SEEN = -2.0, -3.0, -2.5
"""A turn to a wall; a count or a place that there is not; a thing that is not where it should be."""
MISCOUNT, WRONG_COUNT = -0.7, -1.5
"""A place that only leads on is counted, or is not; so many are counted, and the thing that is named is elsewhere."""
FLOOR_ENDS = -1.0
"""By the end of a hall, that of its floor is meant where it goes on with another."""
STRAIGHT_ON = -0.5
"""A hall that is reached where it goes straight on."""
ALONG, ALREADY = -0.7, -0.5
"""A crossing called by the hall that one walks along; one stands already at what is to be reached."""


class WordSights(WordPlaces):
    """Sees and reaches what a text describes."""

    def see(self, state: State, what: ThingWords, is_there: bool = False) -> Iterator[State]:
        """Where a thing is as it is said; walking on to where it is, at a price if nobody was walking."""
        here = self.seen_from(state, what)
        if not state.moving:
            for there in self.reach(state, what) if here < UNSAID_WALK and what.names and not is_there else ():
                yield replace(there, odds=there.odds + UNSAID_WALK)
            yield replace(state, odds=state.odds + max(here, NOT_SEEN))
            return
        found = list(self.candidates(state, what))
        for sight, cost in found:
            yield replace(self.stand(state, sight), odds=state.odds + cost, moving=True)
        yield replace(state, odds=state.odds + max(here, NOT_SEEN) - 0.5 * bool(found))

    def seen_from(self, state: State, what: ThingWords) -> float:
        """The best fit of what is to be seen where one stands, on the side where it is said to be."""
        if not (what.heads - {"side"} or what.names):
            return 0.0
        ways = self.ways(state) if self.area(state).is_hall else []
        if what.heads & {"wall", "end"} and (not what.names or (what.side == "behind" and "wall" in what.heads)):
            turn = state.heading + TURNS.get(what.side, 0.0)
            return NOT_SEEN if any(is_along(way, turn) for way in ways) else 0.0
        if what.heads & {"corner"} and not what.names:
            return 0.0 if len(ways) <= 2 else NOT_SEEN
        if what.heads & {"crossing", "corner"}:
            return self.fit_place(state, what, [self.hall_ahead(replace(state, heading=way)) for way in ways])
        best = NOT_SEEN - 1.0
        side = self.side_of(state, what.side)
        for way in ways:
            if side not in TURNS or is_along(way, state.heading + TURNS[side]):
                fit = self.match.fit_area(what, self.hall_ahead(replace(state, heading=way)))
                best = max(best, fit)
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
            best = max(best, self.match.fit(what, sight.feature) - 0.02 * abs(sight.ahead_m))
        return best

    def orient(self, state: State, what: ThingWords) -> Iterator[State]:
        """Turned so that a thing is on the side where it is said to be; before that, where one was going is reached."""
        if not self.area(state).is_hall:
            yield state
            return
        headings = [turned(self.area(state).axis, turn) for turn in (0.0, math.pi / 2, math.pi, -math.pi / 2)]
        ways = self.ways(state)
        for heading in headings:
            new = replace(state, heading=heading, moving=False)
            fit = self.seen_from(new, what)
            closed = 0.0 if any(is_along(way, heading) for way in ways) or what.side == "ahead" else -1.0
            yield replace(new, odds=state.odds + 1.5 * fit + closed)

    def stay(self, state: State, what: ThingWords) -> Iterator[State]:
        """Where one stands, if what is to be reached is here."""
        is_end = bool(what.heads & {"end", "wall"})
        here = self.seen_from(state, what) if what.names and not is_end else WORST
        if is_end and not self.nodes(state):
            behind = self.hall_ahead(replace(state, heading=turned(state.heading, math.pi)))
            here = self.match.fit_area(what, behind) - ALREADY
        if here > -1.0:
            yield replace(state, odds=state.odds + here + ALREADY, moving=False)

    def reach(self, state: State, what: ThingWords) -> Iterator[State]:
        """At what is to be reached."""
        if what.heads & {"end", "wall"} or (what.heads & {"corner"} and not what.number):
            yield from self._reach_end(state, what)
            return
        found = False
        for sight, cost in self.candidates(state, what):
            found = True
            yield replace(self.stand(state, sight), odds=state.odds + cost, moving=False)
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
                yield from self.see(replace(there, odds=state.odds + price), replace(what, heads=frozenset()))
                break
        for sight in nodes[-1:]:
            there = replace(self.stand(state, sight), moving=False)
            if what.names:
                yield from self.see(there, replace(what, heads=what.heads - {"end", "wall"}))
            else:
                yield there
            if not self.plan.areas[sight.locale].is_tile:
                yield replace(state, odds=state.odds - 0.5, moving=True)  # what follows may be short of the end

    def candidates(self, state: State, what: ThingWords) -> Iterator[tuple[NamedSight, float]]:
        """What is seen ahead and fits, nearest first, each with its price."""
        found: list[tuple[NamedSight, float, int, int]] = []
        rank = 0
        taken = -math.inf
        for place, sight in enumerate(self._sights_for(state, what), 1):
            fit = self._fit_sight(state, sight, what)
            if fit <= MISFIT or (sight.ahead_m - taken < 0.3 and not sight.feature):
                continue
            if fit > -1.0:
                rank += 1
                taken = sight.ahead_m
            found.append((sight, fit, rank, place))
        for sight, fit, own, place in found:
            number = rank if what.count == "last" else what.number
            miscount = MISCOUNT if "crossing" in what.heads and place == number else WRONG_RANK
            cost = fit + (miscount * (own != number) if number else AGAIN * max(own - 1, 0))
            if cost > WORST:
                yield sight, cost

    def _sights_for(self, state: State, what: ThingWords) -> Iterable[NamedSight]:
        """The sights that a description may be of: crossings for a crossing or hall, features for the rest."""
        if what.heads & {"crossing", "corner"} or what.is_stretch or not (what.heads or what.names):
            return self.nodes(state)
        least = 0.3 if self.area(state).is_tile else -0.1
        return [sight for sight in self.sights(state) if sight.feature is not None and sight.feature.sort != "opening"
                and sight.ahead_m > least and sight.side != "behind" and sight.feature.name != state.came
                and (abs(sight.left_m) < NEAR_M or not self.area(state).is_hall)]

    def _fit_sight(self, state: State, sight: NamedSight, what: ThingWords) -> float:
        if sight.feature is not None and sight.feature.sort != "opening":
            fit = self.match.fit(what, sight.feature)
            sides = {self.side_of(state, what.side), sight.side}
            return fit + WRONG_SIDE * (sides == {"left", "right"} and not self.area(state).is_tile)
        there = self.stand(state, sight)
        halls = self.halls_at(there, "")
        if what.is_stretch:
            fits = [self.match.fit_area(what, hall) for hall in self.halls_at(there, what.side)]
            onward, before = self.hall_ahead(there), self.hall_ahead(state)
            if what.names and not what.side and onward.meanings != before.meanings:
                fits.append(self.match.fit_area(what, onward) + STRAIGHT_ON)
            return max(fits, default=MISFIT)
        cost = -1.5 if what.heads & {"crossing"} and not halls else 0.0
        return cost + self.fit_place(there, what, halls)

    def fit_place(self, state: State, what: ThingWords, halls: Sequence[Area]) -> float:
        """How well a place fits: each word by a hall that leaves to the side, by what stands there, or straight on."""
        score = 0.0
        onward = [self.hall_ahead(replace(state, heading=way)) for way in self.ways(state)]
        for word in what.names:
            one = ThingWords(names=(word,))
            fits = [self.match.fit_area(one, hall) for hall in halls]
            fits += [self.match.fit(one, feature) for feature in self.area(state).features
                     if math.dist(feature.at, state.at) < NEAR_M and not (word.sort == "MOD" and "hall" in what.heads)]
            fits += [self.match.fit_area(one, hall) + ALONG for hall in onward]
            score += max(fits, default=MISFIT)
        return max(score, WORST)
