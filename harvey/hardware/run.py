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
from harvey.agent import Agent, agent_of
from harvey.hardware.body import Eye, HardwareBody, Watching
from harvey.hardware.drivers.bases.base import Base
from harvey.hardware.drivers.cameras.video_camera import VideoCamera
from harvey.hardware.heartbeat import Heartbeat
from harvey.hardware.mission import HardwareMission
from harvey.hardware.stop_key import stop_key
from harvey.run_files.run_directory import RunDirectory
from harvey.run_files.run_head import HARDWARE, RunHead
from harvey.run_files.run_recorder import Extent, RunRecorder
from harvey.runner.ports import BodyPort
from harvey.runner.run import until_outcome
from harvey.simulation.referee import Counts
from logs.disk import CannotWriteError
from logs.errors import RecordingError
from world_models.entries.body import Frame, MotionReport
from world_models.entries.task import Outcome
from world_models.robot import RobotModel


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
    """Agent, body of metal and recorder put together; where a run goes on that was cut off, so much of it is ``whole``.

    Attributes:
        port: the body's; kept: the same, whose pictures go into the recorder.
        recorder, scheduler: the files, and the agent at work.
    """

    def __init__(
        self, run: RunDirectory, head: RunHead, agent: Agent, body: HardwareBody, *, sinks: Sequence[Sink] = (),
        live: bool = False, whole: Extent | None = None,
    ) -> None:
        self.head, self.port = head, BodyPort(body)
        self.recorder = RunRecorder(run, head, agent.robot, live=live, whole=whole)
        self.kept = self.recorder.kept(self.port)
        self.scheduler: Scheduler = agent.scheduler(ports=(self.kept,), sinks=(*self.recorder.sinks, *sinks))

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
                      scenario=mission.source.data, folder=str(mission.folder.resolve()))
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
        with stop_key(body.stop_for_good), Heartbeat(base) as heart, agent_of(head) as agent:
            robot = HardwareRun(run, head, agent, body, sinks=(counts, *sinks), live=live, whole=whole)
            recorder, scheduler = robot.recorder, robot.scheduler
            try:
                run.write_result({"scenario": mission.name, "seed": 0, "outcome": "unfinished"})
                last = begin(robot)
                outcome = until_outcome(
                    scheduler, over=lambda s: _over(mission, s, clock()), before=heart.tick, last=last)
            finally:
                body.stop()
                recorder.close()
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
