"""Timeline: a recorded run asked by name: every revision of every entry, the decision that made it, what it rests on;
and, of a run that goes on, a mirror of its board.

Where each entry stands in the journal is found in one sweep over its bytes, and only the lines that are needed are
read. No index is kept with the journal: the sweep over an hour's journal takes a tenth of a second, and what a line
says is believed only once the line has been read as a decision.
"""

from __future__ import annotations

import difflib
import json
import math
import re
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, cast

from blackboard import Blackboard, Change, Entry, Retracted, View
from logs.disk import MOST_JOURNAL_BYTES
from logs.records import Candidate, DecisionRecord, EntryRecord, decision_at, is_a
from logs.run_directory import check_version
from logs.run_errors import BadInput
from world_models.building.locale_frame import FrameReference, LocaleFrame
from world_models.entries import Hypothesis, Outcome, Tracks
from world_models.files.regular_files import read_regular

K = TypeVar("K")
CYCLE = re.compile(rb'\{"cycle": ?(\d{1,15}),')
"""How a line begins; a line that begins otherwise is read in full."""
CHANGE = re.compile(rb'\{"change": ?"(\w+)", ?"entry": ?"([^"\\]+)"')
"""How a change begins. Inside a text every quotation mark has a backslash before it, so no text looks like it."""
FAR, REVISIONS, TIMED_WITHIN = 3000, 2000, 100
"""So many entries are looked at for the nearest of a kind, so many revisions of a belief for where it began, so many
decisions for a time."""
YAW_CALIBRATOR = "yaw_calibrator"
"""It turns a belief after a milestone, and tells nothing of where that is from."""


class Timeline:
    """A run by its ``journal.jsonl``. A last line that was cut off in the middle of writing is left out."""

    def __init__(self, path: Path) -> None:
        """Raises BadInput where the file cannot be read, or is of another version."""
        check_version(path.parent)
        try:
            self._data = read_regular(path, MOST_JOURNAL_BYTES)
        except OSError as error:
            raise BadInput(f"{path}: expected a readable journal, got: {error.strerror}") from None
        self._path = path
        self._ends = [match.start() for match in re.finditer(rb"\n", self._data)]
        self._read: dict[int, DecisionRecord] = {}
        self._entries, self._retracted = dict[bytes, int](), dict[bytes, int]()
        self._sweep()

    @property
    def source(self) -> str:
        """Where it is read from."""
        return str(self._path)

    @property
    def whole_bytes(self) -> int:
        """Length of the journal up to the end of its last whole line."""
        return self._ends[-1] + 1 if self._ends else 0

    @cached_property
    def newest(self) -> Mapping[str, str]:
        """Id of each entry -> ref of its last revision; in the order in which the entries came about."""
        return {ref.rpartition(".")[0]: ref for ref in self.refs}

    @cached_property
    def refs(self) -> Sequence[str]:
        """Every revision, in the order in which they came about."""
        return tuple(ref.decode(errors="replace") for ref in self._entries)

    @cached_property
    def cycles(self) -> Sequence[int]:
        """Of the decisions, in their order: each cycle has its line."""
        return tuple(range(1, len(self._ends) + 1))

    def entry(self, ref: str) -> EntryRecord[Any] | None:
        """What the journal says of a revision; None where it says nothing."""
        return self._find(ref, self._entries, retracted=False)

    def cycle_of_ref(self, ref: str) -> int:
        """In which cycle a revision came about; 0 where the journal says nothing of it."""
        record = self.entry(ref)
        return 0 if record is None else record.cycle

    def retraction(self, ref: str) -> EntryRecord[Any] | None:
        """How a revision was retracted; None where it was not."""
        return self._find(ref, self._retracted, retracted=True)

    def cycle_of(self, cycle: int) -> DecisionRecord | None:
        """The decision of a cycle; None where the run has no such cycle."""
        return self._decision(cycle - 1) if 0 < cycle <= len(self._ends) else None

    def naming(self, ref: str) -> Iterator[DecisionRecord]:
        """The decisions that name a revision anywhere, in their order; some that do not may be among them."""
        name, at, after = json.dumps(ref).encode(), 0, -1
        while (at := self._data.find(name, at)) >= 0:
            line = self._line_at(at)
            at += len(name)
            if after < line < len(self._ends):
                after = line
                yield self._decision(line)

    def verify(self) -> None:
        """Read every line. Raises BadInput for the first that is no decision."""
        for _ in self.decisions():
            pass

    def expect_decisions(self) -> None:
        """Raises BadInput where the journal has no decision."""
        if not self.cycles:
            self.verify()
            raise BadInput(f"{self.source}: expected at least one decision, got none")

    def of_kind(self, *kinds: type[K], until: int | None = None) -> Iterator[EntryRecord[K]]:
        """All revisions of some kinds, up to a cycle, in the order in which they came about."""
        heads = tuple(f"{kind.__name__}-" for kind in kinds)
        for ref in self.refs:
            record = self.entry(ref) if ref.startswith(heads) else None
            if record is not None and (until is None or record.cycle <= until):
                yield record

    def frames(self, until: int | None = None) -> Iterator[EntryRecord[FrameReference]]:
        """All revisions of locale frames, each by what the journal keeps of it."""
        return cast(Iterator[EntryRecord[FrameReference]], self.of_kind(LocaleFrame, until=until))

    def last(self, kind: type[K]) -> EntryRecord[K] | None:
        """The last revision of the newest entry of a kind; None where there is none."""
        return next(iter([*self.last_of_kind(kind)][-1:]), None)

    def last_of_kind(self, kind: type[K]) -> Iterator[EntryRecord[K]]:
        """The last revision of each entry of a kind, in the order in which the entries came about."""
        return (record for id in self.ids_of(kind) if (record := self.entry(self.newest[id])) is not None)

    def ids_of(self, kind: type[Any]) -> list[str]:
        """Of the entries of a kind, in the order in which they came about."""
        return [id for id in self.newest if id.startswith(f"{kind.__name__}-")]

    def decision(self, cycle: int) -> DecisionRecord:
        """Raises BadInput where the run has no such cycle."""
        if (found := self.cycle_of(cycle)) is not None:
            return found
        have = f"cycles {min(self.cycles)} to {max(self.cycles)}" if self.cycles else "none"
        raise BadInput(f"--at: expected a cycle of the run, which has {have}, got {cycle}")

    def decisions(self) -> Iterator[DecisionRecord]:
        """All of them, in their order; none is kept. Raises BadInput where a line is no decision."""
        return (self._read.get(line) or self._parse(line) for line in range(len(self._ends)))

    def line(self, cycle: int) -> bytes:
        """A decision as it stands in the journal, without its newline."""
        return self._data[self._ends[cycle - 2] + 1 if cycle > 1 else 0 : self._ends[cycle - 1]]

    def candidates(self, cycle: int) -> tuple[Candidate, ...]:
        """Among whom a cycle chose: what was pending or new, and not dropped; the chosen first, then the best
        rated, then the oldest.

        Raises BadInput where the run has no such cycle.
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

    def time_at(self, cycle: int) -> float | None:
        """The newest time of any observation by a cycle [s]; None where there was none lately."""
        for one in reversed(self.cycles[: bisect_right(self.cycles, cycle)][-TIMED_WITHIN:]):
            times = [read_time_s(record.field) for record in self.decision(one).observed]
            if known := [time_s for time_s in times if time_s is not None]:
                return max(known)
        return None

    def outcome(self) -> str:
        """Ref of how the mission ended, or, where it has not ended, of the last entry.

        Raises BadInput where the journal is empty.
        """
        if not self.newest:
            self.verify()
            raise BadInput(f"{self.source}: expected at least one entry, got none")
        last = self.last(Outcome)
        return self.refs[-1] if last is None else last.ref

    @property
    def cut_off(self) -> int | None:
        """The last cycle of a run of which nothing says how it ended; None where it ended, or never began."""
        return None if self.ids_of(Outcome) or not self.cycles else self.cycles[-1]

    def reason(self, record: EntryRecord[Any], kind: type[K]) -> EntryRecord[K] | None:
        """The first entry of a kind that an entry rests on directly."""
        refs = (ref for ref in record.because if ref.startswith(f"{kind.__name__}-"))
        return next((found for ref in refs if (found := self.entry(ref)) is not None), None)

    def because(self, record: EntryRecord[Any], kind: type[K]) -> K | None:
        """The value of that entry."""
        found = self.reason(record, kind)
        return None if found is None else found.value

    def chain(self, record: EntryRecord[Any], *kinds: type[Any]) -> list[EntryRecord[Any] | None]:
        """An entry's reason of the first kind, the reason of that of the second, and so on; None from where none is."""
        found: list[EntryRecord[Any] | None] = [record]
        for kind in kinds:
            found.append(None if found[-1] is None else self.reason(found[-1], kind))
        return found[1:]

    def within(self, record: EntryRecord[Any]) -> Iterator[EntryRecord[Any]]:
        """An entry and what it rests on, nearest first, each once; not more than FAR."""
        known, queue = {record.ref}, deque([record])
        for _ in range(FAR):
            if not queue:
                return
            one = queue.popleft()
            yield one
            for ref in one.because:
                if ref not in known and (below := self.entry(ref)) is not None:
                    known.add(ref)
                    queue.append(below)

    def nearest(self, record: EntryRecord[Any], *kinds: type[K]) -> EntryRecord[K] | None:
        """The entry of one of these kinds that is fewest steps down ``because``; the entry itself counts."""
        return next((one for one in self.within(record) if one.kind in kinds), None)

    def tracks_of(self, belief: EntryRecord[Any]) -> EntryRecord[Tracks] | None:
        """The landmarks that corrected a belief: they were written in the same act."""
        here = [r for r in self.decision(belief.cycle).made if is_a(r, Tracks) and r.author == belief.author]
        return here[0] if here else self.reason(belief, Tracks)

    def anchor_of(self, belief: EntryRecord[Any]) -> EntryRecord[Hypothesis] | None:
        """The revision with which a belief began that was carried on by wheels and landmarks since."""
        for back in range(belief.revision, max(-1, belief.revision - REVISIONS), -1):
            found = self.entry(f"{belief.id}.{back}")
            if found is None:
                return None
            if found.fields["basis"] not in ("tracks", "odometry") and found.author != YAW_CALIBRATOR:
                return found
        return None

    def held(self, until: int | None = None) -> EntryRecord[Hypothesis] | None:
        """The newest belief that was held in a cycle or before it, or at the end."""
        refs = [ref for ref in self.refs if ref.startswith("Hypothesis-")]
        past = refs if until is None else refs[: bisect_right(refs, until, key=self.cycle_of_ref)]
        records = (record for ref in reversed(past) if (record := self.entry(ref)) is not None)
        return next((record for record in records if record.field("status") == "held"), None)

    def resolve(self, text: str) -> str:
        """The ref that a user means: ``MotorCommand-12.3``, or ``MotorCommand-12`` for its last revision.

        Raises BadInput where the run has no such entry; near ones are named.
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
        """Names like one that is not there: first and last of each kind that is spelt alike, else of all."""
        kinds = dict[str, list[str]]()
        for id in self.newest:
            kinds.setdefault(id.rpartition("-")[0].lower(), []).append(id)
        alike = difflib.get_close_matches((text.rpartition("-")[0] or text).lower(), sorted(kinds), n=2, cutoff=0.6)
        ends = [kinds[kind] for kind in alike] or [list(self.newest)]
        return list(dict.fromkeys(id for ids in ends for id in (*ids[:1], *ids[-1:])))

    def _sweep(self) -> None:
        """Note where each entry stands. Raises BadInput where a line is not the cycle that has to stand there."""
        start = 0
        for line, end in enumerate(self._ends):
            begins = CYCLE.match(self._data, start)
            cycle = int(begins[1]) if begins else self._parse(line).cycle
            if cycle != line + 1:
                why = "a line is missing before it" if cycle > line else "a line is there twice, or was moved"
                raise BadInput(f"{self._path}:{line + 1}: expected cycle {line + 1}, got {cycle} ({why})")
            start = end + 1
        for change in CHANGE.finditer(self._data, 0, start):
            kind, ref = change.groups()
            (self._retracted if kind == b"Retracted" else self._entries)[ref] = change.start()

    def _find(self, ref: str, index: Mapping[bytes, int], *, retracted: bool) -> EntryRecord[Any] | None:
        """The newest change of that name."""
        at = index.get(ref.encode(errors="replace"))
        changes = () if at is None else self._decision(self._line_at(at)).changes
        found = [one for one in changes if one.ref == ref and one.is_gone is retracted]
        return found[-1] if found else None

    def _line_at(self, offset: int) -> int:
        return bisect_right(self._ends, offset - 1)

    def _decision(self, line: int) -> DecisionRecord:
        if line not in self._read:
            self._read[line] = self._parse(line)
        return self._read[line]

    def _parse(self, line: int) -> DecisionRecord:
        """Raises BadInput where the line is no decision; names file and line."""
        return decision_at(self.line(line + 1), f"{self._path}:{line + 1}")


def read_time_s(get: Callable[[str], Any]) -> float | None:
    """When an observation was made, by the body's clock [s], by its fields; None where they do not tell."""
    since, waited = get("since_s"), get("waited_s")
    value = get("when_s") if get("sim_time_s") is None else get("sim_time_s")
    if isinstance(since, int | float) and isinstance(waited, int | float):
        value = since + waited
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


KEPT = 64
"""So many entries of a type are remembered, the newest: nothing older is asked for, and a long run does not grow."""


class Mirror(View):
    """A view of the newest entries of each type."""

    def __init__(self, kept: int = KEPT) -> None:
        super().__init__(Blackboard())
        self._kept = kept

    def take(self, *changes: Change) -> None:
        """Follow some changes."""
        for change in changes:
            self._board.follow(change)
            if not isinstance(change, Retracted) and len(same := self.all(type(change.entry.value))) > self._kept:
                self._board.forget(same[0].id)


def find_belief(board: View) -> Entry[Hypothesis] | None:
    """The hypothesis that is acted on."""
    return board.latest(Hypothesis, lambda value: value.is_held)
