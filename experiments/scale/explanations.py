"""Does every decision of recorded missions rest on something, how fast is ``why``, and does a replay decide the same?

Missions of every scenario, faulty ones included, are driven and kept; then every decision is walked down to goal, model
or camera frame, ``harvey why`` is asked as a user would ask it, in a process of its own, and the run is decided again
from its observations.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from experiments.report import Report
from experiments.scale.long_journal import HOUR_CYCLES, write_hour
from experiments.trials import campaign_folder, run_trials
from harvey.campaign.campaign import Task, run_task
from harvey.run_files.run_directory import RunDirectory
from harvey.why.journal import JournalHistory
from harvey.why.reach import GOAL, KINDS, MODEL, SENSOR, check
from sim.scenario import list_scenarios

MISSIONS = 100
SHORT_CYCLES = "25"
TRIES = 2


@dataclass(frozen=True, slots=True)
class Explained:
    """What was found of one mission.

    Attributes:
        scenario, seed, outcome: of the mission.
        decisions: all; explained: those that rest on something; goal, model, sensor: how many reach each.
        why_s: how long ``harvey why`` took for the outcome, start of the process included.
        same: how many decisions a replay decides the same, to the byte.
    """

    scenario: str
    seed: int
    outcome: str
    decisions: int
    explained: int
    goal: int
    model: int
    sensor: int
    why_s: float
    same: int


@dataclass(frozen=True, slots=True)
class Hour:
    """How long ``harvey why`` takes on an hour's journal: the best of some tries, by the clock and of the processor."""

    cycles: int
    megabytes: float
    clock_s: float
    processor_s: float


def run(quick: bool, seed: int) -> Report:
    """Measure. Quick: three missions of 25 cycles."""
    folder = campaign_folder("explanations", seed, quick=quick)
    tasks = _tasks(quick, seed, folder)
    found = sorted(run_trials(explained, tasks, Explained, folder, "mission"), key=lambda e: (e.scenario, e.seed))
    return _report(found, _hour(tasks[0]), seed, folder)


def _tasks(quick: bool, seed: int, folder: Path) -> list[Task]:
    names = ("bump", "hallway-kidnap", "lab-to-allens-office") if quick else list_scenarios()
    settings = (("limits.max_cycles", SHORT_CYCLES),) if quick else ()
    each = 1 if quick else -(-MISSIONS // len(names))
    pairs = [(name, seed + k) for k in range(each) for name in names]
    return [Task(name, settings, s, folder / f"{name}-{s}") for name, s in (pairs if quick else pairs[:MISSIONS])]


def explained(task: Task) -> Explained:
    """One mission, driven, and what is found of it."""
    if task.out is None:
        raise ValueError("expected a task that keeps its run, got one that keeps nothing")
    result = run_task(task)
    run = RunDirectory(task.out)
    found = check(JournalHistory(run.journal))
    return Explained(
        task.scenario, task.seed, result.outcome, found.decisions, found.reached, found.by_kind[GOAL],
        found.by_kind[MODEL], found.by_kind[SENSOR], _asked(run.path)[0], _same(run),
    )


def _same(run: RunDirectory) -> int:
    """How many decisions are the same when the run is decided again."""
    from harvey.agent import agent_of
    from harvey.run_files.run_head import RunHead
    from harvey.runner.replay import pictures_of, replay

    with agent_of(RunHead.read(run.path)) as agent:
        return sum(1 for told in replay(run, pictures_of(run), agent.scheduler()) if told.same)


def _asked(run: Path, *more: str) -> tuple[float, float]:
    """How long ``harvey why`` takes as a process of its own [s]: by the clock, and of the processor."""
    argv = [sys.executable, "-m", "harvey.cli", "why", str(run), *more]
    used, began = _used(), time.perf_counter()
    subprocess.run(argv, check=True, stdout=subprocess.DEVNULL, env={**os.environ, "PYTHONDONTWRITEBYTECODE": ""})
    return time.perf_counter() - began, _used() - used


def _used() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _hour(task: Task) -> Hour:
    """An hour's journal, made from a mission's, and the worst of three questions to it, each at its best."""
    if task.out is None:
        raise ValueError("expected a task that keeps its run, got one that keeps nothing")
    folder = task.out.parent / "an-hour"
    length = write_hour(task.out / "journal.jsonl", folder / "journal.jsonl")
    history = JournalHistory(folder / "journal.jsonl")
    motions = [ref for ref in history.refs if ref.startswith("MotorCommand-")] or [history.refs[-1]]
    questions = ((), (motions[len(motions) // 2],), ("--at", str(history.cycles[-1] // 2)))
    best = [min(_asked(folder, *question) for _ in range(TRIES)) for question in questions]
    clock_s, processor_s = max(best)
    return Hour(len(history.cycles), length / 1e6, clock_s, processor_s)


def _report(found: Sequence[Explained], hour: Hour, seed: int, folder: Path) -> Report:
    names = list(dict.fromkeys(e.scenario for e in found))
    rows = [_row(name, [e for e in found if e.scenario == name]) for name in names]
    decisions, explained_, same = (sum(getattr(e, key) for e in found) for key in ("decisions", "explained", "same"))
    equal = sum(e.same == e.decisions for e in found)
    return Report(
        "Decisions of recorded missions that rest on a goal, a model element or a camera frame",
        ("scenario", "missions", "reached", "decisions", "explained", "to the goal", "to the model", "to a frame",
         "why s", "replays equal"),
        (*rows, _row("all", found)),
        (
            f"Seeds from {seed}; the runs are kept under {folder}. why s: the slowest harvey why RUN, start of the"
            " process included, while two processes drove missions.",
            "A decision is explained if everything that it made rests on the goal, the model or a camera frame by"
            " reasons that are all in the journal; where it made nothing, what woke the expert has to.",
            f"An hour: {hour.cycles} decisions, {hour.megabytes:.0f} MB of journal, one mission told over and over:"
            f" harvey why takes {hour.clock_s:.2f} s by the clock, {hour.processor_s:.2f} s of the processor (the"
            f" slowest of three questions, each the best of {TRIES}; no index is kept).",
            "Nobody else measures this, so there is no figure of the paper's or a peer's.",
        ),
        (
            (f"all of {decisions} decisions are explained ({explained_})", explained_ == decisions),
            (f"all of {len(found)} missions are decided again to the byte ({equal}; {same} of {decisions} decisions)",
             equal == len(found)),
            (f"why answers in less than 1 s on a recording of an hour, {HOUR_CYCLES} decisions or more",
             hour.clock_s < 1.0 and hour.cycles >= HOUR_CYCLES),
        ),
    )


def _row(name: str, found: Sequence[Explained]) -> tuple[str | int | float, ...]:
    totals = [sum(getattr(e, key) for e in found) for key in ("decisions", "explained", *KINDS)]
    reached = sum(e.outcome == "reached" for e in found)
    return (name, len(found), reached, *totals, max(e.why_s for e in found),
            f"{sum(e.same == e.decisions for e in found)} of {len(found)}")
