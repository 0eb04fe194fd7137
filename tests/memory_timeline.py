"""A timeline of decisions that are in memory: what the one that reads a journal's lines is checked against."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from logs.records import DecisionRecord, EntryRecord
from logs.timeline import Timeline


class MemoryTimeline(Timeline):
    """Made of decisions, of which each entry is remembered."""

    def __init__(self, decisions: Iterable[DecisionRecord]) -> None:
        self._decisions: dict[int, DecisionRecord] = {}
        self._told: dict[str, EntryRecord[Any]] = {}
        self._gone: dict[str, EntryRecord[Any]] = {}
        for decision in decisions:
            self._decisions[decision.cycle] = decision
            for record in decision.changes:
                (self._gone if record.is_gone else self._told)[record.ref] = record

    @property
    def source(self) -> str:
        return "the journal"

    @property
    def newest(self) -> dict[str, str]:
        return {record.id: ref for ref, record in self._told.items()}

    @property
    def refs(self) -> Sequence[str]:
        return tuple(self._told)

    @property
    def cycles(self) -> Sequence[int]:
        return tuple(self._decisions)

    def entry(self, ref: str) -> EntryRecord[Any] | None:
        return self._told.get(ref)

    def retraction(self, ref: str) -> EntryRecord[Any] | None:
        return self._gone.get(ref)

    def cycle_of(self, cycle: int) -> DecisionRecord | None:
        return self._decisions.get(cycle)

    def naming(self, ref: str) -> Iterator[DecisionRecord]:
        return iter(self._decisions.values())

    def line(self, cycle: int) -> bytes:
        return self._decisions[cycle].line.encode()

    def decisions(self) -> Iterator[DecisionRecord]:
        return iter(self._decisions.values())
