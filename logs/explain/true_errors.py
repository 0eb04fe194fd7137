"""How far off the belief was: each belief and the truth, which only the simulator's recording has."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass

from logs.run_directory import RunDirectory
from logs.run_errors import BadInput
from logs.timeline import Timeline
from world_models.entries import Hypothesis
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

    @property
    def sigmas(self) -> float:
        """The error of the place in standard deviations."""
        return self.off_m / self.sigma_m if self.sigma_m > 0.0 else math.inf

    def words(self) -> str:
        """``63 mm and 0.1 degrees from where it believed to be (by its own reckoning within 10 mm ...)``."""
        sure = f"by its own reckoning within {metres(self.sigma_m)} and {degrees(self.sigma_rad)}, one sigma"
        return f"{metres(self.off_m)} and {degrees(abs(self.off_rad))} from where it believed to be ({sure})"


def read_errors(run: RunDirectory, history: Timeline, at: int | None = None) -> list[TrueError]:
    """The error of each belief that was held, in the order of time, against the truth in the cycle in which it came.

    Args:
        at: only the error in this cycle, of the belief that was held then, which may be older; none before the first.

    Raises BadInput where it is not a run of the simulator, or it has no recording, or its world's file has changed.
    """
    from logs.reader import read_true_track  # an explanation starts fast only where no world is imported
    from logs.run_head import SIMULATOR, RunHead

    head = RunHead.read(run.path)
    if head.kind != SIMULATOR:
        raise BadInput(f"{run.path}: expected a run of the simulator, which alone knows the truth, got one on hardware")
    if not run.recording.is_file():
        raise BadInput(f"{run.path}: expected its recording, where the truth is, got none (harvey repair {run.path}"
                       " draws it)")
    world, track = head.load_world(), read_true_track(run.recording)
    records = [one for one in history.of_kind(Hypothesis, until=at) if one.value.is_held]
    errors = []
    for record in records if at is None else records[-1:]:
        value, cycle = record.value, record.cycle if at is None else at
        before = bisect_right(track, cycle, key=lambda moment: moment[0])  # it is recorded whenever it has moved
        if before:
            believed, true = value.world_from_robot(world), Pose2(*track[before - 1][1:])
            errors.append(TrueError(cycle, believed.distance_to(true),
                                    wrap_angle(believed.heading_rad - true.heading_rad), value.sigma_m,
                                    value.sigma_rad, record.ref))
    return errors
