"""A mission on hardware: the same experts, board, journal and recording; a base and a camera of metal; no truth."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from blackboard.effect import Post
from blackboard.journal import Decision, Sink
from blackboard.scheduler import Scheduler
from harvey.diary import Diary, Extent
from harvey.hardware.body import Eye, HardwareBody, Watching
from harvey.hardware.heart import Heart
from harvey.hardware.mission import HardwareMission
from harvey.hardware.stop_key import stop_key
from harvey.loop import until_outcome
from harvey.minds import Mind, mind_of
from harvey.ports import BodyPort
from harvey.referee import Counts
from harvey.run_directory import RunDirectory
from harvey.run_head import HARDWARE, RunHead
from knowledge_sources.drivers.base import Base
from knowledge_sources.drivers.video_camera import VideoCamera
from logs.disk import CannotWriteError
from logs.errors import RecordingError
from world_models.body import Frame, MotionReport
from world_models.robot import RobotModel
from world_models.task import Outcome


class Odometer(Counts):
    """Counts, and adds up what the wheels claim."""

    def __init__(self) -> None:
        super().__init__()
        self.path_m, self.frames, self.time_s = 0.0, 0, 0.0

    def __call__(self, decision: Decision) -> None:
        super().__call__(decision)
        for change in decision.observed:
            value = change.entry.value
            if isinstance(value, MotionReport):
                self.path_m += value.move_m
                self.time_s = value.sim_time_s
            self.frames += isinstance(value, Frame)


class HardwareRun:
    """Mind, body of metal and diary put together; where a run goes on that was cut off, so much of it is ``whole``.

    Attributes:
        port: the body's; kept: the same, whose pictures go into the diary.
        diary, scheduler: the files, and the mind at work.
    """

    def __init__(
        self, run: RunDirectory, head: RunHead, mind: Mind, body: HardwareBody, *, sinks: Sequence[Sink] = (),
        live: bool = False, whole: Extent | None = None,
    ) -> None:
        self.head, self.port = head, BodyPort(body)
        self.diary = Diary(run, head, mind.robot, live=live, whole=whole)
        self.kept = self.diary.kept(self.port)
        self.scheduler: Scheduler = mind.scheduler(ports=(self.kept,), sinks=(*self.diary.sinks, *sinks))

    def begin(self) -> None:
        """Tell it what the user asked for."""
        self.scheduler.tell([Post(self.head.task())], "user")


Begin = Callable[[HardwareRun], Decision | None]
"""Brings a run to where it goes on from, and returns the last decision there was."""


def drive(
    mission: HardwareMission, robot: RobotModel, base: Base, camera: VideoCamera, clock: Callable[[], float], *,
    out: Path, sinks: Sequence[Sink] = (), live: bool = False,
) -> dict[str, Any]:
    """Drive to the outcome; however it ends, the base is told to stop, and what was recorded is kept.

    Returns what ``result.json`` holds: as for a run in the simulator, with null for what only the truth could tell.
    """
    head = RunHead.of(HARDWARE, mission.name, 0, mission.world, robot, mission.servo, mission.command,
                      scenario=mission.data, folder=str(mission.folder.resolve()))
    eye = Watching(camera, clock, mission.camera.rate_hz)
    return driven(mission, head, base, eye, clock, RunDirectory(out), HardwareRun.begin, sinks=sinks, live=live)


def driven(
    mission: HardwareMission, head: RunHead, base: Base, eye: Eye, clock: Callable[[], float], run: RunDirectory,
    begin: Begin, *, sinks: Sequence[Sink] = (), live: bool = False, whole: Extent | None = None,
) -> dict[str, Any]:
    """Drive to the outcome from wherever ``begin`` brings the run; see :func:`drive`."""
    began = time.perf_counter()
    body, counts = HardwareBody(base, eye, clock=clock), Odometer()
    try:
        with stop_key(body.stop_for_good), Heart(base) as heart, mind_of(head) as mind:
            robot = HardwareRun(run, head, mind, body, sinks=(counts, *sinks), live=live, whole=whole)
            diary, scheduler = robot.diary, robot.scheduler
            try:
                run.write_result({"scenario": mission.name, "seed": 0, "outcome": "unfinished"})
                last = begin(robot)
                outcome = until_outcome(
                    scheduler, over=lambda s: _over(mission, s, clock()), before=heart.tick, last=last)
            finally:
                body.stop()
                diary.close()
    except (CannotWriteError, RecordingError) as error:
        outcome = Outcome("failed", f"stopped, because nothing more can be written down: {error}")
    finally:
        base.close()
    result = _result(mission, outcome, counts, time.perf_counter() - began)
    with suppress(OSError):  # where the disk is full, the outcome that is there, unfinished, is true as well
        run.write_result(result)
    return result


def _over(mission: HardwareMission, scheduler: Scheduler, now_s: float) -> str | None:
    if now_s > mission.limits.max_time_s:
        return f"not there after {now_s:.0f} s"
    return f"not there after {scheduler.cycle} cycles" if scheduler.cycle >= mission.limits.max_cycles else None


def _result(mission: HardwareMission, outcome: Outcome, counts: Odometer, wall_time_s: float) -> dict[str, Any]:
    return {
        "scenario": mission.name, "seed": 0, "outcome": outcome.kind, "reason": outcome.reason, "goal": mission.goal,
        "final_error_m": None, "final_heading_error_rad": None, "path_length_m": counts.path_m,
        "sim_time_s": counts.time_s, "wall_time_s": wall_time_s, "frames": counts.frames, "decisions": counts.decisions,
        "milestones": {**counts.milestones, "false_accepts": None}, "replans": counts.replans,
        "relocalizations": counts.relocalizations, "sketches": counts.sketches, "collisions": None,
        "max_cross_track_m": None,
    }
