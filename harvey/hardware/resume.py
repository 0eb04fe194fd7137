"""Resume on hardware: a mission that was cut off goes on; the base was stopped by its watchdog in between.

Board, agenda and all that was pending come back by telling the journal again (:mod:`harvey.replay.resume`). How far the
wheels carried out the command that nobody reported on is not known: whoever counted them is gone. So it is a fault like
a cable that came off in mid-move. The wheels are asked, the belief is in doubt, and a milestone has to hold before the
robot moves on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from blackboard.effect import Post
from blackboard.journal import Decision, Sink
from harvey.errors import BadInput
from harvey.hardware.body import Eye, Watching
from harvey.hardware.drivers.bases.base import Base
from harvey.hardware.drivers.cameras.video_camera import VideoCamera
from harvey.hardware.mission import HardwareMission
from harvey.hardware.run import HardwareRun, driven
from harvey.replay.replay import checked, pictures_of, replayed
from harvey.replay.resume import Remains, is_command
from harvey.run_files.records import read_records
from harvey.run_files.run_directory import RunDirectory
from harvey.run_files.run_head import RunHead
from harvey.simulation.body_replay import RESUME
from world_models.entries.body import BodyFault, Frame
from world_models.entries.task import Resumed


def stood_at(run: RunDirectory) -> tuple[float, int]:
    """The time of the last thing that was observed [s], and how many pictures were numbered. Raises BadInput."""
    last_s, pictures = 0.0, 0
    for record in read_records(run.journal) if run.journal.is_file() else ():
        for seen in record.observed:
            value = seen.value if isinstance(seen.value, dict) else {}
            try:
                last_s = max(last_s, *(float(value.get(key, 0.0)) for key in ("sim_time_s", "when_s")))
                pictures = max(pictures, int(value["number"]) + 1) if seen.type == Frame.__name__ else pictures
            except (KeyError, TypeError, ValueError):
                raise BadInput(f"{run.journal}: {seen.ref}: expected when it was observed, and a picture's number, got "
                               f"{seen.value!r}") from None
    return last_s, pictures


def resume(
    mission: HardwareMission, run: RunDirectory, remains: Remains, base: Base, camera: VideoCamera,
    clock: Callable[[], float], *, sinks: Sequence[Sink] = (), live: bool = False,
) -> dict[str, Any]:
    """Go on with a run to its outcome; returns what ``result.json`` holds.

    Args:
        clock: the run's time: it goes on from :func:`stood_at`.

    Raises:
        BadInput: it cannot be told again as it was.
    """
    pictures = stood_at(run)[1]
    eye = _Numbering(Watching(camera, clock, mission.camera.rate_hz), pictures)

    def begin(robot: HardwareRun) -> Decision | None:
        return _told_again(run, robot, clock)

    return driven(mission, RunHead.read(run.path), base, eye, clock, run, begin, sinks=sinks, live=live,
                  whole=remains.extent)


class _Numbering:
    """A camera whose pictures are numbered on from those of the process before."""

    def __init__(self, eye: Eye, first: int) -> None:
        self._eye, self._first = eye, first

    def look(self, purpose: str) -> Frame | BodyFault:
        """A picture, or what was wrong."""
        seen = self._eye.look(purpose)
        return replace(seen, number=self._first + seen.number) if isinstance(seen, Frame) else seen


def _told_again(run: RunDirectory, robot: HardwareRun, clock: Callable[[], float]) -> Decision | None:
    scheduler, last = robot.scheduler, None
    for told in replayed(run, pictures_of(run), scheduler):
        last = checked(run, told).now
    robot.recorder.retelling = False
    if last is None:
        robot.begin()
        return None
    for fault in scheduler.view.where(BodyFault, lambda f: f.is_open):
        if (request := scheduler.view.get(fault.value.request)) is not None:
            robot.port.remember(request)
    broken_off = [change.entry for change in last.made if is_command(change)]
    refs = tuple(str(entry.ref) for entry in broken_off)
    scheduler.tell([Post(Resumed(scheduler.cycle, refs), tuple(broken_off))], RESUME)
    for entry in broken_off:
        robot.port.remember(entry)
        fault_now = BodyFault("base", "link lost", "the process that drove ended in mid-move", entry.id, clock())
        scheduler.tell([Post(fault_now, (entry,))], robot.port.name)
    for change in last.made:
        if not is_command(change):
            scheduler.tell(robot.kept.answer(change), robot.kept.name)
    return last
