"""Time of perception per frame: tracking and correction, the floor, and a milestone from frame to verdict.

With continuous driving, all that is done between one picture and the next counts.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from blackboard import Decision, Effect, KnowledgeSource, View
from experiments.report import Cell, Report
from harvey.simulation.simulated_run import run_mission
from harvey.wiring import knowledge_sources
from knowledge_sources.settings import Settings
from sim.scenario import load_scenario, with_settings
from sim.stage import build_stage
from world_models.entries import CameraPicture

SCENARIOS, QUICK_SCENARIOS = ("forty-foot-hallway", "lab-to-allens-office"), ("forty-foot-hallway",)
DRIVES = 6
"""Drives of each mission. They give the same acts in the same order; the best time of each act counts, so that other
load on the machine counts less. The first drive compiles."""
DRIVES_ON_THE_MOVE = 2
"""Of the same mission on the move: 870 pictures each."""
TRACK, NEW_LANDMARKS = "correlator_tracker", "landmark_chooser"
MILESTONE = ("line_finder", "matcher", "med_r_and_t", "milestone_judge")
FLOOR = "floor_watcher"
ON_THE_MOVE = (("motion.continuous", "true"),)
PICTURES_PER_S = 30
MAX_TRACK_MS, MAX_MILESTONE_MS, MAX_PICTURE_MS = 5.0, 33.0, 1000.0 / PICTURES_PER_S
NOTES = (
    "Whole acts of the knowledge sources, as the scheduler calls them, on simulated frames of 512 x 512 px;"
    " decoding the JPEG and making the entries are included.",
    f"Processor time of the one thread; of each act the best of {DRIVES} drives of the same mission; on the move of"
    f" {DRIVES_ON_THE_MOVE}.",
    "A milestone's time is the sum of its four acts. On the move: all acts of all knowledge sources from one picture to"
    " the next, in the first of the missions, driven with motion.continuous.",
)

Times = dict[str, list[float]]


def _timed(source: KnowledgeSource, times: Times) -> KnowledgeSource:
    """A knowledge source whose acts are timed."""
    act = source.act

    def timed(view: View, case: Any) -> Iterable[Effect]:
        began_s = time.thread_time()
        effects = tuple(act(view, case))
        times.setdefault(source.name, []).append(1000.0 * (time.thread_time() - began_s))
        return effects

    object.__setattr__(source, "act", timed)
    return source


def run(quick: bool, seed: int) -> Report:
    """Time the acts of knowledge sources in whole missions."""
    times: Times = {}
    for scenario in QUICK_SCENARIOS if quick else SCENARIOS:
        drives = [_time_acts(scenario, seed) for _ in range(DRIVES)]
        for name in drives[0]:
            times.setdefault(name, []).extend(np.min([drive[name] for drive in drives], axis=0).tolist())
    moving = np.min([_time_pictures(SCENARIOS[0], seed) for _ in range(DRIVES_ON_THE_MOVE)], axis=0).tolist()
    chain = np.sum([times[name] for name in MILESTONE], axis=0).tolist()
    track, floor = times[TRACK], times.get(FLOOR, [])
    rows = [
        ("track and correct, one frame", MAX_TRACK_MS, *_figures(track)),
        ("  new landmarks, after a milestone", None, *_figures(times[NEW_LANDMARKS])),
        ("milestone, frame to verdict", MAX_MILESTONE_MS, *_figures(chain)),
        *((f"  {name}", None, *_figures(times[name])) for name in MILESTONE),
        *([("floor, one frame", MAX_MILESTONE_MS, *_figures(floor))] if floor else []),
        ("on the move, one picture", MAX_PICTURE_MS, *_figures(moving)),
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
            *([(f"the floor within {MAX_MILESTONE_MS:.0f} ms (95th percentile)",
                float(np.percentile(floor, 95)) <= MAX_MILESTONE_MS)] if floor else []),
            (f"on the move {PICTURES_PER_S} pictures a second, with all that is done (mean)",
             float(np.mean(moving)) <= MAX_PICTURE_MS),
        ),
    )


def _time_acts(scenario: str, seed: int) -> Times:
    """Drive a mission and time each act."""
    times: Times = {}
    timed = frozenset((TRACK, NEW_LANDMARKS, FLOOR, *MILESTONE))

    def sources(settings: Settings) -> Sequence[KnowledgeSource]:
        return [_timed(ks, times) if ks.name in timed else ks for ks in knowledge_sources(settings)]

    run_mission(build_stage(load_scenario(scenario)), seed, sources=sources)
    return times


def _time_pictures(scenario: str, seed: int) -> list[float]:
    """Drive a mission on the move and time what is done from each picture to the next [ms]."""
    acts: Times = {}
    pictures: list[float] = []

    def sources(settings: Settings) -> Sequence[KnowledgeSource]:
        return [_timed(ks, acts) for ks in knowledge_sources(settings)]

    def count(decision: Decision) -> None:
        if any(isinstance(change.entry.value, CameraPicture) for change in decision.observed):
            pictures.append(0.0)
        if pictures:
            pictures[-1] += sum(ms for times in acts.values() for ms in times)
        acts.clear()

    stage = build_stage(with_settings(load_scenario(scenario), dict(ON_THE_MOVE)))
    run_mission(stage, seed, sources=sources, sinks=(count,))
    return pictures


def _figures(times_ms: Sequence[float]) -> tuple[Cell, ...]:
    return len(times_ms), float(np.median(times_ms)), float(np.percentile(times_ms, 95))
