"""What a logger is given of each cycle: the decision, the board after it, the belief placed in the world, the truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

from blackboard.change import Change, Retracted
from blackboard.entry import Entry
from blackboard.journal import Decision
from logs.mirror import Mirror
from world_models.building.geometry.faces import Face
from world_models.entries.location import Hypothesis, Place
from world_models.frames import Pose2

T = TypeVar("T")

@dataclass(frozen=True, slots=True)
class Difference:
    """How a building truly differs from its model: faces that are there besides, and faces that are not."""

    added: tuple[Face, ...] = ()
    gone: tuple[Face, ...] = ()


@dataclass(frozen=True, slots=True)
class Held:
    """The hypothesis that is acted on, as it stands on the board, and its pose in the world frame."""

    value: Hypothesis
    world_from_robot: Pose2

    @property
    def sigma_m(self) -> float:
        """The largest standard deviation of the place, in closed form, as it is drawn so often [m]."""
        (a, b, _), (_, d, _), _ = self.value.covariance
        return math.sqrt(max(0.0, (a + d) / 2 + math.hypot((a - d) / 2, b)))


@dataclass(frozen=True)
class Moment:
    """One cycle as the loggers see it.

    Attributes:
        decision: what was decided.
        mirror: the board after it.
        held: the belief that is acted on then; None where there is none, as when the robot is lost.
        truth: where the robot truly is; None where nobody knows.
        contacts: where it truly touched something since the last cycle.
        differences: how the building truly differed from its model since then; empty where that did not change.
    """

    decision: Decision
    mirror: Mirror
    held: Held | None = None
    truth: Pose2 | None = None
    contacts: Sequence[Place] = ()
    differences: Sequence[Difference] = ()

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """What was observed before the decision, then what it made."""
        return (*self.decision.observed, *self.decision.made)

    @cached_property
    def _kinds(self) -> frozenset[type[Any]]:
        return frozenset(type(change.entry.value) for change in self.changes)

    @property
    def off(self) -> Pose2 | None:
        """The belief as seen from the truth, in the true robot's own frame; None where one of them is not known."""
        return self.truth.inverse() @ self.held.world_from_robot if self.truth and self.held else None

    def changed(self, kind: type[T]) -> tuple[Entry[T], ...]:
        """Entries of a type that were posted or revised."""
        if kind not in self._kinds:
            return ()
        return tuple(c.entry for c in self.changes if isinstance(c.entry.value, kind) and not isinstance(c, Retracted))

    def touched(self, *kinds: type[Any]) -> bool:
        """Whether any entry of these types changed or went."""
        return not self._kinds.isdisjoint(kinds)
