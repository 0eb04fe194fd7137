"""Agenda: activations per second, journal included, with 10 to 100,000 pending; memory; peers."""

from __future__ import annotations

import math
import sys
import time
import timeit
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from blackboard.board import Blackboard, View
from blackboard.change import Change, Posted
from blackboard.effect import Effect, Post, Revise
from blackboard.entry_store import Index
from blackboard.journal import Decision, decision_line
from blackboard.knowledge_source import KnowledgeSource
from blackboard.scheduler import Scheduler
from experiments.report import Cell, Report
from experiments.scale import agenda_memory, agenda_peers
from experiments.scale.agenda_load import LOADS, PART_CYCLES, SINGLE, Speed, Task, measure
from experiments.wrappers import WrappedSource
from harvey.campaign.progress import stages
from harvey.simulation.run import run_mission
from harvey.wiring import knowledge_sources, servoing
from knowledge_sources.settings import DEFAULT
from logs.journal_file import HELD_LINES
from sim.scenario import Scenario, load_scenario
from sim.stage import build_stage
from world_models.building.locale_frame import LocaleFrame
from world_models.entries.kinds import KINDS
from world_models.files.world_files import load_world
from world_models.frame_store import FrameStore


@dataclass(frozen=True, slots=True)
class Cost:
    """Counts and processor times of one mission.

    Attributes:
        cycles, activations, obviated: counts.
        sources_s: time in the knowledge sources' ``bind`` and ``act``.
        scheduler_s: time in the rest of the cycles: board, indexes, agenda, choice, retention.
        lines_s: time to make the journal's lines.
        max_pending: most activations pending at once.
        entries: entries on the board at the end.
    """

    cycles: int
    activations: int
    obviated: int
    sources_s: float
    scheduler_s: float
    lines_s: float
    max_pending: int
    entries: int

    @property
    def overhead(self) -> float:
        """Share of the time that is not the knowledge sources'."""
        return (self.scheduler_s + self.lines_s) / (self.scheduler_s + self.lines_s + self.sources_s)


class _Timed(WrappedSource):
    """A knowledge source with a stopwatch."""

    def __init__(self, inner: KnowledgeSource) -> None:
        super().__init__(inner)
        self.spent_s = 0.0

    def bind(self, view: View, trigger: Change) -> Any | None:
        began_s = time.process_time()
        case = super().bind(view, trigger)
        self.spent_s += time.process_time() - began_s
        return case

    def act(self, view: View, case: Any) -> Iterable[Effect]:
        began_s = time.process_time()
        effects = tuple(super().act(view, case))
        self.spent_s += time.process_time() - began_s
        return effects


def mission_cost(cycles: int | None, seed: int) -> Cost:
    """Run the laboratory's mission, then replay its observations with a stopwatch."""
    scenario = load_scenario("lab-to-allens-office")
    if cycles is not None:
        scenario = replace(scenario, limits=replace(scenario.limits, max_cycles=cycles))
    recorded: list[Decision] = []
    run_mission(build_stage(scenario), seed, sinks=[recorded.append])
    return _time_replay(scenario, recorded)


def _time_replay(scenario: Scenario, recorded: list[Decision]) -> Cost:
    timed = [_Timed(source) for source in knowledge_sources(DEFAULT)]
    scheduler = Scheduler(timed, servoing=servoing(scenario.servo), kinds=KINDS)
    store = FrameStore(load_world(scenario.world))
    lines_s, steps_s = 0.0, 0.0
    for decision in recorded:
        for change in decision.observed:
            scheduler.tell([_effect_of(change, scheduler.view, store)], change.entry.author)
        began_s = time.process_time()
        again = scheduler.step()
        steps_s += time.process_time() - began_s
        if again is None:
            break
        began_s = time.process_time()
        decision_line(again)
        lines_s += time.process_time() - began_s
    sources_s = math.fsum(source.spent_s for source in timed)
    return Cost(
        len(recorded), sum(len(d.activated) for d in recorded), sum(len(d.obviated) for d in recorded),
        sources_s, steps_s - sources_s, lines_s, max(d.pending for d in recorded), len(scheduler.view),
    )


def _effect_of(observed: Change, view: View, store: FrameStore) -> Effect:
    """What makes the same change; frames come without what the recorded mission computed from them."""
    entry = observed.entry
    value = store.frame(entry.value.name) if isinstance(entry.value, LocaleFrame) else entry.value
    return Post(value, entry.because) if isinstance(observed, Posted) else Revise(view[entry.id], value, entry.because)


PENDING = (10, 100, 1_000, 10_000, 100_000)
QUICK_PENDING = (10, 100_000)
LITERATURE: Mapping[int, float] = {10: 57_600.0, 100_000: 794.0}
"""GBBopen, activations per second with 10 and with 100,000 pending."""
ASKED_PER_S = 50_000.0
"""Once asked for. Not claimed: whether plain Python reaches it depends on the machine."""
MAX_RATIO = 2.0
"""Flat: the fastest of all numbers pending is at most this many times the slowest."""
PARTS, QUICK_PARTS = 60, 10
CYCLES, QUICK_CYCLES = 1_000_000, 10_000
GROWING_CYCLES = 10_000
QUICK_MISSION_CYCLES = 10
TICKS: Mapping[int, int] = {10: 500, 100: 100, 1_000: 10, 10_000: 2, 100_000: 1}
"""Ticks of py_trees per measurement, by number pending."""
FIRINGS = 5_000
READS = 2_000
BY_RATING: Index[Task] = Index(Task, lambda task: task.rating)
COLUMNS = ("what", "pending", "literature", "py_trees", "CLIPS", "ours", "ours, median")

Speeds = Mapping[str, Sequence[Speed]]
"""By load, from few to many pending."""
Peers = Mapping[int, tuple[float | None, float | None]]
"""Activations per second of py_trees and CLIPS by number pending; None: not installed."""
Row = tuple[Cell, ...]


def run(quick: bool, seed: int) -> Report:
    """Measure memory first, while the process is small; then agenda, peers, reads and a mission."""
    pending = QUICK_PENDING if quick else PENDING
    parts = QUICK_PARTS if quick else PARTS
    cycles = QUICK_CYCLES if quick else CYCLES
    with stages(4 + len(LOADS), sys.stderr) as begin:
        begin(f"memory: {cycles} cycles with retention")
        retained = agenda_memory.long_run(cycles, retention=True)
        begin(f"memory: {GROWING_CYCLES} cycles without")
        growing = agenda_memory.long_run(GROWING_CYCLES, retention=False)
        speeds: dict[str, list[Speed]] = {}
        for load in LOADS:
            begin(f"{load.name}, {pending[0]} to {pending[-1]} pending")
            speeds[load.name] = measure(load, pending, parts, seed)
        begin("peers")
        peers = {number: _peers(number) for number in pending}
        begin("a mission")
        cost = mission_cost(QUICK_MISSION_CYCLES if quick else None, seed)
    rows = (*_speed_rows(speeds, peers), *_read_rows(), *_memory_rows(retained, growing), *_mission_rows(cost))
    return Report("Agenda: activations per second, journal included", COLUMNS, rows, notes=_notes(parts, speeds),
                  claims=tuple(_claims(speeds, peers, retained)))


def _peers(pending: int) -> tuple[float | None, float | None]:
    py_trees = 1.0 / agenda_peers.py_trees_s(pending, TICKS[pending]) if agenda_peers.has("py_trees") else None
    clips = 1.0 / agenda_peers.clips_s(pending, FIRINGS) if agenda_peers.has("clips") else None
    return py_trees, clips


def _speed_rows(speeds: Speeds, peers: Peers) -> Iterator[Row]:
    for name, measured in speeds.items():
        for speed in measured:
            others: Row = (None, None, None)
            if name == SINGLE.name:
                py_trees, clips = peers[speed.pending]
                others = (LITERATURE.get(speed.pending), py_trees, None if clips is None else round(clips))
            yield name, speed.pending, *others, round(1.0 / speed.best_s), round(1.0 / speed.median_s)


def _read_rows() -> Iterator[Row]:
    """Time of one indexed read; the column of what is pending says how many entries are on the board."""
    for entries in (PENDING[0], PENDING[-1]):
        board = Blackboard()
        board.apply([Post(Task(i, float(i % (entries // 10)))) for i in range(entries)], author="user", cycle=0)
        view = board.view
        reads: Mapping[str, Callable[[], object]] = {
            "newest": partial(view.newest, BY_RATING, 0.0), "all": partial(view.having, BY_RATING, 0.0),
        }
        for what, read in reads.items():
            read()
            time_s = min(timeit.repeat(read, number=READS, repeat=5)) / READS
            yield _row(f"read {what} of the 10 entries under a key [us]", 1e6 * time_s, pending=entries)


def _memory_rows(retained: agenda_memory.Memory, growing: agenda_memory.Memory) -> Iterator[Row]:
    for what, value in (
        (f"{retained.cycles} cycles with retention: resident after a tenth [MB]", retained.early_bytes / 1e6),
        ("the same after all of them [MB]", retained.late_bytes / 1e6),
        ("growth per cycle [bytes]", retained.growth_bytes),
        (f"entries on the board, of {retained.posted} posted pictures alone", retained.entries),
        (f"{growing.cycles} cycles without: entries on the board", growing.entries),
        ("growth per cycle [bytes]", growing.growth_bytes),
    ):
        yield _row(what, value)


def _mission_rows(cost: Cost) -> Iterator[Row]:
    for what, value in (
        (f"a mission of {cost.cycles} cycles: activations per cycle", cost.activations / cost.cycles),
        ("of which obviated", cost.obviated / cost.cycles),
        ("most pending at once", cost.max_pending),
        ("entries on the board at the end", cost.entries),
        ("knowledge sources, per cycle [ms]", 1e3 * cost.sources_s / cost.cycles),
        ("scheduler and board, per cycle [ms]", 1e3 * cost.scheduler_s / cost.cycles),
        ("journal line, per cycle [ms]", 1e3 * cost.lines_s / cost.cycles),
        ("scheduler, board and line, share of a cycle [%]", 100.0 * cost.overhead),
    ):
        yield _row(what, value)


def _row(what: str, ours: float, pending: int | None = None) -> Row:
    return what, pending, None, None, None, ours, None


def _claims(speeds: Speeds, peers: Peers, retained: agenda_memory.Memory) -> Iterator[tuple[str, bool]]:
    for name, measured in speeds.items():
        times_s = [speed.best_s for speed in measured]
        ratio = max(times_s) / min(times_s)
        yield (f"{name}: flat within {MAX_RATIO:g} from {measured[0].pending} to {measured[-1].pending} pending"
               f" ({ratio:.2f})", ratio <= MAX_RATIO)
    largest = speeds[SINGLE.name][-1]
    ours, (py_trees, _) = 1.0 / largest.best_s, peers[largest.pending]
    if literature := LITERATURE.get(largest.pending):
        yield (f"{largest.pending} pending: faster than the literature's {literature:.0f} per second ({ours:.0f})",
               ours > literature)
    if py_trees is not None:
        yield f"{largest.pending} pending: faster than py_trees, {py_trees:.1f} per second here", ours > py_trees
    if retained.cycles >= CYCLES:  # in a short run a page more or less is a byte per cycle
        yield "memory does not grow with retention: less than a byte per cycle", retained.growth_bytes < 1.0


def _notes(parts: int, speeds: Speeds) -> tuple[str, ...]:
    call_s = min(timeit.repeat("f()", "def f(): pass", number=10_000, repeat=20)) / 10_000
    slowest = min(1.0 / speed.best_s for speed in speeds[SINGLE.name])
    absent = [peer for peer in ("py_trees", "clips") if not agenda_peers.has(peer)]
    return (
        "Counted: activations that are created, rated, queued, and then either chosen, checked again and executed, or"
        " obviated because their trigger became stale; each with its decision as a JSON line in a file"
        " (logs.journal_file, as in a run). Nothing here is observed and nothing moves motors, so up to"
        f" {HELD_LINES} lines are handed to the operating system at once; a decision on an observation is handed over"
        " in its cycle, and one that moves motors is forced to disk.",
        f"Processor time of {PART_CYCLES} cycles: the best of {parts} such parts, which alternate with those of other"
        " numbers pending; beside it the median, which also shows what else the machine was doing. A bare Python"
        f" call took {1e9 * call_s:.0f} ns here.",
        f"{ASKED_PER_S:.0f} activations per second, one per cycle, were once asked for. That is not claimed: plain"
        f" Python makes {slowest:.0f} here at the slowest, and no mission needs it: it has about one activation per"
        " cycle, and the knowledge sources take most of the cycle (last rows).",
        "'a change triggers 1': one cycle, one activation, one line; nothing is shared. '1.375, as in missions': 1"
        " executed and 0.375 obviated per cycle; a mission has 1.36. 'triggers 14': as many knowledge sources as a"
        " mission has, all triggered by each change, 13 of them obviated; they share the cycle, so it does not measure"
        " cycles.",
        "Literature: GBBopen's activations per second with 10 and with 100,000 pending, as reported, in Lisp and on"
        " other hardware. What it writes down meanwhile is not known here: compare how it falls, not its height.",
        "CLIPS (clipspy) is a rule engine in C, and may be faster than ours; no claim is made. A rule of its own"
        " language fires with as many activations of lower salience on the agenda, and calls Python to write a short"
        " line. Comparable as to the agenda only: matching is in C, the line says only what fired, nothing is rated,"
        " and no reasons are kept.",
        "py_trees: a tick of a selector in which so many behaviours fail before one succeeds. It has no agenda: it"
        " asks every behaviour every time, which is what is shown; a tree with little to ask is a better use of it.",
        "Memory: resident set of this process; lines are made and written to the null device. The mission is decided"
        " again from its observations; its knowledge sources include perception, but no camera and no wheels.",
        *(f"{peer} is not installed: .venv/bin/pip install '.[peers]'." for peer in absent),
    )
