"""Perceptual servoing (§2, Figure 2): the ladder that discrepancies climb, and what of it is open.

A discrepancy within its level's bound is corrected where it arose. Beyond it, it is passed one level up, action ->
plan -> goal, and measured again by that level's means. The highest level with an open discrepancy is in focus; while
there is none, action work comes first, because a move may be under way.

Laws (tests/laws/board/test_laws_servoing.py): no level is skipped; every escalation exceeds its stated bound; nothing
above a level is in focus while all open discrepancies belong to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

from blackboard import Entry, Index, Ladder, Level, Post, Revise, View, highest, inference

DiscrepancyStatus = Literal["open", "corrected", "escalated"]


def is_closed(discrepancy: Discrepancy) -> bool:
    return not discrepancy.is_open


def is_last_of_its_level(view: View, discrepancy: Entry[Discrepancy]) -> bool:
    """Whether it is the last that its level escalated: by it is counted how often the level does."""
    last = last_escalated(view, discrepancy.value.level)
    return last is not None and last.id == discrepancy.id


@inference(keep=2, when=is_closed, unless=is_last_of_its_level)
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
        tried: where it was escalated: what was being tried when it was.
        times: and how often one was escalated from this level while that was tried, this one included.
    """

    level: Level
    what: str
    magnitude: float | None
    bounds: tuple[float, float]
    unit: str
    status: DiscrepancyStatus = "open"
    tried: str = ""
    times: int = 0

    def __post_init__(self) -> None:
        if self.magnitude is not None and not self.magnitude >= 0.0:
            raise ValueError(f"expected a magnitude of at least 0 {self.unit}, got {self.magnitude}")

    @property
    def bound(self) -> float:
        """The bound of its own level."""
        levels = type(self.level)
        return math.inf if self.level is highest(levels) else self.bounds[self.level - min(levels)]

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
        """This one, closed, and its counterpart one level up, not yet measured there.

        Raises:
            ValueError: it does not exceed its bound.
        """
        if not self.exceeds:
            raise ValueError(f"expected more than the bound of {self.bound} {self.unit}, got {self.magnitude}")
        above = type(self.level)(self.level + 1)
        return replace(self, status="escalated"), replace(self, level=above, magnitude=None)

    def sentence(self) -> str:
        if self.magnitude is None:
            size = "not yet measured there"
        else:
            size = f"{self.magnitude:.2f} {self.unit}" if math.isfinite(self.magnitude) else "too large to be measured"
        head = "" if self.is_open else f"{self.status}: "
        bound = "" if self.bound == math.inf else f", where up to {self.bound:.2f} {self.unit} may be corrected"
        return f"{head}{self.what}: {size}; discrepancy at the {self.level} level{bound}; {self.status}"


def open_or_measure(view: View, found: Discrepancy, because: tuple[Any, ...]) -> Post | Revise:
    """Opens a discrepancy at its level; where one is open there, that is measured again."""
    last = view.newest(OPEN, found.level)
    return Post(found, because) if last is None else Revise(last, found, because)


def correct(view: View, level: Level, because: tuple[Any, ...]) -> tuple[Revise, ...]:
    """Says that what is open at a level is corrected; nothing where nothing is."""
    found = view.newest(OPEN, level)
    return () if found is None else (Revise(found, found.value.corrected(), because),)


def last_escalated(view: View, level: Level) -> Entry[Discrepancy] | None:
    """The last discrepancy that a level passed up."""
    return view.latest(Discrepancy, lambda found: found.level is level and found.status == "escalated")


OPEN: Index[Discrepancy] = Index(Discrepancy, lambda found: found.level if found.is_open else None, "open")
"""Open discrepancies by their level."""

LADDER = Ladder(Level, OPEN)
"""The three levels, all of them on."""
