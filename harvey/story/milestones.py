"""The milestones of a run as a table: each verdict with the evidence that decided it, and what was never judged."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from harvey.run_files.records import EntryRecord
from harvey.tables import table
from harvey.why.decisions import time_at
from harvey.why.history import History
from harvey.why.links import reason
from harvey.why.sentences import value_of
from world_models.entries.task import Certificate

COLUMNS = ("cycle", "s", "milestone", "verdict", "lines", "off mm", "off deg", "p wrong")
MOST_ROWS = 60
"""Of more rows only those are printed that were not verified, and the last ones."""


@dataclass(frozen=True, slots=True)
class MilestoneRow:
    """What became of a milestone.

    Attributes:
        cycle: of the verdict; of a milestone that was not judged its last.
        time_s: since the run began; None where nothing told it.
        name: ``M1 of hallway``, or ``check of the belief``.
        verdict: verified, refuted, not testable; or withdrawn, expected, turning.
        expected, matched: numbers of model lines.
        deviation_m, deviation_rad: from the belief that predicted it; None where it was not judged.
        p_false: probability that so much agrees at a wrong place.
        refs: certificate and milestone.
    """

    cycle: int
    time_s: float | None
    name: str
    verdict: str
    expected: int
    matched: int
    deviation_m: float | None
    deviation_rad: float | None
    p_false: float | None
    refs: tuple[str, ...]


def read_milestones(history: History) -> tuple[MilestoneRow, ...]:
    """Every verdict of a run, and every milestone that got none, in the order of time."""
    rows = [*_judged(history)]
    judged = {ref.rpartition(".")[0] for row in rows for ref in row.refs}
    rows += _not_judged(history, judged)
    return tuple(sorted(rows, key=lambda row: row.cycle))


def _judged(history: History) -> Iterator[MilestoneRow]:
    for record in history.of_kind("Certificate"):
        if record.change == "Retracted":
            continue
        certificate, below = value_of(record, Certificate), reason(history, record, "Milestone")
        name = certificate.milestone if below is None else _name(below)
        refs = (record.ref, below.ref if below is not None else f"{certificate.milestone}.0")
        yield MilestoneRow(
            record.cycle,
            time_at(history, record.cycle),
            name,
            certificate.verdict,
            certificate.expected,
            certificate.matched,
            certificate.deviation_m,
            certificate.deviation_rad,
            certificate.p_false,
            refs,
        )


def _not_judged(history: History, judged: set[str]) -> Iterator[MilestoneRow]:
    for id, ref in history.newest.items():
        record = history.entry(ref) if id.startswith("Milestone-") and id not in judged else None
        if record is not None:
            yield MilestoneRow(
                record.cycle, time_at(history, record.cycle), _name(record), str(record.value["status"]),
                len(record.value["expected"]), 0, None, None, None, (ref,))


def _name(record: EntryRecord) -> str:
    """As :meth:`~world_models.entries.task.Milestone.name`, without decoding its lines."""
    return str(record.value["what"]).partition(", because")[0]


def milestone_lines(rows: Sequence[MilestoneRow]) -> Iterator[str]:
    """The table; of a long run what was not verified, and the newest."""
    if not rows:
        yield "There was none."
        return
    shown = (
        rows
        if len(rows) <= MOST_ROWS
        else sorted(
            {*(row for row in rows if row.verdict != "verified"), *rows[-MOST_ROWS // 2 :]}, key=lambda row: row.cycle
        )
    )
    if len(shown) < len(rows):
        yield f"Of {len(rows)} these {len(shown)}; --json has them all."
    yield from table(COLUMNS, [_cells(row) for row in shown]).splitlines()


def _cells(row: MilestoneRow) -> tuple[str, ...]:
    off_m, off_rad, p = row.deviation_m, row.deviation_rad, row.p_false
    return (
        str(row.cycle),
        "-" if row.time_s is None else f"{row.time_s:.1f}",
        row.name,
        row.verdict,
        f"{row.matched} of {row.expected}",
        "-" if off_m is None else f"{1e3 * off_m:.1f}",
        "-" if off_rad is None else f"{math.degrees(abs(off_rad)):.1f}",
        "-" if p is None else f"{p:.1g}",
    )
