"""Reading a text about a way: the tree of its words, its acts, and where they end on a building, with odds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from lark import Tree

from harvey_words.following.word_follower import WordFollower
from harvey_words.following.word_map import Point, WordMap
from harvey_words.following.word_places import State
from harvey_words.reading.acts import read_acts
from harvey_words.reading.lexicon import OWN_FILE
from harvey_words.reading.told_acts import Act
from harvey_words.reading.word_clauses import read_clauses
from world_models.building.world import World
from world_models.files.world_files import load_world

SURE = 0.55
"""Least odds of an end that is taken without asking."""
NOTHING_FITS = -7.5
"""Log odds that what is described is none of the places that were found, against a reading in which all fits."""
NEAR_M = 2.0
"""An end no further from a place is at it."""
SAME_M = 1.5
"""Ends in a hall no further apart are one."""


class RouteError(ValueError):
    """A place to start from that the world has not, or a text that is none."""


@dataclass(frozen=True)
class RouteEnd:
    """Where a text may lead.

    Attributes:
        locale: the room or hall; door: at or behind which, where the text names one.
        x_m, y_m, heading_rad: pose [world].
        odds: of this end, 0 to 1, against all others and against none of them.
        way: the places on the way (locale, x, y), each with the name of what the words named there, or "".
    """

    locale: str
    door: str
    x_m: float
    y_m: float
    heading_rad: float
    odds: float
    way: tuple[tuple[str, float, float, str], ...]

    def is_at(self, place: str) -> bool:
        """Whether it is a locale, a door, or no further than ``NEAR_M`` from x,y."""
        point = _read_point(place)
        return place in (self.locale, self.door) or (
            point is not None and math.dist(point, (self.x_m, self.y_m)) <= NEAR_M)

    def as_data(self) -> dict[str, Any]:
        """For JSON."""
        return {"locale": self.locale, "door": self.door or None, "place": [round(self.x_m, 2), round(self.y_m, 2)],
                "heading_deg": round(math.degrees(self.heading_rad), 1), "odds": round(self.odds, 4)}


@dataclass(frozen=True, eq=False)
class Reading:
    """What was read.

    Attributes:
        tree: of the text, as the grammar has it; acts: what it asks to do and to see.
        ends: where it may lead, best first; unused: phrases that fitted nothing in the best reading.
        is_goal_there: whether the thing that is named last is at the best end.
    """

    text: str
    tree: Tree[Any]
    acts: tuple[Act, ...]
    ends: tuple[RouteEnd, ...]
    unused: tuple[str, ...] = ()
    is_goal_there: bool = False

    @property
    def end(self) -> RouteEnd | None:
        """The best end; None where the text tells no way at all."""
        return self.ends[0] if self.ends else None

    @property
    def is_understood(self) -> bool:
        """Whether the best end is sure enough to go there without asking."""
        return bool(self.acts) and self.end is not None and self.end.odds >= SURE and self.is_goal_there

    def as_data(self) -> dict[str, Any]:
        """For JSON: the same text on the same world gives the same, byte for byte."""
        return {
            "understood": self.is_understood, "end": self.end.as_data() if self.end else None,
            "rivals": [end.as_data() for end in self.ends[1:6]],
            "way": [list(place) for place in self.end.way] if self.end else [],
            "acts": [{"act": act.sort, "text": act.text, **({"way": act.way} if act.way else {})} for act in self.acts],
            "unused": list(self.unused), "tree": _tree_data(self.tree)}


def _tree_data(node: Any) -> Any:
    if isinstance(node, Tree):
        return [str(node.data), *(_tree_data(child) for child in node.children)]
    return f"{node.value.sort}:{node.value.meaning}"


def read_route(text: str, world: World | str | PathLike[str] | WordMap, start: str | Sequence[float],
               heading_deg: float | None = None, language: str | Path = OWN_FILE) -> Reading:
    """Read a text about a way.

    Args:
        text: in the words of a person.
        world: the model of the building, its file, or a map that was made of it.
        start: a locale, a door or a thing by name, or x and y [m, world].
        heading_deg: which way the body faces, counter-clockwise from the world's x; None: every way is possible.
        language: the file of its lexicon, where the map does not bring one.

    Raises:
        RouteError: the world has no such start.
        LexiconError: the lexicon cannot be used.
        WorldError: the file cannot be read.
    """
    plan = world if isinstance(world, WordMap) else WordMap(
        world if isinstance(world, World) else load_world(world), language)
    begin = _begin(plan, start, heading_deg)
    tree, clauses = read_clauses(plan.lexicon.read(text))
    acts = read_acts(clauses)
    follower = WordFollower(plan)
    states = follower.follow(begin, acts) if acts else []
    ends = _weigh_ends(states)
    misfits = states[0].misfits if states else ()
    unused = tuple(acts[number].text for number in misfits if number < len(acts))
    return Reading(text, tree, tuple(acts), ends, unused, bool(states) and follower.is_goal_there(states[0], acts[-1]))


def _begin(plan: WordMap, start: str | Sequence[float], heading_deg: float | None) -> list[State]:
    locale, at = find_start(plan, start)
    if heading_deg is not None:
        return [State(locale, at, math.remainder(math.radians(heading_deg), math.tau))]
    axis = plan.areas[locale].axis
    turns = (0.0, math.pi / 2, math.pi, -math.pi / 2)
    return [State(locale, at, math.remainder(axis + turn, math.tau)) for turn in turns]


def find_start(plan: WordMap, start: str | Sequence[float]) -> tuple[str, Point]:
    """The locale and the place that a start names. Raises RouteError."""
    if isinstance(start, str) and start in plan.areas:
        return start, plan.areas[start].middle
    point = _read_point(start) if isinstance(start, str) else (float(start[0]), float(start[1]))
    if point is not None:
        locale = plan.world.locale_at(point)
        if locale in plan.areas:
            return str(locale), point
    for area in plan.areas.values():
        for feature in area.features:
            if start in (feature.name, feature.name.rpartition("/")[2]):
                return area.name, feature.at
    raise RouteError(f"expected a start that is a room, hall, door or thing of {plan.world.name}, or x,y in one,"
                     f" got {start!r}")


def _read_point(text: str) -> Point | None:
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        return None
    return x, y


def _weigh_ends(states: Sequence[State]) -> tuple[RouteEnd, ...]:
    """The ends of the hypotheses, those at one place together."""
    groups: list[list[State]] = []
    for state in states:
        same = next((group for group in groups if _is_same(group[0], state)), None)
        if same is None:
            groups.append([state])
        else:
            same.append(state)
    weights = [max(math.exp(state.odds) for state in group) for group in groups]
    total = sum(weights) + math.exp(NOTHING_FITS)
    return tuple(sorted((
        RouteEnd(group[0].locale, group[0].door, group[0].at[0], group[0].at[1], group[0].heading, weight / total,
            group[0].way) for group, weight in zip(groups, weights, strict=True)),
        key=lambda end: (-end.odds, end.locale, end.x_m, end.y_m)))


def _is_same(one: State, other: State) -> bool:
    if one.door or other.door:
        return one.door == other.door
    return one.locale == other.locale and math.dist(one.at, other.at) < SAME_M
