"""What the mechanism costs in a real mission, beside the experts, the camera and the wheels."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace

from blackboard.board import View
from blackboard.change import Change
from blackboard.effect import Effect, Post
from blackboard.journal import Decision, JournalLines
from blackboard.knowledge_source import KnowledgeSource
from blackboard.scheduler import Scheduler
from harvey.retention import RETENTION
from harvey.simulation.run import robot_model, run_mission
from harvey.wiring import knowledge_sources, servoing
from sim.scenario import Scenario, load_scenario
from sim.stage import set_stage


@dataclass(frozen=True, slots=True)
class Cost:
    """Of one mission's cycles.

    Attributes:
        cycles, activations, obviated: how many.
        experts_s: processor time in ratings and acts.
        engine_s: in everything else of the cycles: board, indexes, agenda, choice, forgetting.
        lines_s: in making the journal's lines.
        most_pending: activations that waited at once.
        entries: on the board in the end.
    """

    cycles: int
    activations: int
    obviated: int
    experts_s: float
    engine_s: float
    lines_s: float
    most_pending: int
    entries: int

    @property
    def overhead(self) -> float:
        """What part of a cycle's time is not the experts'."""
        return (self.engine_s + self.lines_s) / (self.engine_s + self.lines_s + self.experts_s)


class _Timed(KnowledgeSource):
    """An expert with a stopwatch."""

    def __init__(self, inner: KnowledgeSource) -> None:
        self._inner = inner
        for name in ("level", "closes", "watches", "writes"):
            setattr(self, name, getattr(inner, name))
        self.spent_s = 0.0

    @property
    def name(self) -> str:
        return self._inner.name

    def rate(self, view: View, trigger: Change) -> float | None:
        began_s = time.process_time()
        rating = self._inner.rate(view, trigger)
        self.spent_s += time.process_time() - began_s
        return rating

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        began_s = time.process_time()
        effects = tuple(self._inner.act(view, trigger))
        self.spent_s += time.process_time() - began_s
        return effects


def mission_cost(cycles: int | None, seed: int) -> Cost:
    """Run the laboratory's mission, then decide it once more from its observations with a stopwatch."""
    scenario = load_scenario("lab-to-allens-office")
    if cycles is not None:
        scenario = replace(scenario, limits=replace(scenario.limits, max_cycles=cycles))
    recorded: list[Decision] = []
    run_mission(set_stage(scenario), seed, sinks=[recorded.append])
    return _decided_again(scenario, recorded)


def _decided_again(scenario: Scenario, recorded: list[Decision]) -> Cost:
    timed = [_Timed(source) for source in knowledge_sources(robot_model(scenario))]
    scheduler = Scheduler(timed, servoing=servoing(scenario.servo), retention=RETENTION)
    lines, lines_s, steps_s = JournalLines(), 0.0, 0.0
    for decision in recorded:
        for change in decision.observed:
            scheduler.tell([Post(change.entry.value, change.entry.because)], change.entry.author)
        began_s = time.process_time()
        again = scheduler.step()
        steps_s += time.process_time() - began_s
        if again is None:
            break
        began_s = time.process_time()
        lines(again)
        lines_s += time.process_time() - began_s
    experts_s = math.fsum(source.spent_s for source in timed)
    return Cost(
        len(recorded), sum(len(d.activated) for d in recorded), sum(len(d.obviated) for d in recorded),
        experts_s, steps_s - experts_s, lines_s, max(d.pending for d in recorded), len(scheduler.view),
    )
