"""The agenda: activations a second with the journal written, as ever more of them wait; peers beside it; memory."""

from __future__ import annotations

import sys
import timeit
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from blackboard.board import Blackboard
from blackboard.effect import Post
from blackboard.index import Index
from experiments.report import Cell, Report
from experiments.scale import agenda_memory, agenda_peers
from experiments.scale.agenda_compiled import measure_compiled
from experiments.scale.agenda_load import LOADS, ONE, PART_CYCLES, Speed, Task, measure
from experiments.scale.agenda_mission import Cost, mission_cost
from harvey.campaign.progress import stages
from harvey.compiled import CannotCompileError, compile_board
from logs.journal_file import HELD_LINES

PENDING = (10, 100, 1_000, 10_000, 100_000)
QUICK_PENDING = (10, 10_000)
LITERATURE: Mapping[int, float] = {10: 57_600.0, 100_000: 794.0}
"""GBBopen, from 10 to 100,000 pending."""
WANTED = 50_000.0
FLAT = 1.5
PARTS, QUICK_PARTS = 60, 10
CYCLES, QUICK_CYCLES = 1_000_000, 10_000
GROWING_CYCLES = 10_000
MISSION_CYCLES = 10
"""Of the quick version; the other one drives the whole way."""
TICKS: Mapping[int, int] = {10: 500, 100: 100, 1_000: 10, 10_000: 2, 100_000: 1}
QUICK_TICKS: Mapping[int, int] = {10: 100, 10_000: 1}
FIRINGS = 5_000
READS = 2_000
BY_RATING: Index[Task] = Index(Task, lambda task: task.rating)

Speeds = Mapping[str, Sequence[Speed]]
"""By the names of the loads, from few that wait to many."""

Row = tuple[Cell, ...]


def run(quick: bool, seed: int) -> Report:
    """Measure memory first, while the process is small; then agenda, peers, reads and a mission."""
    waiting = QUICK_PENDING if quick else PENDING
    with stages(5 + 2 * len(LOADS), sys.stderr) as begin, TemporaryDirectory() as folder:
        return _run(quick, seed, waiting, Path(folder), begin)


def _run(quick: bool, seed: int, waiting: Sequence[int], folder: Path, begin: Callable[[str], None]) -> Report:
    parts = QUICK_PARTS if quick else PARTS
    cycles = QUICK_CYCLES if quick else CYCLES
    begin(f"memory: {cycles} cycles with forgetting")
    kept = agenda_memory.long_run(cycles, agenda_memory.RETENTION)
    begin(f"memory: {GROWING_CYCLES} cycles without")
    growing = agenda_memory.long_run(GROWING_CYCLES, ())
    begin("compiling the board")
    uncompiled = _why_not_compiled(folder)
    speeds: dict[str, list[Speed]] = {}
    compiled: dict[str, list[Speed]] = {}
    for load in LOADS:
        begin(f"{load.name}, {waiting[0]} to {waiting[-1]} pending")
        speeds[load.name] = measure(load, waiting, parts, seed)
        begin(f"{load.name}, compiled")
        if not uncompiled:
            compiled[load.name] = measure_compiled(folder, load, waiting, parts, seed)
    begin("peers")
    speed_rows = tuple(_speed_rows(speeds, compiled, QUICK_TICKS if quick else TICKS))
    begin("a mission")
    cost = mission_cost(MISSION_CYCLES if quick else None, seed)
    return Report(
        "The agenda: activations a second, journal included",
        ("what", "pending", "literature", "py_trees", "CLIPS", "ours", "ours, median", "compiled", "compiled, median"),
        (*speed_rows, *_read_rows(), *_memory_rows(kept, growing), *_mission_rows(cost)),
        notes=_notes(parts, uncompiled),
        claims=tuple(_claims(speeds, compiled, kept)),
    )


def _why_not_compiled(folder: Path) -> str:
    """Compile the board into a folder; what was missing for it, or ""."""
    try:
        compile_board(folder)
    except CannotCompileError as error:
        return str(error)
    return ""


def _speed_rows(speeds: Speeds, compiled: Speeds, ticks: Mapping[int, int]) -> Iterator[Row]:
    for name, measured in speeds.items():
        for place, speed in enumerate(measured):
            pending = speed.pending
            fast: Row = (None, None)
            if compiled:
                fast = (_a_second(compiled[name][place].best_s), _a_second(compiled[name][place].usual_s))
            peers: Row = (None, None, None)
            if name == ONE.name:
                peers = (LITERATURE.get(pending), _py_trees(pending, ticks.get(pending)), _clips(pending))
            yield name, pending, *peers, _a_second(speed.best_s), _a_second(speed.usual_s), *fast


def _a_second(took_s: float) -> int:
    return round(1.0 / took_s)


def _py_trees(pending: int, ticks: int | None) -> Cell:
    if ticks is None or not agenda_peers.has("py_trees"):
        return None
    return round(1.0 / agenda_peers.py_trees_s(pending, ticks), 1)


def _clips(pending: int) -> Cell:
    return round(1.0 / agenda_peers.clips_s(pending, FIRINGS)) if agenda_peers.has("clips") else None


def _read_rows() -> Iterator[Row]:
    """How long one indexed read takes; the column of what is pending says how many entries are on the board."""
    for entries in (PENDING[0], PENDING[-1]):
        board = Blackboard()
        board.apply([Post(Task(i, float(i % (entries // 10)))) for i in range(entries)], author="user", cycle=0)
        view = board.view
        reads: Mapping[str, Callable[[], object]] = {
            "newest": partial(view.newest, BY_RATING, 0.0), "all": partial(view.having, BY_RATING, 0.0),
        }
        for what, read in reads.items():
            read()
            took_s = min(timeit.repeat(read, number=READS, repeat=5)) / READS
            yield f"{what} by a key that 10 have [us]", entries, None, None, None, 1e6 * took_s, None, None, None


def _memory_rows(kept: agenda_memory.Memory, growing: agenda_memory.Memory) -> Iterator[Row]:
    for what, value in (
        (f"{kept.cycles} cycles with forgetting: resident after a tenth [MB]", kept.early_bytes / 1e6),
        ("the same after all of them [MB]", kept.late_bytes / 1e6),
        ("growth a cycle [bytes]", kept.a_cycle_bytes),
        (f"entries on the board, of {kept.posted} posted pictures alone", kept.entries),
        (f"{growing.cycles} cycles without: entries on the board", growing.entries),
        ("growth a cycle [bytes]", growing.a_cycle_bytes),
    ):
        yield what, None, None, None, None, value, None, None, None


def _mission_rows(cost: Cost) -> Iterator[Row]:
    for what, value in (
        (f"a mission of {cost.cycles} cycles: activations a cycle", cost.activations / cost.cycles),
        ("of which obviated", cost.obviated / cost.cycles),
        ("most that waited", cost.most_pending),
        ("entries on the board in the end", cost.entries),
        ("experts, a cycle [ms]", 1e3 * cost.experts_s / cost.cycles),
        ("the mechanism, a cycle [ms]", 1e3 * cost.engine_s / cost.cycles),
        ("the journal's line, a cycle [ms]", 1e3 * cost.lines_s / cost.cycles),
        ("mechanism and line, part of a cycle [%]", 100.0 * cost.overhead),
    ):
        yield what, None, None, None, None, value, None, None, None


def _claims(speeds: Speeds, compiled: Speeds, kept: agenda_memory.Memory) -> Iterator[tuple[str, bool]]:
    """What is claimed of speed is claimed of the compiled board, where it can be had; that it is flat, of both."""
    for kind, measured in (("", speeds), ("compiled, ", compiled)):
        if not measured:
            continue
        for load in LOADS:
            yield from _claims_of(f"{kind}{load.name}", measured[load.name], speed=measured is (compiled or speeds))
    if kept.cycles >= CYCLES:  # in a short run a page more or less is a byte a cycle
        yield "memory does not grow with forgetting: less than a byte a cycle", kept.a_cycle_bytes < 1.0


def _claims_of(name: str, speeds: Sequence[Speed], *, speed: bool) -> Iterator[tuple[str, bool]]:
    slowest = min(1.0 / measured.best_s for measured in speeds)
    fastest = max(1.0 / measured.best_s for measured in speeds)
    if speed:
        yield (f"{name}: at least {WANTED:.0f} activations a second however many wait (slowest {slowest:.0f})",
               slowest >= WANTED)
    yield (f"{name}: flat within {FLAT} from {speeds[0].pending} to {speeds[-1].pending} pending"
           f" ({fastest / slowest:.2f})", fastest <= FLAT * slowest)


def _notes(parts: int, uncompiled: str) -> tuple[str, ...]:
    call_s = min(timeit.repeat("f()", "def f(): pass", number=10_000, repeat=20)) / 10_000
    absent = [peer for peer in ("py_trees", "clips") if not agenda_peers.has(peer)]
    return (
        "Counted: activations that are created, rated, queued, and then either chosen, asked again and executed, or"
        " obviated because their trigger became stale; each with its decision as a JSON line in a file"
        " (logs.journal_file, as in a run). Nothing here is observed and nothing moves motors, so up to"
        f" {HELD_LINES} lines are handed to the operating system at once; a decision on an observation is handed over"
        " in its cycle, and one that moves motors is forced onto the disk.",
        f"Processor time of {PART_CYCLES} cycles: the best of {parts} such parts, which take turns with those of other"
        " numbers pending; beside it the median one, which also shows what else the machine was doing. A bare Python"
        f" call took {1e9 * call_s:.0f} ns here.",
        f"The board could not be compiled: {uncompiled}." if uncompiled else
        "Compiled: the same board, its mechanism made into machine code of the same source by mypyc ('make compiled');"
        " the same experts, the same journal. What is claimed of speed is claimed of it, where it can be had.",
        "'a change wakes 1 expert': one cycle, one activation, one line; nothing is shared. 'as in missions': 1.375"
        " activations a cycle, 1 executed and 0.375 obviated; a mission has 1.36. 'wakes 14': as many experts as a"
        " mission has, all woken by each change, 13 of them obviated; they share the cycle, so it is no measure of"
        " cycles.",
        "Literature: GBBopen's activations a second at 10 and at 100,000 pending, as reported, in Lisp and on other"
        " hardware; what it writes down meanwhile is not known here, so compare its fall and not its height.",
        "CLIPS (clipspy): a rule of its own language fires with as many activations of lower salience on the agenda,"
        " and calls Python to write a short line. Fair as to the agenda; not as to the rest: matching is in C, the"
        " line says only what fired, no expert is asked for a rating, and no reasons are kept.",
        "py_trees: a tick of a selector in which so many behaviours say that they cannot act before the one that does."
        " It has no agenda: it asks everyone every time, which is what is shown; a tick of a tree with little to ask is"
        " a better use of it.",
        "Memory: resident set of this process; lines are made and written to the null device. The mission is decided"
        " again from its observations; its experts include the seeing, but no camera and no wheels.",
        *(f"{peer} is not installed: .venv/bin/pip install '.[peers]'." for peer in absent),
    )
