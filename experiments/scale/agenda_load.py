"""Work for a board without a robot: how many activations a second are made, rated, queued, ended and journalled."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from blackboard.board import View
from blackboard.change import Change, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.knowledge_source import KnowledgeSource
from blackboard.level import Level
from blackboard.scheduler import Scheduler
from logs.journal_file import JournalFile

STEPS = 20
"""Ratings come in so many steps: experts have a few, and many activations are rated alike."""
PART_CYCLES = 1000
"""Time is taken for so many cycles at once."""


@dataclass(frozen=True, slots=True)
class Task:
    """Something to be done again and again.

    Attributes:
        draw: 31 random bits, from which the next ones follow.
        rating: of who does it next.
    """

    draw: int
    rating: float

    @staticmethod
    def of(draw: int) -> Task:
        return Task(draw, (1 + (draw >> 16) % STEPS) / STEPS)

    def done(self) -> Task:
        return Task.of((self.draw * 1103515245 + 12345) & 0x7FFFFFFF)


class Worker(KnowledgeSource):
    """Does the task: revises it, which is the trigger for the next time."""

    level = Level.PLAN
    watches = (Watch(Task),)
    writes = (Task,)

    def rate(self, view: View, trigger: Change) -> float | None:
        rating: float = trigger.entry.value.rating
        return rating

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        yield Revise(trigger.entry, trigger.entry.value.done(), (trigger.entry,))


class Rival(KnowledgeSource):
    """Would do some tasks too, but is always rated lower; when the task is done its activation is obviated."""

    level = Level.PLAN
    watches = (Watch(Task),)
    writes = (Task,)

    def __init__(self, number: int, could: Callable[[Task], bool]) -> None:
        self._number, self._could = number, could

    @property
    def name(self) -> str:
        return f"rival_{self._number}"

    def rate(self, view: View, trigger: Change) -> float | None:
        return 0.0 if self._could(trigger.entry.value) else None

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        return ()


@dataclass(frozen=True, slots=True)
class Load:
    """Who is woken by a change: ``a_cycle`` activations in each cycle, of which one is executed, others obviated."""

    name: str
    a_cycle: float
    sources: Callable[[], list[KnowledgeSource]]


ONE = Load("a change wakes 1 expert", 1.0, lambda: [Worker()])
AS_IN_MISSIONS = Load(
    "a change wakes 1.375, as in missions", 1.375, lambda: [Worker(), Rival(1, lambda task: (task.draw >> 8) % 8 < 3)]
)
ALL = Load(
    "a change wakes 14", 14.0, lambda: [Worker(), *(Rival(number, lambda _task: True) for number in range(1, 14))]
)
LOADS = (ONE, AS_IN_MISSIONS, ALL)


@dataclass(frozen=True, slots=True)
class Speed:
    """With about ``pending`` activations that wait: time for one that comes to its end, best and median part [s]."""

    pending: int
    best_s: float
    usual_s: float


def measure(load: Load, waiting: Sequence[int], parts: int, seed: int) -> list[Speed]:
    """For each number that wait: fill an agenda, and run parts of PART_CYCLES cycles, the journal written to a file.

    The parts of all of them take turns, so that a machine that is slow for a while is so for all; processor time.
    """
    rng = np.random.default_rng(seed)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()))
        schedulers = []
        for pending in waiting:
            journal = JournalFile(folder / f"{pending}.jsonl")
            stack.callback(journal.close)
            schedulers.append(_filled(Scheduler(load.sources(), sinks=[journal]), round(pending / load.a_cycle), rng))
        rounds = [[_part_s(scheduler) for scheduler in schedulers] for _ in range(parts)]
    return [Speed(pending, min(took), sorted(took)[parts // 2])
            for pending, took in zip(waiting, zip(*rounds, strict=True), strict=True)]


def _filled(scheduler: Scheduler, tasks: int, rng: np.random.Generator) -> Scheduler:
    scheduler.tell([Post(Task.of(int(draw))) for draw in rng.integers(1 << 31, size=tasks)], "user")
    scheduler.step()
    return scheduler


def _part_s(scheduler: Scheduler) -> float:
    """Processor time of an activation that comes to its end [s]."""
    activations, began_s = 0, time.process_time()
    for _ in range(PART_CYCLES):
        decision = scheduler.step()
        activations += 0 if decision is None else len(decision.activated)
    return (time.process_time() - began_s) / activations
