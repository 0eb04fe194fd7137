"""A mission in the simulator: wire it, run it to its outcome, score it against the truth."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path

from blackboard.effect import Post
from blackboard.journal import Decision, Sink
from blackboard.scheduler import Scheduler
from harvey.agent import Agent, Sources, agent_of
from harvey.run_files.run_directory import RunDirectory
from harvey.run_files.run_head import SIMULATOR, RunHead, known_world
from harvey.run_files.run_recorder import RunRecorder
from harvey.runner.ports import Body, BodyPort
from harvey.runner.run import until_outcome
from harvey.simulation.referee import MissionResult, Referee
from harvey.simulation.serial_body import IN_PROCESS, reached
from harvey.wiring import knowledge_sources
from logs.disk import CannotWriteError
from logs.errors import RecordingError
from sim.body.simulated_body import SimulatedBody
from sim.scenario import Scenario, ScenarioLimits
from sim.stage import Stage
from world_models.actuator import ActuatorModel
from world_models.building.world import World
from world_models.entries.location import Hypothesis
from world_models.entries.task import Outcome
from world_models.files.world_files import load_world
from world_models.robot import RobotModel

Around = Callable[[Body, Callable[[], bool]], Body]
"""Puts something between the agent and the body; the second argument tells whether the run is only told again."""

LEAST_FREE = 1 << 18
"""A disk with less room than this is full [bytes]."""
UNFINISHED = "unfinished"
"""The outcome in ``result.json`` of a run that has none yet."""


def run_mission(
    stage: Stage,
    seed: int,
    *,
    out: Path | None = None,
    sinks: Sequence[Sink] = (),
    live: bool = False,
    sources: Sources = knowledge_sources,
    head: RunHead | None = None,
    body: str = IN_PROCESS,
    around: Around = lambda body, _retelling: body,
) -> MissionResult:
    """Run a scenario's mission to its outcome.

    Args:
        out: directory for the files of :mod:`harvey.run_files.run_directory`; None keeps nothing.
        sinks: told of every decision.
        live: let a viewer watch.
        sources: which experts sit round the board.
        head: how the run begins, if otherwise than the scenario says.
        body: how the body is reached (:func:`harvey.simulation.serial_body.reached`), where ``head`` does not say it.
        around: puts something between the agent and the body.
    """
    head = head or head_of(stage, seed, body)
    run = None if out is None else RunDirectory(out)
    with agent_of(head, sources) as agent:
        recorder = RunRecorder(run, head, agent.robot, live=live)
        mission = Mission(stage, head, agent, recorder, sinks, around)
        return mission.driven(run, mission.begin)


def head_of(stage: Stage, seed: int, body: str = IN_PROCESS) -> RunHead:
    """How a run of a scenario begins."""
    s = stage.scenario
    robot = robot_model(s, known_world(s.world))
    return RunHead.of(SIMULATOR, s.name, seed, s.world, robot, s.servo, s.command, scenario=s.source.data,
                      folder=str(s.folder), body=body)


def robot_model(scenario: Scenario, world: World | None = None) -> RobotModel:
    """What the robot knows: the world file without the building's details, its camera and its wheels' kind.

    ``world`` is that file's world where it has been read already.
    """
    camera = scenario.camera
    return RobotModel(world or load_world(scenario.world), camera.camera, camera.mount, ActuatorModel(),
                      continuous=scenario.motion.continuous)


class Mission:
    """One run: agent, simulated body and recorder put together.

    Attributes:
        port: the body's, as the agent has it, but without the recorder.
        body: what is behind it; seed: of all its chance.
        scheduler: the agent at work.
    """

    def __init__(
        self, stage: Stage, head: RunHead, agent: Agent, recorder: RunRecorder, sinks: Sequence[Sink] = (),
        around: Around = lambda body, _retelling: body,
    ) -> None:
        self._began, self._stage, self._head, self._agent = time.perf_counter(), stage, head, agent
        self.seed = head.seed
        self.body = stage.body(head.seed)
        self._opened = ExitStack()
        self.port = BodyPort(around(
            self._opened.enter_context(reached(self.body, head.body)), lambda: recorder.retelling))
        self.recorder = recorder
        self.kept = recorder.kept(self.port)
        self._referee = Referee(agent.robot, self.body)
        self.scheduler: Scheduler = agent.scheduler(ports=(self.kept,), sinks=(*recorder.sinks, self._referee, *sinks))

    def begin(self) -> Outcome:
        """From the command to the outcome."""
        self.scheduler.tell([Post(self._head.task())], "user")
        return self.go_on()

    def go_on(self, last: Decision | None = None) -> Outcome:
        """To the outcome, from wherever the board is; ``last`` is the last decision of a run that was cut off."""
        return until_outcome(self.scheduler, over=self.over, before=self.tell_truth, last=last)

    def over(self, scheduler: Scheduler) -> str | None:
        """Why it has to end now, if it has."""
        return _over(self._stage.scenario.limits, scheduler, self.body)

    def tell_truth(self) -> None:
        """Where the robot is, for the drawing."""
        self.recorder.truth(self.body.truth.world_from_robot, self.body.truth.time_s)

    def driven(self, run: RunDirectory | None, drive: Callable[[], Outcome]) -> MissionResult:
        """Drive, keep the result, and close the recorder however it ends.

        A disk that takes no more stops the run: the simulated robot stands by then, as nobody commands it, and what was
        written before is whole, so that the run may go on when there is room.
        """
        try:
            if run is not None:
                run.write_result({"scenario": self._head.name, "seed": self._head.seed, "outcome": UNFINISHED})
            outcome = drive()
        except (CannotWriteError, RecordingError) as error:
            outcome = stopped(run, error)
        except BaseException:
            self._close()
            raise
        undrawn = self._close()
        result = self.result(replace(outcome, reason=outcome.reason + undrawn))
        if run is not None:
            with suppress(OSError):  # where the disk is full, the outcome that is there, unfinished, is true as well
                run.write_result(result.record())
        return result

    def _close(self) -> str:
        """Close the files; what to say where the recording's last part could not be written: it can be drawn anew."""
        self._opened.close()
        try:
            self.recorder.close()
        except RecordingError:
            return "; the last part of its recording is not written (harvey repair draws it anew)"
        return ""

    def result(self, outcome: Outcome) -> MissionResult:
        """How it went, by the truth."""
        belief = self.scheduler.view.latest(Hypothesis, lambda h: h.is_held)
        took_s = time.perf_counter() - self._began
        return self._referee.result(
            self._stage, self._head.seed, outcome, None if belief is None else belief.value, took_s)


def stopped(run: RunDirectory | None, error: Exception) -> Outcome:
    """How a run ends whose recorder cannot be written any more."""
    full = run is not None and shutil.disk_usage(run.path).free < LEAST_FREE
    why = f"{error} (the disk is full)" if full else str(error)
    go_on = "" if run is None else f"; harvey resume {run.path} goes on with it"
    return Outcome("failed", f"stopped, because nothing more can be written down: {why}{go_on}")


def _over(limits: ScenarioLimits, scheduler: Scheduler, body: SimulatedBody) -> str | None:
    truth = body.truth
    if truth.collisions > limits.max_collisions:
        return f"{truth.collisions} collisions"
    if truth.time_s > limits.max_time_s:
        return f"not there after {truth.time_s:.0f} s"
    if truth.path_m > limits.max_path_m:
        return f"not there after {truth.path_m:.0f} m"
    if scheduler.cycle >= limits.max_cycles:
        return f"not there after {scheduler.cycle} cycles"
    return None
