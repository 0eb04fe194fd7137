"""The recorder: what the recording costs a cycle beside the pictures themselves, and how large it grows."""

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
from harvey.simulation.run import robot_model, run_mission
from logs.recording.loggers.frames import Frames
from logs.recording.stream import FLUSH_CYCLES
from logs.recording.writer import RecordingWriter, all_loggers
from sim.body.simulated_body import SimulatedBody
from sim.scenario import load_scenario
from sim.stage import Stage, build_stage
from world_models.frames import Pose2

SCENARIOS, QUICK_SCENARIOS = ("lab-to-allens-office", "bump", "hallway-kidnap"), ("forty-foot-hallway",)
PASSES = 5
"""Each cycle's time, told anew, is the best of so many: what else the machine does is none of the recorder's fault."""

BUDGET_MS, BUDGET_MB = 1.0, 30.0
MS, MB, MINUTE_S = 1e3, 1e6, 60.0
REST, PICTURES, ALL = "beside the pictures", "the pictures", "everything"

Times = NDArray[np.float64]
Told = tuple[Decision, str, Pose2, float]
"""A decision, its line in the journal, where the robot then truly was, and when."""


def run(quick: bool, seed: int) -> Report:
    """Missions whose decisions are told to recorders: of everything, of the pictures, of all but the pictures."""
    rows: list[tuple[Cell, ...]] = []
    claims: list[tuple[str, bool]] = []
    for name in QUICK_SCENARIOS if quick else SCENARIOS:
        measured = _measured(build_stage(load_scenario(name)), seed)
        rows += [(name, *row) for row in measured.rows()]
        claims += [(f"{name}: {claim}", held) for claim, held in measured.claims()]
    return Report("What the recorder costs", ("mission", "what", "required", "ours"), tuple(rows), NOTES, tuple(claims))


NOTES = (
    "Times are processor time of all threads of this process, milliseconds a cycle: waiting for other work on the"
    " machine does not count, though a core that is shared is slower.",
    "In the mission: as a decision is made it is told to three recorders one after the other, each with its own file;"
    " what is left of the mission's time is what it takes without a recorder. The first of them, all but the pictures,"
    " also pays for what rerun loads on its first use, a tenth of a second or so.",
    f"Told anew: the same decisions once more, a cycle's time the best of {PASSES}.",
    f"The decision's JSON line is the journal's work and made before. One cycle in {FLUSH_CYCLES} sends to the disk"
    " what was kept: it is in the means, and beyond the 95th percentile.",
    "Sizes are those of the whole recording, pictures and decisions included.",
)


class _Measured:
    """The figures of one mission."""

    def __init__(self, driven: Times, anew: Times, without_ms: float, size: int, robot_s: float, wall_s: float) -> None:
        """``driven``, ``anew``: (3, cycles) [ms] for all but the pictures, the pictures, everything."""
        self._driven, self._anew = driven, anew
        self._without_ms, self._size_mb, self._robot_s, self._wall_s = without_ms, size / MB, robot_s, wall_s

    def rows(self) -> list[tuple[Cell, ...]]:
        cycles = self._driven.shape[1]
        return [
            ("cycles", None, cycles),
            ("a cycle without recorder, mean [ms]", None, self._without_ms),
            ("a cycle with it, mean [ms]", None, self._without_ms + float(self._driven[2].mean())),
            *(row for name, times in (("in the mission", self._driven), ("told anew", self._anew))
              for row in _spread(name, times)),
            ("MB a minute of the robot's time", BUDGET_MB, self._size_mb * MINUTE_S / self._robot_s),
            ("MB a minute of the mission's processor time", None, self._size_mb * MINUTE_S / self._wall_s),
            ("MB in all", None, self._size_mb),
        ]

    def claims(self) -> list[tuple[str, bool]]:
        return [
            (f"under {BUDGET_MS:g} ms a cycle beside the pictures, mean and median, told anew",
             bool(max(self._anew[0].mean(), np.median(self._anew[0])) < BUDGET_MS)),
            (f"under {BUDGET_MB:g} MB a minute", self._size_mb * MINUTE_S / self._robot_s < BUDGET_MB),
        ]


def _spread(where: str, times: Times) -> list[tuple[Cell, ...]]:
    rest, pictures, everything = times
    return [
        (f"{where}, {REST}: mean [ms]", BUDGET_MS, float(rest.mean())),
        (f"{where}, {REST}: median [ms]", BUDGET_MS, float(np.median(rest))),
        (f"{where}, {REST}: 95th percentile [ms]", None, float(np.percentile(rest, 95))),
        (f"{where}, {PICTURES}: mean [ms]", None, float(pictures.mean())),
        (f"{where}, {ALL}: mean [ms]", None, float(everything.mean())),
    ]


@dataclass(frozen=True, eq=False)
class _Watched(Stage):
    """A stage that remembers the bodies that it made: a sink is told decisions, not the truth."""

    bodies: list[SimulatedBody] = field(default_factory=list)

    def body(self, seed: int) -> SimulatedBody:
        self.bodies.append(super().body(seed))
        return self.bodies[-1]


def _measured(stage: Stage, seed: int) -> _Measured:
    """Drive the mission once, then tell its decisions anew."""
    told: list[Told] = []
    watched = _Watched(**{f.name: getattr(stage, f.name) for f in fields(stage)})
    with TemporaryDirectory() as folder:
        bench = _Bench(stage, Path(folder) / "driven")

        def sink(decision: Decision) -> None:
            truth = watched.bodies[0].truth
            told.append((decision, decision_line(decision), truth.world_from_robot, truth.time_s))
            bench.tell(told[-1])

        began_s = time.process_time()
        result = run_mission(watched, seed, sinks=(sink,))
        spent_s = time.process_time() - began_s
        driven = bench.close()
        anew = [_told_anew(stage, Path(folder) / f"anew-{number}", told) for number in range(PASSES)]
        size = (Path(folder) / "driven" / f"{ALL}.rrd").stat().st_size
    without_ms = (MS * spent_s - float(driven.sum())) / len(told)
    return _Measured(driven, np.min(anew, axis=0), without_ms, size, result.sim_time_s, spent_s)


def _told_anew(stage: Stage, folder: Path, told: Sequence[Told]) -> Times:
    bench = _Bench(stage, folder)
    for one in told:
        bench.tell(one)
    return bench.close()


class _Bench:
    """Three recorders side by side, each with its own file and its own watch."""

    def __init__(self, stage: Stage, folder: Path) -> None:
        folder.mkdir()
        robot, self._line = robot_model(stage.scenario), ""
        self._recorders = []
        for name in (REST, PICTURES, ALL):
            loggers = all_loggers(robot.world, robot.camera, robot.mount, lambda _decision: self._line)
            wanted = [lg for lg in loggers if name == ALL or isinstance(lg, Frames) == (name == PICTURES)]
            self._recorders.append(RecordingWriter(
                folder / f"{name}.rrd", world=robot.world, camera=robot.camera, mount=robot.mount, title=name,
                recording_id=name, loggers=wanted))
        self._times_ms: list[list[float]] = [[] for _ in self._recorders]

    def tell(self, told: Told) -> None:
        """One decision to each recorder."""
        decision, self._line, truth, sim_time_s = told
        for recorder, times_ms in zip(self._recorders, self._times_ms, strict=True):
            began_s = time.process_time()
            recorder.truth(truth, sim_time_s)
            recorder(decision)
            times_ms.append(MS * (time.process_time() - began_s))

    def close(self) -> Times:
        """(3, cycles) [ms]; what it takes to end the recording counts with the last cycle."""
        for recorder, times_ms in zip(self._recorders, self._times_ms, strict=True):
            began_s = time.process_time()
            recorder.close()
            times_ms[-1] += MS * (time.process_time() - began_s)
        return np.array(self._times_ms)
