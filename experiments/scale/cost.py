"""Where the processor time of whole missions goes: by part of the program, by knowledge source, and by method.

Each mission is driven as ``harvey run`` drives it, with its files, in a fresh process: importing modules, loading
compiled code and setting the stage count. Every few milliseconds of processor time it is seen which functions are being
called. Nothing is wrapped or traced, so what is measured is what runs when nobody measures.
"""

from __future__ import annotations

import re
import signal
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType

from experiments.report import Cell, Report
from harvey.campaign.mission_task import Task, run_task
from harvey.errors import BadInput

PERIOD_S = 0.004
"""Processor time from sample to sample [s]; many kernels count in steps of as much."""
ROOMS, FIRST_SEED = 58, 1
MIN_SHARE, METHODS = 0.01, 12
"""A knowledge source has a row of its own from this share of a mission's time; so many methods are shown."""
ROOT = f"{Path(__file__).parents[2]}/"
MODULES, COMPILED, REST, THREADS = "interpreter, modules", "loading compiled code", "rest", "other threads"
PARTS: Mapping[str, str] = {
    MODULES: "<frozen importlib",
    COMPILED: r".*/numba/core/dispatcher\.py",
    "stage and agent": r"sim/stage\.py:(build_stage|Stage\.body)$|harvey/agent\.py|logs/run_head\.py"
                       r"|harvey/campaign/mission_task\.py:Task\.",
    "scheduler, board, conditions": r"blackboard/scheduler\.py",
    "body: pictures": r"sim/body/body_camera\.py:BodyCamera\.take_",
    "building's port": r"harvey/runner/ports\.py:(WorldPort|tell_robot|build_scheduler)",
    "body: motion, senses": r"harvey/runner/ports\.py",
    "referee": r"harvey/simulation/(referee|contacts)\.py",
    "journal, camera file": r"logs/(journal_file|mjpeg_file|disk)\.py|blackboard/journal\.py",
    "recording": r"logs/recording/",
}
"""By part: how the names of its functions begin, as file:name. A sample counts for the innermost part whose function is
being called, and for the modules wherever one is imported. (Compiled code that returns arrays is seen in a function of
numba's that makes them: that is not loading.)"""
SOURCE = re.compile(r"knowledge_sources/(?!methods/|reads/)\w+/(\w+)\.py:")
METHOD = re.compile(r"(?:knowledge_sources/methods|sim/render|world_models/visibility)/(?:.*/)?(\w+)\.py:([\w.]+)$")


class Sampler:
    """A context manager that samples the main thread; at its end, signal and timer are as they were.

    A sample counts for the processor time since the one before, so that all add up to the time of the thread. (A signal
    waits until a call of compiled code is over: by their number, long calls would count too little.)

    Attributes:
        parts, methods: processor time by part, and by public function with all that it calls [s].
    """

    def __init__(self) -> None:
        self.parts, self.methods = defaultdict[str, float](float), defaultdict[str, float](float)

    def __enter__(self) -> Sampler:
        if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
            raise BadInput("expected the main thread of a POSIX system, whose timer of processor time is needed")
        self._last_s, self._handler = time.thread_time(), signal.signal(signal.SIGPROF, self._sample)
        self._timer = signal.setitimer(signal.ITIMER_PROF, PERIOD_S, PERIOD_S)
        return self

    def __exit__(self, *_exception: object) -> None:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        self._sample(signal.SIGPROF, sys._getframe(1))
        signal.signal(signal.SIGPROF, self._handler)
        signal.setitimer(signal.ITIMER_PROF, *self._timer)

    def _sample(self, _signal: int, frame: FrameType | None) -> None:
        now_s = time.thread_time()
        took_s, self._last_s = now_s - self._last_s, now_s
        part, methods = "", set[str]()
        while frame is not None:
            of, method = _find_part(frame.f_code.co_filename, frame.f_code.co_qualname)
            part = of if of == MODULES else part or of
            methods.add(method)
            frame = frame.f_back
        self.parts[part or REST] += took_s
        for method in methods - {""} if part not in (MODULES, COMPILED) else ():
            self.methods[method] += took_s


@cache
def _find_part(file: str, name: str) -> tuple[str, str]:
    """The part, or knowledge source, and the method of a function; "" where it has none."""
    full = f"{file.removeprefix(ROOT)}:{name}"
    source, method = SOURCE.match(full), METHOD.match(full)
    is_public = method is not None and not re.search(r"(^|\.)_", method[2])
    part = source[1] if source else next((part for part, begins in PARTS.items() if re.match(begins, full)), "")
    return part, f"{method[1]}.{method[2]}" if method and is_public else ""


@dataclass(frozen=True, slots=True)
class Cost:
    """Processor time of a process [s]: ``parts`` add up to ``total_s``; ``methods`` may call each other."""

    total_s: float
    parts: Mapping[str, float]
    methods: Mapping[str, float]


def measure(work: Callable[[], object]) -> Cost:
    """What this process has spent when the work is done; what it spent before counts for importing modules."""
    before_s = time.process_time()
    with Sampler() as sampler:
        work()
    total_s = time.process_time()
    sampler.parts[MODULES] += before_s
    sampler.parts[THREADS] += total_s - sum(sampler.parts.values())
    return Cost(total_s, dict(sampler.parts), dict(sampler.methods))


def _drive(task: Task) -> tuple[Cost, str, float]:
    """What a mission costs, how it ended, and the robot's own time [s]."""
    ends = []
    cost = measure(lambda: ends.append(run_task(task)))
    return cost, ends[0].outcome, ends[0].sim_time_s


def run(quick: bool, seed: int) -> Report:
    """Drive four missions, each in a process of its own; ``quick``: the first alone."""
    from experiments.generated.missions import write_large_mission

    with TemporaryDirectory() as name, ProcessPoolExecutor(
            1, mp_context=get_context("spawn"), max_tasks_per_child=1) as processes:
        folder, drawn = Path(name), FIRST_SEED + seed
        scenarios = {"mission": "lab-to-allens-office", "kidnap": "hallway-kidnap", "among things": "cluttered-hallway"}
        scenarios = dict(list(scenarios.items())[:1]) if quick else {
            **scenarios, f"lost in {ROOMS} rooms": str(write_large_mission(folder, drawn, ROOMS))}
        driven = list(processes.map(
            _drive, [Task(scenario, (), drawn, folder / case) for case, scenario in scenarios.items()]))
    costs, outcomes, robot_s = zip(*driven, strict=True)
    return Report(
        "Processor time of missions, whole process [s]", ("what", *scenarios),
        (*_rows(costs), ("outcome", *outcomes), ("robot's own time", *robot_s)),
        (
            f"Missions: {', '.join(Path(scenario).stem for scenario in scenarios.values())}, seed {drawn}, recorded as"
            " harvey run records them. Parts and knowledge sources add up to the total.",
            f"Sampled every {1000 * PERIOD_S:.0f} ms of processor time: less than a tenth of a second is known roughly."
            " The time of Python's garbage collector counts for the code in which it runs."
            " Other load on the machine makes all of it longer: compare two versions in turn.",
            "A knowledge source's time is its acts, with the methods that they call, and what it finds when asked."
            " A method's is with all that it calls, so methods may be within each other, without loading.",
        ),
    )


def _rows(costs: Sequence[Cost]) -> Iterator[tuple[Cell, ...]]:
    """The totals, the parts, the knowledge sources and the methods, the most expensive first."""
    yield "total", *(round(cost.total_s, 2) for cost in costs)
    parts = [*PARTS, REST, THREADS]
    sources = {name for cost in costs for name in cost.parts if name not in parts}
    large = {name for cost in costs for name in sources if cost.parts.get(name, 0.0) >= MIN_SHARE * cost.total_s}
    for names in (parts, large):
        yield from _times(names, [cost.parts for cost in costs])
    others = [sum(cost.parts.get(name, 0.0) for name in sources - large) for cost in costs]
    yield "  other knowledge sources", *(round(seconds, 2) for seconds in others)
    yield f"methods, the {METHODS} most expensive", *(None for _ in costs)
    methods = {name for cost in costs for name in cost.methods}
    yield from islice(_times(methods, [cost.methods for cost in costs]), METHODS)


def _times(names: Iterable[str], times: Sequence[Mapping[str, float]]) -> Iterator[tuple[Cell, ...]]:
    total = {name: sum(case.get(name, 0.0) for case in times) for name in names}
    for name in sorted(total, key=lambda name: (-total[name], name)):
        yield f"  {name}", *(round(case.get(name, 0.0), 2) for case in times)
