"""A mission on hardware: the same run as in the simulator, with a base and a camera, and without a referee."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from blackboard.journal import Sink
from harvey.agent import build_agent
from harvey.agent_settings import Pairs
from harvey.hardware.body import Eye, HardwareBody, Watching
from harvey.hardware.drivers.bases.base import Base
from harvey.hardware.drivers.cameras.video_camera import VideoCamera
from harvey.hardware.heartbeat import Heartbeat
from harvey.hardware.mission import HardwareMission
from harvey.hardware.resume import NumberingCamera, UnknownMotion, count_pictures
from harvey.hardware.stop_key import stop_key
from harvey.run_files.run_directory import RunDirectory
from harvey.run_files.run_head import HARDWARE, RunHead
from harvey.run_files.run_recorder import Extent, RunRecorder
from harvey.runner.ports import Body
from harvey.runner.result import MissionResult
from harvey.runner.resume import Remains, continue_run
from harvey.runner.run import Run
from harvey.runner.teller import Tell, tell_nothing
from world_models.robot import RobotModel

Around = Callable[[HardwareBody, Callable[[], None]], Body]
"""Puts something between the agent and the body; the second argument is to be called often while it lets it wait."""


def unchanged(body: HardwareBody, _tick: Callable[[], None]) -> Body:
    """Nothing between the agent and the body."""
    return body


def drive(
    mission: HardwareMission, robot: RobotModel, base: Base, camera: VideoCamera, clock: Callable[[], float], *,
    out: Path, sinks: Sequence[Sink] = (), live: bool = False, settings: Pairs = (),
    around: Around = unchanged, tell: Tell = tell_nothing,
) -> MissionResult:
    """Drive to the outcome; however it ends, the base is told to stop, and what was recorded is kept.

    Args:
        settings: those of the agent.
        around: puts something between the agent and the body.
        tell: called before each cycle, to put on the board what somebody says meanwhile.
    """
    head = RunHead.of(HARDWARE, mission.name, 0, mission.world, robot, mission.servo, mission.command,
                      scenario=mission.source.data, folder=str(mission.folder.resolve()), constants=settings)
    files = RunDirectory(out)
    eye = Watching(camera, clock, mission.camera.rate_hz)
    with _hardware_run(mission, head, base, eye, clock, files, sinks, live, around=around, tell=tell) as run:
        return run.drive(files)


def resume(
    mission: HardwareMission, files: RunDirectory, remains: Remains, base: Base, camera: VideoCamera,
    clock: Callable[[], float], *, sinks: Sequence[Sink] = (), live: bool = False,
) -> MissionResult:
    """Go on with a run to its outcome; the base was stopped by its watchdog in between.

    Args:
        clock: the run's time: it goes on from :func:`harvey.hardware.resume.time_of_last_observation`.

    Raises:
        BadInput: it cannot be replayed as it was.
    """
    eye = NumberingCamera(Watching(camera, clock, mission.camera.rate_hz), count_pictures(files))
    head = RunHead.read(files.path)
    with _hardware_run(mission, head, base, eye, clock, files, sinks, live, remains.extent) as run:
        return run.drive(files, lambda: continue_run(files, run, UnknownMotion(run, clock)))


@contextmanager
def _hardware_run(
    mission: HardwareMission, head: RunHead, base: Base, eye: Eye, clock: Callable[[], float], files: RunDirectory,
    sinks: Sequence[Sink], live: bool, whole: Extent | None = None, *, around: Around = unchanged,
    tell: Tell = tell_nothing,
) -> Iterator[Run]:
    """A run whose body can be stopped by a key, and whose base hears a heartbeat; closes the base."""
    body = HardwareBody(base, eye, clock=clock, ranges=mission.ranges.read)
    try:
        agent = build_agent(head)
        with stop_key(body.stop_for_good), Heartbeat(base) as heartbeat:
            recorder = RunRecorder(files, head, agent.world, agent.robot, live=live, whole=whole)
            yield Run(head, agent, around(body, heartbeat.tick), recorder, limits=mission.limits, clock=clock,
                      sinks=sinks, told=mission.told, tell=tell, before_cycle=heartbeat.tick)
    finally:
        base.close()
