"""Load for a board without a robot: activations that are created, rated, queued, ended and journalled."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from blackboard import Change, Effect, KnowledgeSource, Level, Post, Revise, Scheduler, View, Watch, inference
from logs.journal_file import JournalFile

STEPS = 20
"""Number of distinct ratings: knowledge sources have a few, so many activations are rated alike."""
PART_CYCLES = 1000
"""Cycles per measurement."""


@inference()
@dataclass(frozen=True, slots=True)
class Task:
    """A task that is revised for ever.

    Attributes:
        draw: 31 random bits, from which the next ones follow.
        rating: of the activation that revises it next.
    """

    draw: int
    rating: float

    @staticmethod
    def of(draw: int) -> Task:
        return Task(draw, (1 + (draw >> 16) % STEPS) / STEPS)

    def next(self) -> Task:
        return Task.of((self.draw * 1103515245 + 12345) & 0x7FFFFFFF)


class Worker(KnowledgeSource):
    """Revises a task, which triggers the next activation."""

    level = Level.PLAN
    on = (Watch(Task),)
    writes = (Task,)

    def rate(self, case: Change) -> float:
        rating: float = case.entry.value.rating
        return rating

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        yield Revise(trigger.entry, trigger.entry.value.next(), (trigger.entry,))


@dataclass(frozen=True, slots=True)
class Speed:
    """Time per ended activation with about ``pending`` pending: best and median part [s]."""

    pending: int
    best_s: float
    median_s: float


def measure(numbers_pending: Sequence[int], parts: int, seed: int) -> list[Speed]:
    """Measure processor time with each number pending, in parts of PART_CYCLES cycles, with the journal in a file.

    Parts of different numbers alternate, so that a machine that is slow for a while slows all of them.
    """
    rng = np.random.default_rng(seed)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()))
        schedulers = []
        for pending in numbers_pending:
            journal = JournalFile(folder / f"{pending}.jsonl")
            stack.callback(journal.close)
            schedulers.append(_fill(Scheduler([Worker()], sinks=[journal]), pending, rng))
        rounds = [[_measure_part_s(scheduler) for scheduler in schedulers] for _ in range(parts)]
    return [Speed(pending, min(times_s), sorted(times_s)[parts // 2])
            for pending, times_s in zip(numbers_pending, zip(*rounds, strict=True), strict=True)]


def _fill(scheduler: Scheduler, tasks: int, rng: np.random.Generator) -> Scheduler:
    scheduler.post([Post(Task.of(int(draw))) for draw in rng.integers(1 << 31, size=tasks)], "user")
    scheduler.step()
    return scheduler


def _measure_part_s(scheduler: Scheduler) -> float:
    """Measure the processor time per activation over one part [s]."""
    activations, began_s = 0, time.process_time()
    for _ in range(PART_CYCLES):
        decision = scheduler.step()
        activations += 0 if decision is None else len(decision.activated)
    return (time.process_time() - began_s) / activations
