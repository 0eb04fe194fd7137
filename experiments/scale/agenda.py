"""Agenda: activations per second, journal included, with 10 to 1,000 pending; memory; peers."""

from __future__ import annotations

import sys
import timeit
from collections.abc import Iterator, Mapping, Sequence

from experiments.report import Cell, Report
from experiments.scale import agenda_memory, agenda_peers
from experiments.scale.agenda_load import PART_CYCLES, Speed, measure
from logs.journal_file import HELD_LINES

PENDING = (10, 100, 1_000)
QUICK_PENDING = (10, 1_000)
PARTS, QUICK_PARTS = 60, 10
CYCLES, QUICK_CYCLES = 1_000_000, 10_000
TICKS: Mapping[int, int] = {10: 500, 100: 100, 1_000: 10}
"""Ticks of py_trees per measurement, by number pending."""
FIRINGS = 5_000
COLUMNS = ("what", "pending", "py_trees", "CLIPS", "ours", "ours, median")

Peers = Mapping[int, tuple[float | None, float | None]]
"""Activations per second of py_trees and CLIPS by number pending; None: not installed."""
Row = tuple[Cell, ...]


def run(quick: bool, seed: int) -> Report:
    """Measure memory first, while the process is small; then agenda and peers."""
    pending, parts, cycles = (QUICK_PENDING, QUICK_PARTS, QUICK_CYCLES) if quick else (PENDING, PARTS, CYCLES)
    print(f"1 of 3: memory: {cycles} cycles", file=sys.stderr)
    memory = agenda_memory.long_run(cycles)
    print(f"2 of 3: {pending[0]} to {pending[-1]} pending", file=sys.stderr)
    speeds = measure(pending, parts, seed)
    print("3 of 3: peers", file=sys.stderr)
    peers = {number: _peers(number) for number in pending}
    return Report("Agenda: activations per second, journal included", COLUMNS,
                  (*_speed_rows(speeds, peers), *_memory_rows(memory)), notes=_notes(parts),
                  claims=tuple(_claims(speeds, peers, memory)))


def _peers(pending: int) -> tuple[float | None, float | None]:
    py_trees = 1.0 / agenda_peers.py_trees_s(pending, TICKS[pending]) if agenda_peers.has("py_trees") else None
    clips = 1.0 / agenda_peers.clips_s(pending, FIRINGS) if agenda_peers.has("clips") else None
    return py_trees, clips


def _speed_rows(speeds: Sequence[Speed], peers: Peers) -> Iterator[Row]:
    for speed in speeds:
        py_trees, clips = peers[speed.pending]
        yield ("a change triggers 1", speed.pending, py_trees, None if clips is None else round(clips),
               round(1.0 / speed.best_s), round(1.0 / speed.median_s))


def _memory_rows(memory: agenda_memory.Memory) -> Iterator[Row]:
    for what, value in (
        (f"{memory.cycles} cycles with retention: resident after a tenth [MB]", memory.early_bytes / 1e6),
        ("the same after all of them [MB]", memory.late_bytes / 1e6),
        ("growth per cycle [bytes]", memory.growth_bytes),
        (f"entries on the board, of {memory.posted} posted pictures alone", memory.entries),
    ):
        yield what, None, None, None, value, None


def _claims(speeds: Sequence[Speed], peers: Peers, memory: agenda_memory.Memory) -> Iterator[tuple[str, bool]]:
    largest = speeds[-1]
    ours, (py_trees, _) = 1.0 / largest.best_s, peers[largest.pending]
    if py_trees is not None:
        yield f"{largest.pending} pending: faster than py_trees, {py_trees:.1f} per second here", ours > py_trees
    if memory.cycles >= CYCLES:  # in a short run a page more or less is a byte per cycle
        yield "memory does not grow with retention: less than a byte per cycle", memory.growth_bytes < 1.0


def _notes(parts: int) -> tuple[str, ...]:
    call_s = min(timeit.repeat("f()", "def f(): pass", number=10_000, repeat=20)) / 10_000
    absent = [peer for peer in ("py_trees", "clips") if not agenda_peers.has(peer)]
    return (
        "Counted: activations that are created, rated, queued, chosen, checked again and executed, one a cycle; each"
        " with its decision as a JSON line in a file (logs.journal_file, as in a run). Nothing here is observed and"
        f" nothing moves motors, so up to {HELD_LINES} lines are handed to the operating system at once; a decision on"
        " an observation is handed over in its cycle, and one that moves motors is forced to disk.",
        f"Processor time of {PART_CYCLES} cycles: the best of {parts} such parts, which alternate with those of other"
        " numbers pending; beside it the median, which also shows what else the machine was doing. A bare Python"
        f" call took {1e9 * call_s:.0f} ns here.",
        "More are pending the longer a cycle takes, as it looks at all of them: a mission has a few.",
        "CLIPS (clipspy) is a rule engine in C, and may be faster than ours; no claim is made. A rule of its own"
        " language fires with as many activations of lower salience on the agenda, and calls Python to write a short"
        " line. Comparable as to the agenda only: matching is in C, the line says only what fired, nothing is rated,"
        " and no reasons are kept.",
        "py_trees: a tick of a selector in which so many behaviours fail before one succeeds. It has no agenda: it"
        " asks every behaviour every time, which is what is shown; a tree with little to ask is a better use of it.",
        "Memory: resident set of this process; lines are made and written to the null device.",
        *(f"{peer} is not installed: .venv/bin/pip install '.[peers]'." for peer in absent),
    )
