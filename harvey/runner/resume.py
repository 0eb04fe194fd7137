"""Resume: a run that was cut off goes on from its last decision; the robot was stopped in between.

What was cut off in the middle of writing is dropped. Board, agenda and all that was pending come back by replaying the
journal's observations, each decision compared to the byte. A motor command that was written down but not reported on is
the delicate case: it is not carried out again. The robot has stopped somewhere in it, and its body says what it can.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Protocol

from blackboard import Change, Decision, Effect, Entry, Post, Posted, Retracted
from harvey.errors import BadInput
from harvey.runner.replay import Live, check_same, open_originals, replay
from harvey.runner.run import Run
from logs.mjpeg_file import Pictures
from logs.pictures import camera_bytes, open_pictures
from logs.run_directory import RunDirectory
from logs.run_recorder import Extent
from logs.timeline import Timeline
from world_models.entries import Course, MotorCommand, Outcome, Resumed

RESUME = "resume"
"""The author of what is put on the board of a run that goes on after a crash."""


@dataclass(frozen=True, slots=True)
class Remains:
    """What is whole of a run that was cut off.

    Attributes:
        extent: of the files.
        decisions: how many.
        outcome: how the run ended by its journal; None where it did not.
        dropped: what is not whole, in words.
    """

    extent: Extent
    decisions: int
    outcome: Outcome | None
    dropped: tuple[str, ...]


def find_remains(run: RunDirectory) -> Remains:
    """Look at a run without touching it. Raises BadInput where it cannot be used at all."""
    there = camera_bytes(run)
    history = Timeline(run.journal) if run.journal.is_file() else None
    decisions = 0 if history is None else len(history.cycles)
    if decisions == 0:
        _check_not_lost(run, there)
    if history is None:
        return Remains(Extent(), 0, None, ())
    history.verify()
    whole, pictures = history.whole_bytes, open_pictures(run)
    end = pictures.end if isinstance(pictures, Pictures) else 0
    dropped = []
    if run.journal.stat().st_size > whole:
        dropped.append(f"decision {decisions + 1}, which was cut off while it was written")
    if there > end:
        dropped.append(f"{there - end} bytes of a picture that no decision had seen")
    return Remains(Extent(whole, end), decisions, _find_outcome(history), tuple(dropped))


def _check_not_lost(run: RunDirectory, pictures: int) -> None:
    """Raises BadInput where a run of which no decision is there was more than begun: its journal was lost since.

    A picture is asked for by a decision that is written by then; so where nothing was lost, there is none.
    """
    lost = [f"{run.camera.name} has {pictures} bytes of pictures"] * (pictures > 0)
    if counted := run.read_result().get("decisions"):
        lost.append(f"{run.result.name} tells of {counted} decisions")
    if lost:
        raise BadInput(f"{run.journal}: expected the decisions of the run, got none, although {' and '.join(lost)}; "
                       "nothing was touched")


class ResumedBody(Protocol):
    """How a body comes to where its run was cut off: the only part that differs between simulator and hardware."""

    def replay(self, pictures: Mapping[int, bytes], /) -> AbstractContextManager[Live]:
        """A while in which the body hears of each decision that is replayed; ``pictures`` are those of the run."""
        ...

    def report(self, request: Entry[Any], /) -> Iterable[Effect]:
        """What is observed of a motor command that was cut off."""
        ...


def replay_run(files: RunDirectory, run: Run, body: ResumedBody) -> Decision | None:
    """Replay a run to its board, and bring its body to where it was; returns the last decision.

    Raises:
        BadInput: a decision, or an answer of the body, is not what it was.
    """
    originals, last = open_originals(files, run.store), None
    with body.replay(originals.pictures) as live:
        for decision in replay(files, originals, run.scheduler, live=live, before=run.before_cycle):
            last = check_same(files, decision).now
    return last


def continue_run(files: RunDirectory, run: Run, body: ResumedBody) -> Outcome:
    """Go on with a run from its last decision to its outcome. Raises BadInput where it cannot be replayed as it was."""
    last = replay_run(files, run, body)
    if last is not None:
        _report_crash(run, body, last)
    run.recorder.replaying = False
    if last is None:
        return run.begin()
    for change in last.made:
        if not is_command(change):
            for port in run.ports:
                run.scheduler.post(port.answer(change), port.name)
    return run.go_on(last)


def _report_crash(run: Run, body: ResumedBody, last: Decision) -> None:
    """Answer the commands that were cut off by what the body can tell of them."""
    cut_off = [change.entry for change in last.made if is_command(change)]
    refs = tuple(str(entry.ref) for entry in cut_off)
    run.scheduler.post([Post(Resumed(run.scheduler.cycle, refs), tuple(cut_off))], RESUME)
    for entry in cut_off:
        for effect in body.report(entry):
            run.recorder.record_picture(effect)
            run.scheduler.post([effect], run.port.name)


def is_command(change: Change) -> bool:
    """Whether a change asks the wheels to turn."""
    if isinstance(change.entry.value, Course):
        return not isinstance(change, Retracted)
    return isinstance(change, Posted) and isinstance(change.entry.value, MotorCommand)


def _find_outcome(history: Timeline) -> Outcome | None:
    """The outcome, if it was seen."""
    last = history.last(Outcome)
    was_seen = last is not None and any(last.ref in decision.seen for decision in history.naming(last.ref))
    return last.value if last is not None and was_seen else None
