"""A journal asked by name: where each entry stands is found in one sweep over its bytes, and only those lines are read.

No index is kept beside the journal: the sweep over an hour's journal takes a tenth of a second, and what a line says is
believed only once the line has been read as a decision.
"""

from __future__ import annotations

import json
import re
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path

from harvey.errors import BadInput
from harvey.run_files.records import DecisionRecord, EntryRecord, decision_of
from harvey.why.history import History
from logs.journal_file import out_of_step

PLAIN = re.compile(rb'\{"cycle":(\d{1,15}),"')
"""How a line begins as the scheduler writes it; a line that begins otherwise is read in full."""
CHANGE = re.compile(rb'\{"change":"(\w+)","entry":"([^"\\]+)"')
"""How a change begins there. Inside a text every quotation mark has a backslash before it, so no text looks like it."""
CLOSES = ord("}")


class JournalHistory(History):
    """The history in a ``journal.jsonl``. A last line that was cut off in the middle of writing is left out."""

    def __init__(self, path: Path) -> None:
        """Raises BadInput where the file cannot be read."""
        try:
            self._data = path.read_bytes()
        except OSError as error:
            raise BadInput(f"{path}: expected a readable journal, got: {error.strerror}") from None
        self._path = path
        self._ends = [match.start() for match in re.finditer(rb"\n", self._data)]
        self._read: dict[int, DecisionRecord] = {}
        self._line_of: dict[int, int] = {}
        self._entries: dict[bytes, int] = {}
        self._retracted: dict[bytes, int] = {}
        self._sweep()

    @property
    def source(self) -> str:
        return str(self._path)

    @cached_property
    def newest(self) -> Mapping[str, str]:
        return {ref.rpartition(".")[0]: ref for ref in self.refs}

    @cached_property
    def refs(self) -> Sequence[str]:
        return tuple(ref.decode(errors="replace") for ref in self._entries)

    @cached_property
    def cycles(self) -> Sequence[int]:
        return tuple(self._line_of)

    def entry(self, ref: str) -> EntryRecord | None:
        return self._find(ref, self._entries.get(ref.encode(errors="replace")), retracted=False)

    def retraction(self, ref: str) -> EntryRecord | None:
        return self._find(ref, self._retracted.get(ref.encode(errors="replace")), retracted=True)

    def cycle_of(self, cycle: int) -> DecisionRecord | None:
        line = self._line_of.get(cycle)
        return None if line is None else self._decision(line)

    def naming(self, ref: str) -> Iterator[DecisionRecord]:
        name, at, after = json.dumps(ref).encode(), 0, -1
        while (at := self._data.find(name, at)) >= 0:
            line = self._line_at(at)
            at += len(name)
            if after < line < len(self._ends):
                after = line
                yield self._decision(line)

    def verify(self) -> None:
        for line in range(len(self._ends)):
            self._decision(line)

    def lines_alike(self, other: JournalHistory) -> int:
        """How many of the first lines are the same to the byte."""
        start = 0
        for line, (end, there) in enumerate(zip(self._ends, other._ends, strict=False)):
            if end != there or self._data[start:end] != other._data[start:end]:
                return line
            start = end + 1
        return min(len(self._ends), len(other._ends))

    def _sweep(self) -> None:
        """Note where each cycle and each entry stands. What stands in an unusual line is read from it.

        Raises BadInput where a line is not the cycle that follows on the line before.
        """
        start, unusual = 0, list[int]()
        for line, end in enumerate(self._ends):
            plain = PLAIN.match(self._data, start)
            if plain is None or self._data[end - 1] != CLOSES:
                unusual.append(line)
            cycle = int(plain[1]) if plain else self._decision(line).cycle
            if cycle != line + 1:
                raise BadInput(out_of_step(f"{self._path}:{line + 1}", line + 1, cycle))
            self._line_of[cycle] = line
            start = end + 1
        if unusual:
            self._sweep_slowly()
            return
        whole = self._ends[-1] if self._ends else 0
        for change in CHANGE.finditer(self._data, 0, whole):
            kind, ref = change.groups()
            (self._retracted if kind == b"Retracted" else self._entries)[ref] = change.start()

    def _sweep_slowly(self) -> None:
        for line in range(len(self._ends)):
            decision = self._decision(line)
            for record in (*decision.observed, *decision.made):
                where = self._retracted if record.change == "Retracted" else self._entries
                where[record.ref.encode(errors="replace")] = self._ends[line] - 1

    def _find(self, ref: str, offset: int | None, *, retracted: bool) -> EntryRecord | None:
        """The newest change of that name; where the index is wrong, every line is searched."""
        if offset is None:
            return None
        for line in range(self._line_at(offset), -1, -1):
            decision = self._decision(line)
            for record in reversed((*decision.observed, *decision.made)):
                if record.ref == ref and (record.change == "Retracted") is retracted:
                    return record
        return None

    def _line_at(self, offset: int) -> int:
        return bisect_right(self._ends, offset - 1)

    def _decision(self, line: int) -> DecisionRecord:
        """Raises BadInput where the line is no decision; names file and line."""
        if line not in self._read:
            start = self._ends[line - 1] + 1 if line else 0
            self._read[line] = decision_at(self._data[start : self._ends[line]], f"{self._path}:{line + 1}")
        return self._read[line]


def decision_at(text: bytes, where: str) -> DecisionRecord:
    """A line as a decision. Raises BadInput naming ``where``, what was expected and what came."""
    try:
        data = json.loads(text)
    except RecursionError:
        raise BadInput(f"{where}: expected a decision, got too many nested brackets") from None
    except ValueError as error:
        raise BadInput(f"{where}: expected a decision as a JSON object, got {text[:60]!r} ({error})") from None
    if not isinstance(data, dict):
        raise BadInput(f"{where}: expected a decision as a JSON object, got {text[:60]!r}")
    try:
        return decision_of(data)
    except ValueError as error:
        raise BadInput(f"{where}: {error}") from None
