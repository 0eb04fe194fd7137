"""Perceptual servoing (§2, Figure 2) as the choice rule, and the ladder that discrepancies climb.

A discrepancy within its level's bound is corrected where it arose. Beyond it, it is passed one level up, action ->
plan -> goal, and measured anew by that level's own means. The highest level with an open discrepancy is in focus; while
there is none, action work comes first, because a move may be under way.

Laws (tests/laws/test_laws_servoing.py): no level is skipped; every escalation exceeds its stated bound; nothing above a
level is in focus while all open discrepancies belong to it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from blackboard.activation import Activation
from blackboard.board import View
from blackboard.level import Level


@dataclass(frozen=True, slots=True)
class Discrepancy:
    """A difference between what was expected and what was perceived.

    Attributes:
        level: where it is to be corrected.
        what: in words.
        magnitude: how large, in ``unit``; None until this level has measured it; infinite if it could not.
        bounds: up to what the action and the plan level may correct it; the goal level has no bound.
        unit: of magnitude and bounds.
        status: open, corrected (success comes back down), or escalated.
    """

    level: Level
    what: str
    magnitude: float | None
    bounds: tuple[float, float]
    unit: str
    status: str = "open"

    def __post_init__(self) -> None:
        if self.magnitude is not None and not self.magnitude >= 0.0:
            raise ValueError(f"expected a magnitude of at least 0 {self.unit}, got {self.magnitude}")

    @property
    def bound(self) -> float:
        """The bound of its own level."""
        return math.inf if self.level is Level.GOAL else self.bounds[self.level]

    @property
    def is_open(self) -> bool:
        return self.status == "open"

    @property
    def exceeds(self) -> bool:
        """Whether its own level has measured it and found that it may not correct it."""
        return self.is_open and self.magnitude is not None and self.magnitude > self.bound

    def corrected(self) -> Discrepancy:
        return replace(self, status="corrected")

    def escalated(self) -> tuple[Discrepancy, Discrepancy]:
        """This one, closed, and the one that stands for it one level up, not yet measured there.

        Raises:
            ValueError: it does not exceed its bound.
        """
        if not self.exceeds:
            raise ValueError(f"expected more than the bound of {self.bound} {self.unit}, got {self.magnitude}")
        return replace(self, status="escalated"), replace(self, level=self.level.above, magnitude=None)


@dataclass(frozen=True, slots=True)
class Servoing:
    """Which levels are switched on, and how the next activation is chosen."""

    off: frozenset[Level] = field(default_factory=frozenset)

    def allows(self, closes: Level | None) -> bool:
        """Whether a knowledge source that closes this loop may be activated."""
        return closes not in self.off

    def focus(self, view: View) -> Level:
        """The highest level with an open discrepancy; action where there is none."""
        levels = (e.value.level for e in view.newest_first(Discrepancy) if e.value.is_open)
        return max(levels, default=Level.ACTION)

    def key(self, activation: Activation, focus: Level) -> tuple[int, float, int]:
        """Sorts first what is nearest to the focus, then the best rated, then the oldest."""
        return abs(activation.source.level - focus), -activation.rating, activation.number

    def choose(self, pending: Iterable[Activation], focus: Level) -> tuple[Activation, ...]:
        """Pending activations, the chosen one first, the runner-up second. Pure."""
        return tuple(sorted(pending, key=lambda a: self.key(a, focus)))
