"""Memory of a board over very many cycles."""

from __future__ import annotations

import os
import resource
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from blackboard import Change, Effect, KnowledgeSource, Level, Post, Posted, Revise, Scheduler, View, Watch, inference
from logs.journal_file import JournalFile
from world_models.entries import Discrepancy

DOUBT_EVERY = 20
"""One picture in this many shows something unexpected."""
PIXELS = 256


@inference(keep=2)
@dataclass(frozen=True, slots=True)
class Picture:
    """An observation with enough bytes for a leak to show."""

    number: int
    pixels: bytes


@inference()
@dataclass(frozen=True, slots=True)
class Belief:
    """Follows from all observations; one entry, revised for ever."""

    picture: str
    count: int


class Seer(KnowledgeSource):
    """Takes a picture into the belief and posts the next one; now and then it posts a discrepancy."""

    level = Level.ACTION
    on = (Watch(Picture, (Posted,)),)
    writes = (Belief, Picture, Discrepancy)

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        belief, picture = view.latest(Belief), trigger.entry
        number = picture.value.number + 1
        if belief is None:
            yield Post(Belief(picture.id, 1), (picture,))
        else:
            yield Revise(belief, Belief(picture.id, belief.value.count + 1), (picture,))
        if number % DOUBT_EVERY == 0:
            yield Post(Discrepancy(Level.ACTION, "unexpected", 1.0, (2.0, 3.0), "px"), (picture,))
        yield Post(Picture(number, number.to_bytes(4, "big") * (PIXELS // 4)), (picture,))


class Corrector(KnowledgeSource):
    """Closes a discrepancy."""

    level = Level.ACTION
    on = (Watch(Discrepancy, (Posted,), lambda found: found.is_open),)
    priority = 0.9
    writes = (Discrepancy,)

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        yield Revise(trigger.entry, trigger.entry.value.corrected(), (trigger.entry,))


@dataclass(frozen=True, slots=True)
class Memory:
    """Memory after a tenth of the cycles and after all of them.

    Attributes:
        cycles: number of cycles.
        early_bytes, late_bytes: resident set of the process.
        entries: entries on the board at the end.
        posted: pictures that were posted.
    """

    cycles: int
    early_bytes: int
    late_bytes: int
    entries: int
    posted: int

    @property
    def growth_bytes(self) -> float:
        """Growth per cycle [bytes]."""
        return (self.late_bytes - self.early_bytes) / (self.cycles - self.cycles // 10)


def long_run(cycles: int) -> Memory:
    """Run a number of cycles; the journal goes to the null device."""
    journal = JournalFile(Path(os.devnull))
    scheduler = Scheduler([Seer(), Corrector()], sinks=[journal])
    scheduler.post([Post(Picture(0, bytes(PIXELS)))], "user")
    early_bytes = 0
    while scheduler.cycle < cycles:
        scheduler.step()
        if scheduler.cycle == cycles // 10:
            early_bytes = resident_bytes()
    journal.close()
    newest = scheduler.view.latest(Picture)
    return Memory(
        cycles, early_bytes, resident_bytes(), len(scheduler.view), 0 if newest is None else newest.value.number + 1)


def resident_bytes() -> int:
    """Resident set of this process now; its peak where the system does not say."""
    try:
        return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * resource.getpagesize()
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
