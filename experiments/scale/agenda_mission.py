"""Cost of scheduler, board and journal in a real mission, beside its knowledge sources."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace

from blackboard.board import View
from blackboard.change import Change, Posted
from blackboard.effect import Effect, Post, Revise
from blackboard.journal import Decision, decision_line
from blackboard.knowledge_source import KnowledgeSource
from blackboard.scheduler import Scheduler
from experiments.wrappers import WrappedSource
from harvey.simulation.run import run_mission
from harvey.wiring import knowledge_sources, servoing
from knowledge_sources.settings import DEFAULT
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
        sources_s: time in the knowledge sources' ``rate`` and ``act``.
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

    def rate(self, view: View, trigger: Change) -> float | None:
        began_s = time.process_time()
        rating = super().rate(view, trigger)
        self.spent_s += time.process_time() - began_s
        return rating

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        began_s = time.process_time()
        effects = tuple(super().act(view, trigger))
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
