"""Replay: a recorded run decided again from its observations.

A run is what it observed and nothing else: whatever came from outside is put on the board where the journal says it
came, and every decision must come out as it stands in the journal, to the byte. So a replay needs neither simulator nor
robot; and a run that was cut off gets its board, its agenda and all that is pending back by being replayed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from blackboard import Change, Decision, Scheduler, decision_line
from harvey.errors import BadInput
from logs.pictures import open_pictures
from logs.records import DecisionRecord, EntryRecord, Originals, effect_of
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from world_models.frame_store import FrameStore

Live = Callable[[Sequence[Change], Sequence[EntryRecord[Any]]], None]
"""Hears of the changes that a decision made and of what was observed next."""


def ignore(_made: Sequence[Change], _observed: Sequence[EntryRecord[Any]]) -> None:
    """No body lives through the replay."""


@dataclass(frozen=True, slots=True)
class ReplayedDecision:
    """A decision as recorded, and as it is decided now; None where nothing is left to decide.

    Attributes:
        line: as it stands in the journal, without its newline.
    """

    recorded: DecisionRecord
    line: bytes
    now: Decision | None

    @property
    def same(self) -> bool:
        """To the byte."""
        return self.now is not None and decision_line(self.now).encode() == self.line


def replay(
    run: RunDirectory, originals: Originals, scheduler: Scheduler, *,
    live: Live = ignore, before: Callable[[], None] = lambda: None,
) -> Iterator[ReplayedDecision]:
    """Each decision with its record.

    Args:
        live: lets a simulated body do the same again.
        before: called before each decision.

    Raises:
        BadInput: the journal cannot be read, or an observation cannot be decoded.
    """
    made: Sequence[Change] = ()
    history = Timeline(run.journal)
    for recorded in history.decisions():
        live(made, recorded.observed)
        for observation in recorded.observed:
            scheduler.post([effect_of(observation, originals, scheduler.view, scheduler.kinds)], observation.author)
        before()
        decision = scheduler.step()
        made = () if decision is None else decision.made
        yield ReplayedDecision(recorded, history.line(recorded.cycle), decision)


def check_same(run: RunDirectory, decision: ReplayedDecision) -> ReplayedDecision:
    """The same; raises BadInput where it was not decided as it was."""
    if not decision.same:
        raise BadInput(f"{run.journal}: cycle {decision.recorded.cycle} is not decided again as it was (harvey replay "
                       f"{run.path} tells how); it takes the program that made the run")
    return decision


def open_originals(run: RunDirectory, store: FrameStore) -> Originals:
    """What the journal of a run names only by reference. Raises BadInput and RecordingError as for its pictures."""
    return Originals(open_pictures(run), store)
