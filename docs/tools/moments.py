"""The telling moments of a recording: its turning points, spread over the run, with drives between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from logs.reader import Series, read_series
from logs.recording.paths import CHAPTERS, HARVEY

KINDS = ("the end", "fault", "collision", "found", "refuted", "doubt", "in truth", "lost", "resumed", "not testable",
         "goal", "plan", "drives", "verified")
"""What is told first; one of each kind is taken before a second one of any."""

APART = 2
"""Two moments are at least so many cycles apart, or they look alike."""


@dataclass(frozen=True, slots=True)
class Moment:
    """A cycle worth looking at.

    Attributes:
        kind: one of KINDS, or another word of the story.
        text: what happens.
    """

    cycle: int
    kind: str
    text: str


def moments_of(recording: Path, most: int) -> list[Moment]:
    """The most telling moments of a recording, in the order of time. Raises RecordingError where it cannot be read."""
    kinds, texts = (read_series(recording, CHAPTERS, f"TextLog:{what}") for what in ("level", "text"))
    turns = [Moment(cycle, kind, text) for (cycle, kind), (_, text) in zip(kinds, texts, strict=True)]
    return choose([*turns, *_drives(read_series(recording, HARVEY, "StateChange:state"))], most)


def choose(candidates: Sequence[Moment], most: int) -> list[Moment]:
    """As many as wanted, one of each kind before a second one of any; of a kind those that lie farthest apart."""
    found: list[Moment] = []
    while len(found) < most:
        before = len(found)
        for kind in _kinds(candidates):
            far = [m for m in candidates if m.kind == kind and _distance(m, found) >= APART]
            if far and len(found) < most:
                found.append(max(far, key=lambda m: _distance(m, found)))
        if len(found) == before:
            break
    return sorted(found, key=lambda m: m.cycle)


def _kinds(candidates: Sequence[Moment]) -> list[str]:
    """Kinds that are not in the list come last."""
    others = sorted({m.kind for m in candidates}.difference(KINDS))
    return [*KINDS, *others]


def _distance(moment: Moment, found: Sequence[Moment]) -> float:
    return min((abs(moment.cycle - other.cycle) for other in found), default=float("inf"))


def _drives(activities: Series) -> Iterator[Moment]:
    """The middle of each drive; the last activity goes on to the end, where nobody drives."""
    for (begin, activity), (end, _next) in pairwise(activities):
        if activity == "drives":
            yield Moment((begin + end) // 2, activity, "from landmark to landmark, on the way to the next milestone")
