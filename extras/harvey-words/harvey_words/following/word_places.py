"""Hypotheses of place and heading on a map: the ways that go on, what is seen there, and where what is told may be."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from harvey_words.following.word_map import (
    COLOUR_REACH,
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
from harvey_words.reading.lexicon import Word
from harvey_words.reading.told_acts import ThingWords

NEUTRAL = frozenset(("long", "colored", "frame", "picture", "north", "south", "east", "west"))
"""Words by which things are hardly told apart, and points of the compass, which are no part of a thing."""
MISFIT, UNKNOWN_HEAD, RELATED, UNKNOWN_MODIFIER = -4.5, -2.0, -1.2, -0.8
"""A word of the model that does not fit; one that the model lacks; a kindred thing; a property that the model lacks."""
OTHER_KIND = -1.5
"""A kindred thing, where the building has the very thing too."""
INSIDE = -0.3
"""A hall that is called by what stands in it."""
WORST = -7.0
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
FEW = 12
"""Hypotheses that are followed on within an act."""
UNSAID_TURN, UNSAID_BACK, UNSAID_WALK, UNSAID_EXIT = -2.0, -2.6, -1.5, -0.3
"""What is done without being told: turning to the side, turning back, walking on, leaving a room."""
WRONG_RANK, WRONG_SIDE = -3.5, -4.0
"""Of what has another number, or lies on the other side."""
OPPOSITE_M = 0.3
"""What is hardly further along than the door one comes out of lies opposite, and is neither counted nor passed."""
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

    @property
    def is_at_door(self) -> bool:
        """Whether one has just come out of a door, and not walked yet."""
        return bool(self.came) and self.begun is not None and math.dist(self.begun, self.at) < 0.1

    def by(self, locale: str, at: Point, mark: str = "") -> tuple[tuple[str, float, float, str], ...]:
        """Its way with one more place."""
        return (*self.way, (locale, round(at[0], 2), round(at[1], 2), mark))


def best_of(states: Iterable[State], count: int = FEW) -> list[State]:
    """The best of some hypotheses, in an order that does not depend on how they came."""
    return sorted(states, key=lambda one: (-one.odds, one.locale, one.at, one.heading))[:count]


class WordMatcher:
    """Fits descriptions to the features and areas of a map."""

    def __init__(self, plan: WordMap) -> None:
        self._plan = plan
        self._words: dict[tuple[str, str, int], float] = {}

    def fit(self, what: ThingWords, feature: NamedFeature) -> float:
        """How well a feature fits the words of a description."""
        score = MISFIT if what.heads & {"door", "room"} and feature.sort != "door" else 0.0
        for word in what.names:
            if word.meaning in ("open", "closed"):
                score += 0.0 if feature.is_open == (word.meaning == "open") else MISFIT
            else:
                score += self._fit_word(word, feature)
        return max(score, WORST)

    def fit_area(self, what: ThingWords, area: Area) -> float:
        """How well a hall or room fits."""
        score = 0.0
        for word in what.names:
            own = self._fit_word(word, area)
            if own < INSIDE and word.sort != "MOD":
                own = max([own, *(self._fit_word(word, one) + INSIDE for one in area.features if one.sort == "thing")])
            score += own
        return max(score, WORST)

    def _fit_word(self, word: Word, of: NamedFeature | Area) -> float:
        known = (word.sort, word.meaning, id(of))
        if known not in self._words:
            self._words[known] = self._weigh(word, of.meanings, of.colours)
        return self._words[known]

    def _weigh(self, word: Word, meanings: frozenset[str], colours: tuple[tuple[float, float, float], ...]) -> float:
        lexicon, vocabulary = self._plan.lexicon, self._plan.vocabulary
        if word.meaning in meanings or (word.meaning in NEUTRAL and word.meaning not in vocabulary):
            return 0.0
        if word.meaning in lexicon.colours and colours:
            off = min(math.dist(lexicon.colours[word.meaning], colour) for colour in colours)
            return max(MISFIT, -((off / COLOUR_REACH) ** 2))
        if any((word.meaning, meaning) in lexicon.related for meaning in meanings):
            return RELATED + OTHER_KIND * (word.meaning in vocabulary)
        if word.meaning in vocabulary:
            return MISFIT
        return UNKNOWN_MODIFIER if word.sort == "MOD" else UNKNOWN_HEAD


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

    # -- seeing and reaching -------------------------------------------------------------------------------------

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
        ways = self.ways(state) if self.area(state).is_hall else []
        if what.heads & {"wall", "end"} and (not what.names or (what.side == "behind" and "wall" in what.heads)):
            turn = state.heading + TURNS.get(what.side, 0.0)
            return NOT_SEEN if any(is_along(way, turn) for way in ways) else 0.0
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
        least = OPPOSITE_M if self.area(state).is_tile or state.is_at_door else -0.1
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
