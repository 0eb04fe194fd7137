"""History: every revision of every entry of a run, and the decision that made it."""

from __future__ import annotations

import difflib
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence

from harvey.errors import BadInput
from harvey.run_files.records import Candidate, DecisionRecord, EntryRecord


class History(ABC):
    """What a run's journal tells, asked for by name.

    Two kinds give the same answers: :class:`MemoryHistory`, from decisions in memory, and
    :class:`harvey.why.journal.JournalHistory`, which reads of a long journal only the lines that are needed.
    """

    @property
    def source(self) -> str:
        """Where it is read from."""
        return "the journal"

    @property
    @abstractmethod
    def newest(self) -> Mapping[str, str]:
        """Id of each entry -> ref of its last revision; in the order in which the entries came about."""

    @property
    @abstractmethod
    def refs(self) -> Sequence[str]:
        """Every revision, in the order in which they came about."""

    @property
    @abstractmethod
    def cycles(self) -> Sequence[int]:
        """Of the decisions, in their order."""

    @abstractmethod
    def entry(self, ref: str) -> EntryRecord | None:
        """What the journal says of a revision; None where it says nothing."""

    @abstractmethod
    def retraction(self, ref: str) -> EntryRecord | None:
        """How a revision was retracted; None where it was not."""

    @abstractmethod
    def cycle_of(self, cycle: int) -> DecisionRecord | None:
        """The decision of a cycle; None where the run has no such cycle."""

    @abstractmethod
    def naming(self, ref: str) -> Iterator[DecisionRecord]:
        """The decisions that name a revision anywhere, in their order; some that do not may be among them."""

    @abstractmethod
    def verify(self) -> None:
        """Read every line. Raises BadInput for the first that is no decision."""

    def of_kind(self, *kinds: str, until: int | None = None) -> Iterator[EntryRecord]:
        """All revisions of some kinds, up to a cycle, in the order in which they came about."""
        heads = tuple(f"{kind}-" for kind in kinds)
        for ref in self.refs:
            record = self.entry(ref) if ref.startswith(heads) else None
            if record is not None and (until is None or record.cycle <= until):
                yield record

    def decision(self, cycle: int) -> DecisionRecord:
        """Raises BadInput where the run has no such cycle."""
        found = self.cycle_of(cycle)
        if found is None:
            have = f"cycles {min(self.cycles)} to {max(self.cycles)}" if self.cycles else "none"
            raise BadInput(f"--at: expected a cycle of the run, which has {have}, got {cycle}")
        return found

    def decisions(self) -> Iterator[DecisionRecord]:
        """All of them, in their order."""
        return (self.decision(cycle) for cycle in self.cycles)

    def candidates(self, cycle: int) -> tuple[Candidate, ...]:
        """Among whom a cycle chose: what was pending or new, and not dropped; the chosen first, then the best rated.

        Raises:
            BadInput: the run has no such cycle.
        """
        decision = self.decision(cycle)
        wanted = decision.pending + (decision.chosen is not None and decision.asks is None)
        gone: set[int] = set()
        found: dict[int, Candidate] = {}
        for one in reversed(self.cycles[: bisect_right(self.cycles, cycle)]):
            past = self.decision(one)
            gone.update(c.number for c in past.obviated)
            if past.chosen is not None and past.asks is None and one != cycle:
                gone.add(past.chosen.number)
            found.update((c.number, c) for c in past.activated if c.number not in gone)
            if len(found) >= wanted:
                break
        first = decision.chosen.number if decision.chosen else None
        return tuple(sorted(found.values(), key=lambda c: (c.number != first, -c.rating, c.number)))

    def written_by(self, cycle: int) -> tuple[EntryRecord, ...]:
        """The entries that a cycle wrote."""
        found = self.cycle_of(cycle)
        return () if found is None else found.made

    def outcome(self) -> str:
        """Ref of how the mission ended, or, where it did not come to that, of the last entry.

        Raises:
            BadInput: the journal is empty.
        """
        if not self.newest:
            self.verify()
            raise BadInput(f"{self.source}: expected at least one entry, got none")
        outcomes = [id for id in self.newest if id.startswith("Outcome-")]
        return self.newest[outcomes[-1]] if outcomes else self.refs[-1]

    @property
    def cut_off(self) -> int | None:
        """The last cycle of a run of which nothing says how it ended; None where it ended, or never began."""
        ended = any(id.startswith("Outcome-") for id in self.newest)
        return None if ended or not self.cycles else self.cycles[-1]

    def resolve(self, text: str) -> str:
        """The ref that a user means: ``MotorCommand-12.3``, or ``MotorCommand-12`` for its last revision.

        Raises:
            BadInput: the run has no such entry; near ones are named.
        """
        found = self.find(text)
        if found is not None:
            return found
        self.verify()
        raise BadInput(f"expected an entry of the run, as {', '.join(self.near(text)) or 'none'}, got {text!r}")

    def find(self, text: str) -> str | None:
        """As :meth:`resolve`; None where the run has no such entry."""
        low = text.lower()
        for names in (self.newest, self.refs):
            for name in names:
                if name.lower() == low:
                    return self.newest.get(name, name)
        return None

    def near(self, text: str) -> list[str]:
        """Names like one that is not there: of the same kind with near numbers, else of a kind that is spelt alike."""
        kinds = {id.rpartition("-")[0].lower(): id.rpartition("-")[0] for id in self.newest}
        kind, _, rest = text.rpartition("-")
        alike = difflib.get_close_matches((kind or text).lower(), sorted(kinds), n=2, cutoff=0.6)
        if not alike:
            ids = list(self.newest)
            return [ids[0], ids[-1]] if ids else []
        wanted = int(rest.partition(".")[0]) if rest.partition(".")[0].isdecimal() else 1
        near: list[str] = []
        for name in alike:
            numbers = sorted(_numbers(self.newest, kinds[name]), key=lambda n: (abs(n - wanted), n))
            near += [f"{kinds[name]}-{n}" for n in numbers[:2]]
        return near


def _numbers(ids: Iterable[str], kind: str) -> Iterator[int]:
    for id in ids:
        head, _, number = id.rpartition("-")
        if head == kind and number.isdecimal():
            yield int(number)


class MemoryHistory(History):
    """A history of decisions that are in memory."""

    def __init__(self, decisions: Iterable[DecisionRecord]) -> None:
        """Raises BadInput where a line of the journal that they are read from is malformed."""
        self._decisions: dict[int, DecisionRecord] = {}
        self._entries: dict[str, EntryRecord] = {}
        self._retracted: dict[str, EntryRecord] = {}
        self._newest: dict[str, str] = {}
        for decision in decisions:
            self._decisions[decision.cycle] = decision
            for record in (*decision.observed, *decision.made):
                if record.change == "Retracted":
                    self._retracted[record.ref] = record
                else:
                    self._entries[record.ref] = record
                    self._newest[record.id] = record.ref

    @property
    def newest(self) -> Mapping[str, str]:
        return self._newest

    @property
    def refs(self) -> Sequence[str]:
        return tuple(self._entries)

    @property
    def cycles(self) -> Sequence[int]:
        return tuple(self._decisions)

    def entry(self, ref: str) -> EntryRecord | None:
        return self._entries.get(ref)

    def retraction(self, ref: str) -> EntryRecord | None:
        return self._retracted.get(ref)

    def cycle_of(self, cycle: int) -> DecisionRecord | None:
        return self._decisions.get(cycle)

    def naming(self, ref: str) -> Iterator[DecisionRecord]:
        return iter(self._decisions.values())

    def verify(self) -> None:
        """They were read already."""
