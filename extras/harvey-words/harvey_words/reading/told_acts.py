"""What a text describes, and what it asks to do and to see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from harvey_words.reading.lexicon import Word

COMPASS = ("north", "south", "east", "west")
DOORS = frozenset(("door", "room"))
ROOMS = frozenset(("office", "laboratory", "toilet", "kitchen", "closet", "stairs", "elevator", "conference", "mail",
                   "emergency-exit"))
STRETCHES = frozenset(("hall", "turning"))
POINTS = frozenset(("end", "crossing", "corner"))


@dataclass(frozen=True)
class ThingWords:
    """A thing, door, room, hall, crossing or end as a text describes it.

    Attributes:
        heads: ``door``, ``room``, ``hall``, ``crossing``, ``corner``, ``end``, ``wall``, ``unit``, ... that are named.
        names: all other words, with what they mean.
        count: ``1`` to ``9``, ``last``, ``only``, ``other``, ``same``, or nothing.
        side: where it is said to be.
        relations: by what it is told apart, as (``past``, another description).
        text: its words as they stand; place: number of the first of them in the text.
    """

    heads: frozenset[str] = frozenset()
    names: tuple[Word, ...] = ()
    count: str = ""
    side: str = ""
    relations: tuple[tuple[str, ThingWords], ...] = ()
    text: str = ""
    place: int = field(default=0, compare=False)

    @property
    def is_door(self) -> bool:
        """Whether it may be a door or what lies behind one."""
        return bool(self.heads & DOORS) or any(word.meaning in ROOMS for word in self.names) or (
            not self.heads and any(word.sort == "NAME" for word in self.names))

    @property
    def number(self) -> int:
        """Its place in a row; 0 where it has none."""
        return int(self.count) if self.count.isdigit() else 0

    @property
    def is_stretch(self) -> bool:
        """Whether it is a hall, or known by its floor."""
        return bool(self.heads & STRETCHES and not self.heads & POINTS) or (
            not self.heads and bool(self.names) and all(word.sort == "MOD" for word in self.names))


def describe(words: Sequence[Word], side: str = "") -> ThingWords:
    """What a row of words describes."""
    heads = frozenset(word.meaning for word in words if word.sort == "HEAD")
    heads |= {"end"} if "dead-end" in heads else set()
    counts = [word.meaning for word in words if word.sort == "COUNT"]
    names = tuple(word for word in words if word.sort not in ("HEAD", "COUNT") and word.meaning != "&")
    return ThingWords(heads, names, counts[0] if counts else "", side, (), " ".join(word.text for word in words),
                      words[0].place if words else 0)


@dataclass(frozen=True)
class Act:
    """One thing to do or to see.

    Attributes:
        sort: ``exit``, ``turn``, ``go``, ``find`` (the goal, or a door to go in at), ``see``, ``orient``,
            ``note`` (that is passed somewhere on the walk), ``halt``.
        way: left, right, back, or a point of the compass, of a turn.
        what: that is found, seen, faced or left.
        until: where a walk or a turn ends; past: what is passed before; along: the hall that is taken.
        units: crossings to go; metres: length to go.
        enters: whether a door is said to be gone in at.
        text: its clause.
    """

    sort: str
    way: str = ""
    what: ThingWords | None = None
    until: ThingWords | None = None
    past: tuple[ThingWords, ...] = ()
    along: ThingWords | None = None
    units: int = 0
    metres: float = 0.0
    enters: bool = False
    text: str = ""
