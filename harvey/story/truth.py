"""How far the belief was from the truth in a cycle, or at its worst, as the recording of a simulated run tells."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from harvey.errors import BadInput
from harvey.run_files.run_directory import RunDirectory
from harvey.run_files.run_head import SIMULATOR, RunHead
from harvey.why.history import History
from harvey.why.sentences import value_of
from logs.reader import read_true_track
from world_models.entries.location import Hypothesis
from world_models.frames import Pose2, wrap_angle
from world_models.words import degrees, metres


@dataclass(frozen=True, slots=True)
class TrueError:
    """The belief that was held in a cycle against the truth.

    Attributes:
        off_m, off_rad: distance and turn from the true pose to the believed one.
        sigma_m, sigma_rad: how sure the belief was; of the place the largest standard deviation.
        ref: the belief.
    """

    cycle: int
    off_m: float
    off_rad: float
    sigma_m: float
    sigma_rad: float
    ref: str

    def words(self) -> str:
        """``63 mm and 0.1 degrees from where it believed to be (sure to 10 mm and 0.1 degrees)``."""
        sure = f"sure to {metres(self.sigma_m)} and {degrees(self.sigma_rad)}"
        return f"{metres(self.off_m)} and {degrees(abs(self.off_rad))} from where it believed to be ({sure})"


def read_errors(run: RunDirectory, history: History) -> tuple[TrueError, ...]:
    """The error of each belief that was held, in the order of time, against the truth in the cycle in which it came.

    Raises:
        BadInput: it is not a run of the simulator, or it has no recording, or its world's file has changed.
    """
    return tuple(_errors(run, history))


def error_at(run: RunDirectory, history: History, cycle: int) -> TrueError | None:
    """The error in a cycle, also where the belief is older; None before the first. Raises BadInput as above."""
    found = [*_errors(run, history, cycle)]
    return found[-1] if found else None


def _errors(run: RunDirectory, history: History, at: int | None = None) -> Iterator[TrueError]:
    head = RunHead.read(run.path)
    if head.kind != SIMULATOR:
        raise BadInput(f"{run.path}: expected a run of the simulator, which alone knows the truth, got one on hardware")
    if not run.recording.is_file():
        raise BadInput(f"{run.path}: expected its recording, where the truth is, got none (harvey repair {run.path}"
                       " draws it)")
    world, track = head.load_world(), read_true_track(run.recording)
    records = [(record, value) for record in history.of_kind("Hypothesis", until=at)
               if record.change != "Retracted" and (value := value_of(record, Hypothesis)).is_held]
    for record, value in records[-1:] if at is not None else records:
        cycle = record.cycle if at is None else at
        true = _pose_at(track, cycle)
        if true is not None:
            believed = value.world_from_robot(world)
            yield TrueError(cycle, believed.distance_to(true), wrap_angle(believed.heading_rad - true.heading_rad),
                            value.sigma_m, value.sigma_rad, record.ref)


def _pose_at(track: Sequence[tuple[int, float, float, float]], cycle: int) -> Pose2 | None:
    """Where the robot truly was in a cycle: it is recorded whenever it has moved."""
    before = bisect_right(track, cycle, key=lambda moment: moment[0])
    return Pose2(*track[before - 1][1:]) if before else None


def sigmas(error: TrueError) -> float:
    """The error of the place in standard deviations."""
    return error.off_m / error.sigma_m if error.sigma_m > 0.0 else math.inf
