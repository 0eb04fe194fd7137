"""What the recorder knows of the board, rebuilt from the changes alone, as any later reader must; one cycle of it; and
the belief that is acted on, placed in the world once for all who draw it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from blackboard.change import Change, Retracted
from blackboard.entry import Entry
from blackboard.journal import Decision
from blackboard.kinds import always
from world_models.building.geometry.faces import Face
from world_models.building.world import World
from world_models.entries.location import Hypothesis, Place
from world_models.frames import Pose2

T = TypeVar("T")

KEPT = 64
"""So many entries of a type are remembered, the newest ones: nothing older is drawn, and a long run does not grow."""


class Mirror:
    """The current revision of the newest entries, as far as the changes tell."""

    def __init__(self, kept: int = KEPT) -> None:
        self._kept = kept
        self._by_type: dict[type[Any], dict[str, Entry[Any]]] = {}
        self._by_id: dict[str, Entry[Any]] = {}
        self._answers: dict[Callable[[Mirror], Any], Any] = {}

    def take(self, change: Change) -> None:
        """Follow one change."""
        self._answers.clear()
        entry = change.entry
        same = self._by_type.setdefault(type(entry.value), {})
        if isinstance(change, Retracted):
            same.pop(entry.id, None)
            self._by_id.pop(entry.id, None)
        else:
            same[entry.id] = self._by_id[entry.id] = entry
            if len(same) > self._kept:
                oldest = next(iter(same))
                del same[oldest], self._by_id[oldest]

    def ask(self, question: Callable[[Mirror], T]) -> T:
        """The answer to a question about the board; until something changes it is worked out once."""
        if question not in self._answers:
            self._answers[question] = question(self)
        answer: T = self._answers[question]
        return answer

    def get(self, id: str) -> Entry[Any] | None:
        """The current revision of an entry, or None."""
        return self._by_id.get(id)

    def all(self, kind: type[T]) -> tuple[Entry[T], ...]:
        """Current entries of a type, oldest first."""
        return tuple(self._by_type.get(kind, {}).values())

    def latest(self, kind: type[T], where: Callable[[T], bool] = always) -> Entry[T] | None:
        """The newest posting of a type that satisfies a predicate, or None."""
        newest_first = reversed(self._by_type.get(kind, {}).values())
        return next((entry for entry in newest_first if where(entry.value)), None)


@dataclass(frozen=True, slots=True)
class Difference:
    """How a building truly differs from its model: faces that are there besides, and faces that are not."""

    added: tuple[Face, ...] = ()
    gone: tuple[Face, ...] = ()


@dataclass(frozen=True, slots=True)
class Moment:
    """One cycle as the loggers see it.

    Attributes:
        decision: what was decided.
        mirror: the board after it.
        truth: where the robot truly was since the last cycle, oldest first; empty where nobody knows.
        contacts: where it truly touched something since then.
        differences: how the building truly differed from its model since then; empty where that did not change.
    """

    decision: Decision
    mirror: Mirror
    truth: tuple[Pose2, ...] = ()
    contacts: tuple[Place, ...] = ()
    differences: tuple[Difference, ...] = ()
    _changes: tuple[Change, ...] = field(init=False)
    _kinds: frozenset[type[Any]] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_changes", (*self.decision.observed, *self.decision.made))
        object.__setattr__(self, "_kinds", frozenset(type(change.entry.value) for change in self._changes))

    @property
    def changes(self) -> tuple[Change, ...]:
        """What was observed before the decision, then what it made."""
        return self._changes

    def changed(self, kind: type[T]) -> tuple[Entry[T], ...]:
        """Entries of a type that were posted or revised."""
        if kind not in self._kinds:
            return ()
        return tuple(c.entry for c in self._changes if isinstance(c.entry.value, kind) and not isinstance(c, Retracted))

    def touched(self, *kinds: type[Any]) -> bool:
        """Whether any entry of these types changed or went."""
        return not self._kinds.isdisjoint(kinds)


@dataclass(frozen=True, slots=True)
class Held:
    """The held hypothesis.

    Attributes:
        value: as it stands on the board.
        world_from_robot: its pose in the world frame.
        sigma_m: the largest standard deviation of the place; sigma_rad: that of the heading.
    """

    value: Hypothesis
    world_from_robot: Pose2
    sigma_m: float
    sigma_rad: float


class Belief:
    """Gives the held hypothesis, and remembers the last one."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._last: Held | None = None

    def now(self, mirror: Mirror) -> Held | None:
        """The belief as of now; None where there is none, as when it is lost."""
        value = find_belief(mirror)
        if value is None:
            return None
        if self._last is None or self._last.value is not value:
            self._last = Held(value, value.world_from_robot(self._world), sigma_m(value), value.sigma_rad)
        return self._last


def find_belief(mirror: Mirror) -> Hypothesis | None:
    """The hypothesis that is acted on."""
    entry = mirror.latest(Hypothesis, is_held)
    return entry.value if entry else None


def sigma_m(value: Hypothesis) -> float:
    """Its largest standard deviation of the place: the larger eigenvalue of a 2 x 2 matrix, in closed form [m]."""
    (a, b, _), (_, d, _), _ = value.covariance
    return math.sqrt(max(0.0, (a + d) / 2 + math.hypot((a - d) / 2, b)))


def is_held(value: Hypothesis) -> bool:
    """Whether a hypothesis is the one that is acted on."""
    return value.is_held
