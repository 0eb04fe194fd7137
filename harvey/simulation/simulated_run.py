"""A mission in the simulator: an agent, a simulated body, and a referee who knows the truth."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from blackboard import Post, Scheduler, Sink
from harvey.agent import Agent, Sources, build_agent
from harvey.agent_settings import Pairs
from harvey.errors import BadInput
from harvey.runner.ports import Body
from harvey.runner.replay import check_same, open_originals, replay
from harvey.runner.result import UNFINISHED, MissionResult
from harvey.runner.resume import Remains, continue_run, find_remains, replay_run
from harvey.runner.run import Run
from harvey.runner.teller import Tell, tell_each, tell_nothing
from harvey.simulation.body_replay import BodyReplay
from harvey.simulation.happenings import ContactWatch, HappeningWatch
from harvey.simulation.referee import Referee
from harvey.simulation.serial_body import IN_PROCESS, open_body
from harvey.wiring import knowledge_sources
from logs.run_directory import RunDirectory
from logs.run_head import HARDWARE, SIMULATOR, RunHead, load_known_world, portable
from logs.run_recorder import RunRecorder
from sim.body.simulated_body import SimulatedBody
from sim.scenario import Attendant, Scenario, ScenarioError, scenario_from_tables
from sim.stage import Stage, build_stage
from world_models.actuator import ActuatorModel
from world_models.building.geometry.faces import Face
from world_models.building.world import World
from world_models.entries import Recovery, Redirection
from world_models.files.toml.mission import ROOT
from world_models.files.world_files import load_world
from world_models.plugins import SOURCES_GROUP, list_plugins
from world_models.robot import RobotModel

HELPER = "helper"
"""Who says the word for which the robot waits."""
Around = Callable[[Body, Callable[[], bool]], Body]
"""Puts something between the agent and the body; the second argument says whether the run is only replayed."""


def unchanged(body: Body, _is_replayed: Callable[[], bool]) -> Body:
    """Nothing between the agent and the body."""
    return body


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
    around: Around = unchanged,
    tell: Tell = tell_nothing,
    sync: bool = False,
    recording: bool = True,
) -> MissionResult:
    """Run a scenario's mission to its outcome.

    Args:
        out: directory for the files of :mod:`logs.run_directory`; None keeps nothing.
        sinks: called with every decision.
        live: let a viewer watch.
        sources: makes the knowledge sources.
        head: how the run begins, if otherwise than the scenario says.
        body: how the body is reached (:func:`harvey.simulation.serial_body.open_body`), where ``head`` does not say it.
        around: puts something between the agent and the body.
        tell: called before each cycle, to put on the board what somebody says meanwhile.
        sync: force what is written onto the disk before it is acted on, as over a serial line in any case. A mission in
            the process that a power cut takes can be driven again.
        recording: draw one into ``out``; without, a mission takes a tenth less time, and half the room.
    """
    head = head or build_head(stage, seed, body)
    files = None if out is None else RunDirectory(out)
    agent = build_agent(head, sources)
    recorder = RunRecorder(files, head, agent.world, agent.robot, live=live, sync=sync or head.body != IN_PROCESS,
                           recording=recording)
    with SimulatedRun(stage, head, agent, recorder, sinks, around, tell) as run:
        return run.drive(files)


def resume_mission(
    files: RunDirectory, remains: Remains, *, sinks: Sequence[Sink] = (), live: bool = False,
    around: Around = unchanged, stage: Stage | None = None, sync: bool = False, recording: bool = True,
) -> MissionResult:
    """Go on with a run to its outcome; its recording is drawn again from the start.

    Args:
        remains: what is whole of it; the rest of its files is dropped.
        stage: the building of its scenario, where it is at hand.
        sinks, live, around, sync, recording: as for :func:`run_mission`.

    Raises:
        BadInput: it is no run of the simulator, or cannot be replayed as it was.
    """
    head = RunHead.read(files.path)
    stage = stage or rebuild_stage(head)
    agent = build_agent(head)
    recorder = RunRecorder(files, head, agent.world, agent.robot, live=live, whole=remains.extent,
                           sync=sync or head.body != IN_PROCESS, recording=recording)
    with SimulatedRun(stage, head, agent, recorder, sinks, around) as run:
        return run.drive(files, lambda: continue_run(files, run, run.body_replay))


def redraw(run: RunDirectory, sinks: Sequence[Sink] = ()) -> int:
    """Draw a run's recording again; the old one stays until the new one is whole. Returns how many decisions it shows.

    Raises:
        BadInput: the run cannot be replayed as it was.
        RecordingError: the recording cannot be written.
    """
    decisions = find_remains(run).decisions
    head, part = RunHead.read(run.path), run.recording.with_name("recording.rrd.part")
    agent = build_agent(head)
    recorder = RunRecorder(None, head, agent.world, agent.robot, drawing=part)
    try:
        if head.kind == SIMULATOR:
            with SimulatedRun(rebuild_stage(head), head, agent, recorder, sinks) as simulated:
                replay_run(run, simulated, simulated.body_replay)
        else:
            scheduler = agent.scheduler(sinks=(*recorder.sinks, *sinks))
            for decision in replay(run, open_originals(run, agent.store), scheduler):
                check_same(run, decision)
        ended = run.read_result()
        recorder.draw_end(ended.get("outcome", UNFINISHED), ended.get("final_error_m"))
        recorder.close()
        os.replace(part, run.recording)
    finally:
        part.unlink(missing_ok=True)
    return decisions


def build_head(stage: Stage, seed: int, body: str = IN_PROCESS, settings: Pairs = ()) -> RunHead:
    """How a run of a scenario begins; ``settings`` are those of the agent."""
    s = stage.scenario
    robot, guests = build_robot_model(s, load_known_world(s.world)), s.walkers.guests if s.walkers else {}
    return RunHead.of(SIMULATOR, s.name, seed, s.world, robot, s.servo, s.command, scenario=s.source.data,
                      folder=portable(s.folder), body=body, constants=settings,
                      plugins={**list_plugins(SOURCES_GROUP), **guests})


def rebuild_stage(head: RunHead) -> Stage:
    """The building of a simulator's run. Raises BadInput."""
    if head.kind == HARDWARE:
        raise BadInput(f"expected a run of the simulator, got one on hardware: harvey drive {head.name} repeats it")
    try:
        return build_stage(scenario_from_tables(head.scenario, head.name, ROOT / head.folder))
    except ScenarioError as error:
        raise BadInput(f"run.json: {error}") from None


def build_robot_model(scenario: Scenario, world: World | None = None) -> RobotModel:
    """What the robot knows: the world file without the building's details, its camera and its wheels' kind.

    ``world`` is that file's world where it has been read already.
    """
    camera = scenario.camera
    return RobotModel(world or load_world(scenario.world), camera.camera, camera.mount, ActuatorModel(),
                      continuous=scenario.motion.continuous)


class SimulatedRun(Run):
    """A run in the simulator; a context manager that closes the line to the body.

    Attributes:
        simulated_body: the body with its truth.
        body_replay: the same body, as a run that goes on brings it to where it was.
    """

    def __init__(
        self, stage: Stage, head: RunHead, agent: Agent, recorder: RunRecorder, sinks: Sequence[Sink] = (),
        around: Around = unchanged, tell: Tell = tell_nothing,
    ) -> None:
        self.simulated_body = body = stage.body(head.seed)
        self._drawn: tuple[tuple[Face, ...], tuple[Face, ...]] = (), ()
        self._line, self._contact_watch = ExitStack(), ContactWatch(agent.world, body)
        self._happening_watch, walkers = HappeningWatch(body, stage.scenario.moved), stage.scenario.walkers
        if walkers is not None:  # people walk while it thinks
            sinks = (lambda d: body.charge(walkers.charge(d.chosen.source.name) if d.chosen else 0.0), *sinks)
        reached = around(self._line.enter_context(open_body(body, head.body)), lambda: recorder.replaying)
        super().__init__(
            head, agent, reached, recorder, limits=stage.scenario.limits, clock=lambda: body.truth.time_s,
            referee=Referee(agent.world, stage, body), sinks=sinks,
            told=stage.scenario.told, tell=tell_each(tell, partial(_let_help, stage.scenario.helper, body)),
            before_cycle=self._draw_truth)
        self.body_replay = BodyReplay(self.port, body, head.seed, stage.scenario.actuator)

    def _draw_truth(self) -> None:
        truth = self.simulated_body.truth
        touched = tuple(contact.place for contact in self._contact_watch.new_contacts())
        self.recorder.draw_truth(truth.world_from_robot, truth.time_s, touched, self._happening_watch.new_happenings())
        differs = self.simulated_body.building.added, self.simulated_body.building.gone
        if differs != self._drawn:
            self._drawn = differs
            self.recorder.draw_true_building(*differs)

    def __enter__(self) -> SimulatedRun:
        return self

    def __exit__(self, *_exception: object) -> None:
        self._line.close()


def _let_help(people: Sequence[Attendant], body: SimulatedBody, scheduler: Scheduler) -> None:
    """Once a person in the room has done what the robot waits for, they say so; after each wait once."""
    wait, said = scheduler.view.latest(Recovery, lambda wait: not wait.request), scheduler.view.latest(Redirection)
    if wait is None or wait.value.status != "still failing" or (said is not None and said.cycle >= wait.cycle):
        return
    for person in people:
        if person.room in ("", body.truth.locale) and wait.value.waited_s >= person.comes_s:
            scheduler.post([Post(Redirection(person.says, HELPER))], HELPER)
            return
