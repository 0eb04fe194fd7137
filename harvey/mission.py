"""A mission in the simulator: wire it, run it to its outcome, score it against the truth."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from blackboard.change import Quiescence
from blackboard.effect import Post
from blackboard.journal import Sink, decision_line
from blackboard.knowledge_source import KnowledgeSource
from blackboard.scheduler import RAISED, Scheduler
from harvey.ports import BodyPort
from harvey.referee import MissionResult, Referee
from harvey.wiring import command, knowledge_sources, robot_model, servoing
from logs.journal_file import JournalFile
from logs.sink import Recorder
from sim.assembly import Stage
from sim.body import SimulatedBody
from sim.scenario import Limits, Scenario
from world_models.frames import Pose2
from world_models.location import Hypothesis
from world_models.robot import RobotModel
from world_models.task import Outcome


def run_mission(
    stage: Stage,
    seed: int,
    *,
    out: Path | None = None,
    sinks: Sequence[Sink] = (),
    live: bool = False,
    sources: Callable[[RobotModel], Sequence[KnowledgeSource]] = knowledge_sources,
) -> MissionResult:
    """Run a scenario's mission to its outcome.

    Args:
        out: directory for ``recording.rrd``, ``journal.jsonl`` and ``result.json``; None keeps nothing.
        sinks: told of every decision.
        live: let a viewer watch.
        sources: which experts sit round the board.
    """
    began = time.perf_counter()
    scenario, robot, body = stage.scenario, robot_model(stage.scenario), stage.body(seed)
    referee, diary = Referee(robot, body), _Diary(out, robot, scenario, seed, live)
    scheduler = Scheduler(
        sources(robot),
        ports=(BodyPort(body),),
        servoing=servoing(scenario.servo),
        sinks=(*diary.sinks, referee, *sinks),
    )
    scheduler.tell([Post(command(scenario))], "user")
    try:
        outcome = _to_the_end(scheduler, scenario.limits, body, diary)
    finally:
        diary.close()
    belief = scheduler.view.latest(Hypothesis, lambda h: h.is_held)
    result = referee.result(stage, seed, outcome, None if belief is None else belief.value, time.perf_counter() - began)
    if out is not None:
        (out / "result.json").write_text(json.dumps(result.record(), indent=2) + "\n", encoding="utf-8")
    return result


class _Diary:
    """The files of a run."""

    def __init__(self, out: Path | None, robot: RobotModel, scenario: Scenario, seed: int, live: bool) -> None:
        self._journal: JournalFile | None = None
        self._recorder: Recorder | None = None
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            self._journal = JournalFile(out / "journal.jsonl")
        if out is not None or live:
            self._recorder = Recorder(
                None if out is None else out / "recording.rrd",
                world=robot.world, camera=robot.camera, mount=robot.mount, live=live,
                title=f"harvey {scenario.name}", recording_id=f"{scenario.name}-{seed}",
                line_of=decision_line if self._journal is None else self._journal.line,
            )

    @property
    def sinks(self) -> tuple[Sink, ...]:
        return tuple(sink for sink in (self._journal, self._recorder) if sink is not None)

    def truth(self, pose: Pose2, sim_time_s: float) -> None:
        if self._recorder is not None:
            self._recorder.truth(pose, sim_time_s)

    def close(self) -> None:
        for sink in (self._journal, self._recorder):
            if sink is not None:
                sink.close()


def _to_the_end(scheduler: Scheduler, limits: Limits, body: SimulatedBody, diary: _Diary) -> Outcome:
    """Cycle until an outcome is on the board, a limit is reached, or the board falls still for good."""
    told_still = -1
    while (declared := scheduler.view.latest(Outcome)) is None:
        diary.truth(body.truth.world_from_robot, body.truth.time_s)
        decision = scheduler.step()
        if decision is None:
            if told_still == scheduler.cycle:
                return _declared(scheduler, "failed", "the board fell still and nobody declared an outcome")
            scheduler.tell([Post(Quiescence(scheduler.cycle))], "scheduler")
            told_still = scheduler.cycle + 1
        elif decision.refused.startswith(RAISED):
            who = decision.chosen.source.name if decision.chosen else "an expert that was asked"
            return _declared(scheduler, "failed", f"{who} raised {decision.refused.strip().splitlines()[-1]}")
        elif (over := _over(limits, scheduler, body)) is not None:
            return _declared(scheduler, "failed", over)
    scheduler.step()  # the outcome itself is seen, so that it stands in the journal
    return declared.value


def _over(limits: Limits, scheduler: Scheduler, body: SimulatedBody) -> str | None:
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


def _declared(scheduler: Scheduler, kind: str, reason: str) -> Outcome:
    """An outcome that nobody on the board declared; it is put there, and so into the journal."""
    outcome = Outcome(kind, reason)
    scheduler.tell([Post(outcome)], "mission")
    scheduler.step()
    return outcome
