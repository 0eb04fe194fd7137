"""Time of perception per frame: tracking and correction, and a milestone from frame to verdict."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence

import numpy as np

from blackboard.board import View
from blackboard.change import Change
from blackboard.effect import Effect
from blackboard.knowledge_source import KnowledgeSource
from experiments.report import Cell, Report
from experiments.wrappers import WrappedSource
from harvey.simulation.run import run_mission
from harvey.wiring import knowledge_sources
from knowledge_sources.settings import Settings
from sim.scenario import load_scenario
from sim.stage import build_stage
from world_models.entries.body import Frame

SCENARIOS, QUICK_SCENARIOS = ("forty-foot-hallway", "lab-to-allens-office"), ("forty-foot-hallway",)
DRIVES = 6
"""Drives of each mission. They give the same acts in the same order; the best time of each act counts, so that other
load on the machine counts less. The first drive compiles."""
TRACK, NEW_LANDMARKS = "correlator_tracker", "correlator_tracker, new landmarks"
MILESTONE = ("line_finder", "matcher", "med_r_and_t", "milestone_judge")
MAX_TRACK_MS, MAX_MILESTONE_MS = 5.0, 33.0
NOTES = (
    "Whole acts of the knowledge sources, as the scheduler calls them, on simulated frames of 512 x 512 px;"
    " decoding the JPEG and making the entries are included.",
    f"Processor time of the one thread; of each act the best of {DRIVES} drives of the same mission.",
    "A milestone's time is the sum of its four acts.",
)

Times = dict[str, list[float]]


class _Timed(WrappedSource):
    """A knowledge source whose acts are timed."""

    def __init__(self, inner: KnowledgeSource, times: Times) -> None:
        super().__init__(inner)
        self._times = times

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        began_s = time.thread_time()
        effects = tuple(super().act(view, trigger))
        self._times.setdefault(_act(self.name, trigger), []).append(1000.0 * (time.thread_time() - began_s))
        return effects


def _act(name: str, trigger: Change) -> str:
    """Name an act; the tracker also takes new landmarks, when no frame is tracked."""
    return NEW_LANDMARKS if name == TRACK and not isinstance(trigger.entry.value, Frame) else name


def run(quick: bool, seed: int) -> Report:
    """Time the acts of knowledge sources in whole missions."""
    times: Times = {}
    for scenario in QUICK_SCENARIOS if quick else SCENARIOS:
        drives = [_time_acts(scenario, seed) for _ in range(DRIVES)]
        for name in drives[0]:
            times.setdefault(name, []).extend(np.min([drive[name] for drive in drives], axis=0).tolist())
    chain = np.sum([times[name] for name in MILESTONE], axis=0).tolist()
    track = times[TRACK]
    rows = [
        ("track and correct, one frame", MAX_TRACK_MS, *_figures(track)),
        ("  new landmarks, after a milestone", None, *_figures(times[NEW_LANDMARKS])),
        ("milestone, frame to verdict", MAX_MILESTONE_MS, *_figures(chain)),
        *((f"  {name}", None, *_figures(times[name])) for name in MILESTONE),
    ]
    return Report(
        "Time of perception per frame, one core [ms]",
        ("what", "required at most", "frames", "median", "95th percentile"),
        tuple(rows),
        (*NOTES, f"Missions: {', '.join(QUICK_SCENARIOS if quick else SCENARIOS)}, seed {seed}."),
        (
            (f"track and correct within {MAX_TRACK_MS:.0f} ms (median)", float(np.median(track)) <= MAX_TRACK_MS),
            (f"a milestone within {MAX_MILESTONE_MS:.0f} ms (95th percentile)",
             float(np.percentile(chain, 95)) <= MAX_MILESTONE_MS),
        ),
    )


def _time_acts(scenario: str, seed: int) -> Times:
    """Drive a mission and time each act."""
    times: Times = {}
    timed = frozenset((TRACK, *MILESTONE))

    def sources(settings: Settings) -> Sequence[KnowledgeSource]:
        return [_Timed(ks, times) if ks.name in timed else ks for ks in knowledge_sources(settings)]

    run_mission(build_stage(load_scenario(scenario)), seed, sources=sources)
    return times


def _figures(times_ms: Sequence[float]) -> tuple[Cell, ...]:
    return len(times_ms), float(np.median(times_ms)), float(np.percentile(times_ms, 95))
