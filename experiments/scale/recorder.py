"""Recording: its time per cycle beside the frames, and its size."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from blackboard.journal import Decision, decision_line
from experiments.report import Cell, Report
from harvey.simulation.run import build_robot_model, run_mission
from logs.recording.loggers.frames import Frames
from logs.recording.stream import FLUSH_CYCLES
from logs.recording.writer import RecordingWriter, logger_classes
from sim.body.simulated_body import SimulatedBody
from sim.scenario import load_scenario
from sim.stage import Stage, build_stage
from world_models.files.world_files import load_world
from world_models.frames import Pose2

SCENARIOS, QUICK_SCENARIOS = ("lab-to-allens-office", "bump", "hallway-kidnap"), ("forty-foot-hallway",)
PASSES = 5
"""Repeats; the best time of each cycle counts, so that other load on the machine counts less."""

BUDGET_MS, BUDGET_MB = 1.0, 30.0
MS, MB, MINUTE_S = 1e3, 1e6, 60.0
REST, FRAMES, ALL = "beside the frames", "the frames", "everything"

Times = NDArray[np.float64]
Step = tuple[Decision, str, Pose2, float]
"""A decision, its line in the journal, the robot's true pose and the time [s]."""


def run(quick: bool, seed: int) -> Report:
    """Drive missions into three recorders: of everything, of the frames, of all but the frames."""
    rows: list[tuple[Cell, ...]] = []
    claims: list[tuple[str, bool]] = []
    for name in QUICK_SCENARIOS if quick else SCENARIOS:
        measured = _measure(build_stage(load_scenario(name)), seed)
        rows += [(name, *row) for row in measured.rows()]
        claims += [(f"{name}: {claim}", held) for claim, held in measured.claims()]
    columns = ("mission", "what", "required", "ours")
    return Report("Time and size of the recording", columns, tuple(rows), NOTES, tuple(claims))


NOTES = (
    "Times are processor time of all threads of this process per cycle: waiting for other work on the machine does"
    " not count, though a shared core is slower.",
    "In the mission: each decision goes to three recorders one after the other, each with its own file; the rest of"
    " the mission's time is its time without a recorder. The first recorder, all but the frames, also pays for what"
    " rerun loads on its first use, about a tenth of a second.",
    f"Repeated: the same decisions again, for each cycle the best time of {PASSES}.",
    f"The decision's JSON line is made before, by the journal. One cycle in {FLUSH_CYCLES} writes to disk what was"
    " kept: it is in the means, and beyond the 95th percentile.",
    "Sizes are of the whole recording, frames and decisions included.",
)


class _Figures:
    """Figures of one mission."""

    def __init__(
        self, driven: Times, repeated: Times, without_ms: float, size: int, robot_s: float, wall_s: float
    ) -> None:
        """``driven``, ``repeated``: (3, cycles) [ms] for all but the frames, the frames, everything."""
        self._driven, self._repeated = driven, repeated
        self._without_ms, self._size_mb, self._robot_s, self._wall_s = without_ms, size / MB, robot_s, wall_s

    def rows(self) -> list[tuple[Cell, ...]]:
        cycles = self._driven.shape[1]
        return [
            ("cycles", None, cycles),
            ("cycle without recorder, mean [ms]", None, self._without_ms),
            ("cycle with it, mean [ms]", None, self._without_ms + float(self._driven[2].mean())),
            *(row for name, times in (("in the mission", self._driven), ("repeated", self._repeated))
              for row in _spread(name, times)),
            ("MB per minute of the robot's time", BUDGET_MB, self._size_mb * MINUTE_S / self._robot_s),
            ("MB per minute of the mission's processor time", None, self._size_mb * MINUTE_S / self._wall_s),
            ("MB in all", None, self._size_mb),
        ]

    def claims(self) -> list[tuple[str, bool]]:
        return [
            (f"under {BUDGET_MS:g} ms per cycle beside the frames, mean and median, repeated",
             bool(max(self._repeated[0].mean(), np.median(self._repeated[0])) < BUDGET_MS)),
            (f"under {BUDGET_MB:g} MB per minute", self._size_mb * MINUTE_S / self._robot_s < BUDGET_MB),
        ]


def _spread(where: str, times: Times) -> list[tuple[Cell, ...]]:
    rest, pictures, everything = times
    return [
        (f"{where}, {REST}: mean [ms]", BUDGET_MS, float(rest.mean())),
        (f"{where}, {REST}: median [ms]", BUDGET_MS, float(np.median(rest))),
        (f"{where}, {REST}: 95th percentile [ms]", None, float(np.percentile(rest, 95))),
        (f"{where}, {FRAMES}: mean [ms]", None, float(pictures.mean())),
        (f"{where}, {ALL}: mean [ms]", None, float(everything.mean())),
    ]


@dataclass(frozen=True, eq=False)
class _Watched(Stage):
    """A stage that keeps the bodies it made, as a sink gets decisions but not the truth."""

    bodies: list[SimulatedBody] = field(default_factory=list)

    def body(self, seed: int) -> SimulatedBody:
        self.bodies.append(super().body(seed))
        return self.bodies[-1]


def _measure(stage: Stage, seed: int) -> _Figures:
    """Drive the mission once, then record its decisions again."""
    steps: list[Step] = []
    watched = _Watched(**{f.name: getattr(stage, f.name) for f in fields(stage)})
    with TemporaryDirectory() as folder:
        bench = _Bench(stage, Path(folder) / "driven")

        def sink(decision: Decision) -> None:
            truth = watched.bodies[0].truth
            steps.append((decision, decision_line(decision), truth.world_from_robot, truth.time_s))
            bench.record(steps[-1])

        began_s = time.process_time()
        result = run_mission(watched, seed, sinks=(sink,))
        spent_s = time.process_time() - began_s
        driven = bench.close()
        repeated = [_record_again(stage, Path(folder) / f"repeat-{number}", steps) for number in range(PASSES)]
        size = (Path(folder) / "driven" / f"{ALL}.rrd").stat().st_size
    without_ms = (MS * spent_s - float(driven.sum())) / len(steps)
    return _Figures(driven, np.min(repeated, axis=0), without_ms, size, result.sim_time_s, spent_s)


def _record_again(stage: Stage, folder: Path, steps: Sequence[Step]) -> Times:
    bench = _Bench(stage, folder)
    for step in steps:
        bench.record(step)
    return bench.close()


class _Bench:
    """Three recorders side by side, each with its own file and stopwatch."""

    def __init__(self, stage: Stage, folder: Path) -> None:
        folder.mkdir()
        world, self._line = load_world(stage.scenario.world), ""
        robot = build_robot_model(stage.scenario, world)
        self._recorders = []
        for name in (REST, FRAMES, ALL):
            wanted = [one for one in logger_classes() if name == ALL or (one is Frames) == (name == FRAMES)]
            self._recorders.append(RecordingWriter(
                folder / f"{name}.rrd", world=world, camera=robot.camera, mount=robot.mount, title=name,
                recording_id=name, line_of=lambda _decision: self._line, loggers=wanted))
        self._times_ms: list[list[float]] = [[] for _ in self._recorders]

    def record(self, step: Step) -> None:
        """Give one decision to each recorder."""
        decision, self._line, truth, sim_time_s = step
        for recorder, times_ms in zip(self._recorders, self._times_ms, strict=True):
            began_s = time.process_time()
            recorder.truth(truth, sim_time_s)
            recorder(decision)
            times_ms.append(MS * (time.process_time() - began_s))

    def close(self) -> Times:
        """Return (3, cycles) [ms]; closing the recording counts with the last cycle."""
        for recorder, times_ms in zip(self._recorders, self._times_ms, strict=True):
            began_s = time.process_time()
            recorder.close()
            times_ms[-1] += MS * (time.process_time() - began_s)
        return np.array(self._times_ms)
