"""Run: an agent at work through a body, from the command to the outcome, and the files that it leaves."""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Protocol

from blackboard import RAISED, Decision, Post, Quiescence, Scheduler, Sink
from harvey.agent import Agent
from harvey.errors import BadInput
from harvey.runner.ports import Body, BodyPort, WorldPort, tell_robot
from harvey.runner.result import UNFINISHED, MissionResult, RunCounts, tell_refusal
from harvey.runner.teller import FileTeller, Tell, Teller, tell_each, tell_nothing
from logs.disk import CannotWriteError
from logs.run_directory import RunDirectory
from logs.run_errors import RecordingError
from logs.run_head import RunHead
from logs.run_recorder import RunRecorder
from world_models.camera import CameraDeviation
from world_models.entries import CameraState, Goal, Hypothesis, Outcome
from world_models.files.toml.camera_file import camera_text
from world_models.files.toml.mission import Limits, Telling

MIN_FREE_BYTES = 1 << 18
"""A disk with less room than this is full."""

Over = Callable[[Scheduler], str | None]
"""Why a run has to end after this cycle, in words; None as long as it may go on."""


class RunReferee(Protocol):
    """Knows the truth about a run; the board never hears of it."""

    def __call__(self, decision: Decision, /) -> None:
        """Sink: follow the run."""
        ...

    def over(self) -> str | None:
        """Why the truth ends the run now, in words."""
        ...

    def complete(self, result: MissionResult, belief: Hypothesis | None, /) -> MissionResult:
        """The result with what only the truth can tell; ``belief`` is the last one held."""
        ...


class Run:
    """One run: an agent, a body, and the recorder of its files.

    Attributes:
        head: how it begins.
        port: the body's, without the recorder; recorded_port: the same, as the agent has it.
        ports: that one and the world's, as the agent has them.
        scheduler: the agent at work.
        store: of the locale frames.
    """

    def __init__(
        self, head: RunHead, agent: Agent, body: Body, recorder: RunRecorder, *, limits: Limits,
        clock: Callable[[], float], referee: RunReferee | None = None, sinks: Sequence[Sink] = (),
        told: Sequence[Telling] = (), tell: Tell = tell_nothing, before_cycle: Callable[[], None] = lambda: None,
    ) -> None:
        """Put a run together.

        Args:
            limits: when to give up; clock: the body's time, by which that is judged [s].
            referee: who knows the truth; None on hardware.
            sinks: called with every decision.
            told: what somebody tells it on the way, by the mission's file; tell: what comes while it runs.
            before_cycle: called before each cycle.
        """
        self._began_s, self._robot, self.store = time.perf_counter(), agent.robot, agent.store
        self.head, self.body, self.recorder = head, body, recorder
        self._limits, self._clock, self._referee = limits, clock, referee
        self._teller, self._tell = Teller(told, clock), tell
        self._what_if, self._before = agent.what_if, before_cycle
        self.port = BodyPort(body)
        self.recorded_port = recorder.record_port(self.port)
        self.ports = self.recorded_port, recorder.record_port(WorldPort(agent.store))
        self._counts = RunCounts()
        truth = () if referee is None else (referee,)
        self.scheduler: Scheduler = agent.scheduler(
            ports=self.ports, sinks=(*recorder.sinks, self._counts, *truth, *sinks))

    def begin(self) -> Outcome:
        """From the command to the outcome."""
        tell_robot(self.scheduler, self._robot)
        self.scheduler.post([Post(self.head.task())], "user")
        return self.go_on()

    def go_on(self, last: Decision | None = None) -> Outcome:
        """To the outcome, from wherever the board is; ``last`` is the last decision of a run that was cut off."""
        return run_to_outcome(self.scheduler, over=self.over, before=self.before_cycle, last=last)

    def before_cycle(self) -> None:
        """What comes before each cycle; while a run is only replayed, the journal says what was told."""
        self._before()
        if not self.recorder.replaying:
            self._what_if(self.scheduler)
            self._teller.tell(self.scheduler)
            self._tell(self.scheduler)

    def over(self, scheduler: Scheduler) -> str | None:
        """Why it has to end now, if it has."""
        if self._referee is not None and (why := self._referee.over()) is not None:
            return why
        if (now_s := self._clock()) > self._limits.max_time_s:
            return f"not there after {now_s:.0f} s"
        return f"not there after {scheduler.cycle} cycles" if scheduler.cycle >= self._limits.max_cycles else None

    def drive(self, files: RunDirectory | None, start: Callable[[], Outcome] | None = None) -> MissionResult:
        """Drive to the outcome, stop the body, close the recorder and write the result.

        A disk that takes no more stops the run. What was written before is whole, so the run may go on when there is
        room. Any other exception passes, with a note on how to go on.

        Args:
            files: where the run is recorded; None records nothing.
            start: from where to where: :meth:`begin`, or what brings a run that was cut off to its end.
        """
        start = start or self.begin
        self._tell = self._tell if files is None else tell_each(self._tell, FileTeller(files.path).tell)
        try:
            if files is not None:
                files.write_result({"scenario": self.head.name, "seed": self.head.seed, "outcome": UNFINISHED})
            outcome = start()
        except (CannotWriteError, RecordingError) as error:
            outcome = _build_outcome(files, error)
        except BaseException as error:
            self._close()
            if files is not None and not isinstance(error, BadInput):
                error.add_note(f"what was recorded is kept; harvey resume {files.path} goes on with it")
            raise
        not_drawn = self._close(outcome)
        result = self._result(replace(outcome, reason=outcome.reason + not_drawn))
        if files is not None:
            with suppress(OSError):  # where the disk is full, the outcome that is there, unfinished, is true as well
                files.write_result(result.record())
                if (camera := self._counts.camera) is not None and self._counts.camera_lessons():
                    files.write_camera(build_camera_text(camera, self.head.name))
        return result

    def _close(self, outcome: Outcome | None = None) -> str:
        """Stop the body and close the files; what to say where the recording's last part could not be written."""
        self.body.stop()
        try:
            if outcome is not None:
                self.recorder.draw_end(outcome.kind, self._result(outcome).final_error_m)
            self.recorder.close()
        except RecordingError:
            return "; the last part of its recording is not written (harvey repair draws it again)"
        return ""

    def _result(self, outcome: Outcome) -> MissionResult:
        took_s = time.perf_counter() - self._began_s
        head, belief = self.head, self.scheduler.view.latest(Hypothesis, lambda h: h.is_held)
        result = self._counts.result(head.name, head.seed, head.task().text, outcome, took_s)
        return result if self._referee is None else self._referee.complete(result, belief and belief.value)


def run_to_outcome(
    scheduler: Scheduler,
    *,
    over: Over = lambda _scheduler: None,
    before: Callable[[], None] = lambda: None,
    last: Decision | None = None,
) -> Outcome:
    """Cycle until an outcome is on the board, a limit is reached, a knowledge source raises, or nothing is left to do.

    The board hears once that nothing is pending (``Quiescence``), so that a knowledge source may answer it.

    Args:
        over: asked after each cycle whether a limit is reached.
        before: called before each cycle.
        last: the decision that was made last, where a run goes on that was cut off.
    """
    quiet_since = -1
    why = _why_over(last, scheduler, over) if last is not None else None
    while (declared := scheduler.view.latest(Outcome)) is None:
        if why is not None:
            return _declare(scheduler, why)
        before()
        decision = scheduler.step()
        if decision is not None:
            why = _why_over(decision, scheduler, over)
        elif quiet_since == scheduler.cycle:
            why = "the board fell still and nobody declared an outcome"
        else:
            scheduler.post([Post(Quiescence(scheduler.cycle))], "scheduler")
            quiet_since = scheduler.cycle + 1
    scheduler.step()  # the outcome itself is seen, so that it stands in the journal
    return declared.value


def _why_over(decision: Decision, scheduler: Scheduler, over: Over) -> str | None:
    return tell_refusal(decision) if decision.refused.startswith(RAISED) else over(scheduler)


def _declare(scheduler: Scheduler, reason: str) -> Outcome:
    """Declare failure where no knowledge source declared an outcome; it is posted, and so journalled."""
    outcome = Outcome("failed", reason)
    scheduler.post([Post(outcome, scheduler.view.all(Goal)[-1:])], "mission")
    scheduler.step()
    return outcome


def _build_outcome(files: RunDirectory | None, error: Exception) -> Outcome:
    """The outcome of a run whose files cannot be written any more."""
    full = files is not None and shutil.disk_usage(files.path).free < MIN_FREE_BYTES
    why = f"{error} (the disk is full)" if full else str(error)
    go_on = "" if files is None else f"; harvey resume {files.path} goes on with it"
    return Outcome("failed", f"stopped, because nothing more can be written down: {why}{go_on}")


def build_camera_text(camera: CameraState, mission: str) -> str:
    """The text of a camera file with what was learnt, and its standard deviations: for the next mission."""
    if not camera.covariance:
        raise ValueError("expected a camera of which something was learnt, got one as told")
    tilt, roll, yaw, height, focal, _, _ = (math.sqrt(row[i]) for i, row in enumerate(camera.covariance))
    deviation = CameraDeviation(tilt, height, camera.sigma_forward_m, focal, roll, yaw)
    notes = (f"learnt in the mission {mission}, by {len(camera.counted)} pictures", )
    return camera_text(camera.lens, camera.mount, notes, deviation)
