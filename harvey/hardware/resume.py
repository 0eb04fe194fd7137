"""Resume on hardware: what differs from :mod:`harvey.runner.resume` in the simulator.

How far the wheels carried out the command that was cut off is not known: the process that counted is gone. So it is a
fault, like a cable that came off in mid-move. The wheels are asked, the belief is in doubt, and a milestone has to hold
before the robot moves on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from blackboard.effect import Effect, Post
from blackboard.entry import Entry
from harvey.errors import BadInput
from harvey.hardware.body import Eye
from harvey.run_files.records import EntryRecord, read_records
from harvey.run_files.run_directory import RunDirectory
from harvey.runner.replay import Live, ignore
from harvey.runner.run import Run
from world_models.entries.body import BodyFault, Frame


def time_of_last_observation(files: RunDirectory) -> float:
    """When the last thing was observed, by the run's clock; 0 in a run without observations [s]. Raises BadInput."""
    return max((_time_s(files, seen) for seen in _observations(files)), default=0.0)


def count_pictures(files: RunDirectory) -> int:
    """How many pictures of a run were numbered. Raises BadInput."""
    frames = (seen for seen in _observations(files) if seen.type == Frame.__name__)
    return max((_number(files, frame) + 1 for frame in frames), default=0)


class NumberingCamera:
    """A camera whose pictures are numbered on from those of the process before."""

    def __init__(self, eye: Eye, first: int) -> None:
        self._eye, self._first = eye, first

    def look(self, purpose: str) -> Frame | BodyFault:
        """A picture, or what was wrong."""
        seen = self._eye.look(purpose)
        return replace(seen, number=self._first + seen.number) if isinstance(seen, Frame) else seen


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


def _observations(files: RunDirectory) -> Iterator[EntryRecord]:
    for record in read_records(files.journal) if files.journal.is_file() else ():
        yield from record.observed


def _time_s(files: RunDirectory, seen: EntryRecord) -> float:
    value = seen.value if isinstance(seen.value, dict) else {}
    try:
        return max(float(value.get(key, 0.0)) for key in ("sim_time_s", "when_s"))
    except (TypeError, ValueError):
        raise _build_error(files, seen, "when it was observed") from None


def _number(files: RunDirectory, frame: EntryRecord) -> int:
    try:
        return int(frame.value["number"])
    except (KeyError, TypeError, ValueError):
        raise _build_error(files, frame, "a picture's number") from None


def _build_error(files: RunDirectory, seen: EntryRecord, expected: str) -> BadInput:
    return BadInput(f"{files.journal}: {seen.ref}: expected {expected}, got {seen.value!r}")
