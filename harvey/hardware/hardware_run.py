"""A mission on hardware: the same run as in the simulator, with a base and a camera, and without a referee.

A run that goes on after a crash differs from one in the simulator: how far the wheels carried out the command that was
cut off is not known, as the process that counted is gone. So it is a fault, like a cable that came off in mid-move. The
wheels are asked, the belief is in doubt, and a milestone has to hold before the robot moves on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from blackboard import Effect, Entry, Post, Sink
from harvey.agent import build_agent
from harvey.agent_settings import Pairs
from harvey.hardware.drivers.base_driver import Base
from harvey.hardware.drivers.video_camera import VideoCamera
from harvey.hardware.hardware_body import CameraPort, HardwareBody, WatchedCamera
from harvey.hardware.hardware_mission import HardwareMission
from harvey.hardware.stopping import Heartbeat, stop_key
from harvey.runner.ports import Body
from harvey.runner.replay import Live, ignore
from harvey.runner.result import MissionResult
from harvey.runner.resume import Remains, continue_run
from harvey.runner.run import Run
from harvey.runner.teller import LiveTeller, Tell, tell_each, tell_nothing
from logs.pictures import open_pictures
from logs.run_directory import RunDirectory
from logs.run_head import HARDWARE, RunHead
from logs.run_recorder import Extent, RunRecorder
from logs.timeline import Timeline, read_time_s
from world_models.building.world import World
from world_models.entries import GO_ON, BodyFault, CameraPicture
from world_models.robot import RobotModel

Around = Callable[[HardwareBody, Callable[[], None]], Body]
"""Puts something between the agent and the body; the second argument is to be called often while it lets it wait."""


@runtime_checkable
class AccompaniedBase(Protocol):
    """A base through which others hear of a run, and may tell it something."""

    def accompany(self, world: World, robot: RobotModel, /) -> tuple[Sink, Tell]:
        """What hears each decision, and what is called before each cycle."""
        ...


def unchanged(body: HardwareBody, _tick: Callable[[], None]) -> Body:
    """Nothing between the agent and the body."""
    return body


def drive(
    mission: HardwareMission, robot: RobotModel, base: Base, camera: VideoCamera, clock: Callable[[], float], *,
    out: Path, sinks: Sequence[Sink] = (), live: bool = False, settings: Pairs = (),
    around: Around = unchanged, tell: Tell = tell_nothing,
) -> MissionResult:
    """Drive to the outcome; however it ends, the base is stopped, and what was recorded is kept.

    Args:
        settings: those of the agent.
        around: puts something between the agent and the body.
        tell: called before each cycle, to put on the board what somebody says meanwhile.
    """
    head = RunHead.of(HARDWARE, mission.name, 0, mission.world, robot, mission.servo, mission.command,
                      scenario=mission.source.data, folder=str(mission.folder.resolve()), constants=settings)
    files = RunDirectory(out)
    eye = WatchedCamera(camera, clock, mission.camera.rate_hz)
    if isinstance(base, AccompaniedBase):
        sink, listener = base.accompany(head.load_world(), robot)
        sinks, tell = (*sinks, sink), tell_each(tell, listener)

    with _hardware_run(mission, head, base, eye, clock, files, sinks, live, around=around, tell=tell) as run:
        return run.drive(files)


def resume(
    mission: HardwareMission, files: RunDirectory, remains: Remains, base: Base, camera: VideoCamera,
    clock: Callable[[], float], *, sinks: Sequence[Sink] = (), live: bool = False,
) -> MissionResult:
    """Go on with a run to its outcome; the base was stopped by its watchdog in between.

    Args:
        clock: the run's time: it goes on from :func:`time_of_last_observation`.

    Raises:
        BadInput: it cannot be replayed as it was.
    """
    eye = NumberingCamera(WatchedCamera(camera, clock, mission.camera.rate_hz), count_pictures(files))
    head = RunHead.read(files.path)
    with _hardware_run(mission, head, base, eye, clock, files, sinks, live, remains.extent) as run:
        return run.drive(files, lambda: continue_run(files, run, UnknownMotion(run, clock)))


@contextmanager
def _hardware_run(
    mission: HardwareMission, head: RunHead, base: Base, eye: CameraPort, clock: Callable[[], float],
    files: RunDirectory,
    sinks: Sequence[Sink], live: bool, whole: Extent | None = None, *, around: Around = unchanged,
    tell: Tell = tell_nothing,
) -> Iterator[Run]:
    """A run whose body can be stopped by a key, and whose base hears a heartbeat; closes the base."""
    body, person = HardwareBody(base, eye, clock=clock, ranges=mission.ranges.read), LiveTeller()
    try:
        agent = build_agent(head)
        with stop_key(body.stop_for_good, go_on=lambda: person.hear(GO_ON)), Heartbeat(base) as heartbeat:
            recorder = RunRecorder(files, head, agent.world, agent.robot, live=live, whole=whole, sync=True)
            yield Run(head, agent, around(body, heartbeat.tick), recorder, limits=mission.limits, clock=clock,
                      sinks=sinks, told=mission.told, tell=tell_each(person.tell, tell), before_cycle=heartbeat.tick)
    finally:
        base.close()


def time_of_last_observation(files: RunDirectory) -> float:
    """When the last thing was observed, by the run's clock; 0 in a run without observations [s]. Raises BadInput."""
    decisions = Timeline(files.journal).decisions() if files.journal.is_file() else ()
    times = (read_time_s(seen.field) for decision in decisions for seen in decision.observed)
    return max((time_s for time_s in times if time_s is not None), default=0.0)


def count_pictures(files: RunDirectory) -> int:
    """How many pictures of a run were numbered. Raises BadInput."""
    return max(open_pictures(files), default=-1) + 1 if files.journal.is_file() else 0


class NumberingCamera:
    """A camera whose pictures are numbered on from those of the process before."""

    def __init__(self, eye: CameraPort, first: int) -> None:
        self._eye, self._first = eye, first

    def look(self, purpose: str) -> CameraPicture | BodyFault:
        """A picture, or what was wrong."""
        seen = self._eye.look(purpose)
        return replace(seen, number=self._first + seen.number) if isinstance(seen, CameraPicture) else seen


class UnknownMotion:
    """A body that cannot say how far a motion came: a :class:`harvey.runner.resume.ResumedBody`."""

    def __init__(self, run: Run, clock: Callable[[], float]) -> None:
        self._run, self._clock = run, clock

    @contextmanager
    def replay(self, _pictures: Mapping[int, bytes]) -> Iterator[Live]:
        """The body does nothing; after it, requests that a fault kept from being answered are open again."""
        yield ignore
        view = self._run.scheduler.view
        for fault in view.where(BodyFault, lambda f: f.is_open):
            if (request := view.get(fault.value.request)) is not None:
                self._run.port.remember(request)

    def report(self, request: Entry[Any]) -> Iterable[Effect]:
        """A fault; the recovery from it asks the wheels."""
        self._run.port.remember(request)
        what = "the process that drove ended in mid-move"
        yield Post(BodyFault("base", "link lost", what, request.id, self._clock()), (request,))
