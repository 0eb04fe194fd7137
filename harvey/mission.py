"""A mission in the simulator: wire it, run it to its outcome, score it against the truth."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from blackboard.change import Quiescence
from blackboard.effect import Post
from blackboard.journal import Decision, Sink, decision_line
from blackboard.knowledge_source import KnowledgeSource
from blackboard.scheduler import RAISED, Scheduler
from harvey.ports import BodyPort
from harvey.wiring import knowledge_sources, robot_model, servoing
from logs.journal_file import JournalFile
from logs.sink import Recorder
from sim.assembly import Stage
from sim.body import SimulatedBody
from sim.scenario import Limits, Scenario
from sim.truth import cross_track_m
from world_models.frames import Pose2, wrap_angle
from world_models.location import Hypothesis, covariance_tuple, diagonal
from world_models.robot import RobotModel
from world_models.task import Command, Goal, Leg, Milestone, Outcome, PlanSketch

FALSE_M = 0.15
"""A milestone is accepted falsely when the robot is further than this from where it believes it is after it."""
FALSE_RAD = 0.06
"""Or turned by more than this."""


@dataclass(frozen=True, slots=True)
class MissionResult:
    """What is written to ``result.json``.

    Attributes:
        outcome: reached, lost, blocked or failed; reason: why.
        final_heading_error_rad: from the wanted heading; where none is wanted, from what Harvey believed.
        milestones: how many were verified, refuted, not testable and (by the truth) accepted falsely.
        replans: sketches adjusted or drawn anew; relocalizations: how often it found itself again.
        sketches: how many plan sketches were drawn.
        max_cross_track_m: how far the robot truly strayed from the line of the leg it was driving.
    """

    scenario: str
    seed: int
    outcome: str
    reason: str
    goal: str
    final_error_m: float
    final_heading_error_rad: float
    path_length_m: float
    sim_time_s: float
    wall_time_s: float
    frames: int
    decisions: int
    milestones: dict[str, int]
    replans: int
    relocalizations: int
    sketches: int
    collisions: int
    max_cross_track_m: float

    def record(self) -> dict[str, Any]:
        """As JSON types."""
        return {name: getattr(self, name) for name in self.__slots__}


class Tally:
    """A sink that counts what the result tells, and compares each accepted milestone with the truth."""

    def __init__(self, robot: RobotModel, body: SimulatedBody) -> None:
        self._robot, self._body = robot, body
        self.decisions = self.replans = self.relocalizations = self.sketches = 0
        self.milestones = {"verified": 0, "refuted": 0, "not_testable": 0, "false_accepts": 0}
        self.max_cross_track_m = 0.0
        self._leg: Leg | None = None
        self._gone = 0

    def __call__(self, decision: Decision) -> None:
        self.decisions += 1
        self._follow()
        for change in decision.made:
            value, revision = change.entry.value, change.entry.revision
            if isinstance(value, Leg):
                self._leg = value if value.status == "moving" else None
            elif isinstance(value, Milestone) and value.status.replace(" ", "_") in self.milestones:
                self.milestones[value.status.replace(" ", "_")] += 1
            elif isinstance(value, PlanSketch):
                self.sketches += revision == 0
                self.replans += value.adjustments > 0 and value.verified and change.entry.author == "sketcher"
            elif isinstance(value, Goal):
                self.replans += value.status == "abandoned"
            elif isinstance(value, Hypothesis) and value.is_held:
                self.relocalizations += value.basis == "relocalization"
                if value.basis == "milestone":
                    self.milestones["false_accepts"] += self._is_false(value)

    def _follow(self) -> None:
        """How far the robot truly strayed from the leg that it was driving since the last decision."""
        track = self._body.track
        if self._leg is not None:
            start, end = Pose2(self._leg.x0_m, self._leg.y0_m, 0.0), Pose2(self._leg.x1_m, self._leg.y1_m, 0.0)
            strayed = (abs(cross_track_m(t.world_from_robot, start, end)) for t in track[self._gone:])
            self.max_cross_track_m = max(self.max_cross_track_m, *strayed, 0.0)
        self._gone = len(track)

    def _is_false(self, value: Hypothesis) -> bool:
        believed, true = value.world_from_robot(self._robot.world), self._body.truth.world_from_robot
        turned = abs(wrap_angle(believed.heading_rad - true.heading_rad))
        return believed.distance_to(true) > FALSE_M or turned > FALSE_RAD


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
    tally, diary = Tally(robot, body), _Diary(out, robot, scenario, seed, live)
    scheduler = Scheduler(
        sources(robot), ports=(BodyPort(body),), servoing=servoing(scenario.servo), sinks=(*diary.sinks, tally, *sinks)
    )
    scheduler.tell([Post(_command(scenario))], "user")
    try:
        outcome = _to_the_end(scheduler, scenario.limits, body, diary)
    finally:
        diary.close()
    result = _result(stage, seed, scheduler, robot, body, tally, outcome, time.perf_counter() - began)
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


def _command(scenario: Scenario) -> Command:
    start, arrival = scenario.start, scenario.arrival
    covariance = diagonal(max(start.put_down_sigma_m, 0.005), max(start.put_down_sigma_rad, 0.005))
    heading = arrival.heading_rad if arrival.matters else None
    return Command(scenario.goal, start.heading_rad, heading, covariance_tuple(covariance))


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


def _result(
    stage: Stage, seed: int, scheduler: Scheduler, robot: RobotModel, body: SimulatedBody, tally: Tally,
    outcome: Outcome, wall_s: float,
) -> MissionResult:
    score = stage.score(body.track)
    return MissionResult(
        scenario=stage.scenario.name,
        seed=seed,
        outcome=outcome.kind,
        reason=outcome.reason,
        goal=stage.scenario.goal,
        final_error_m=score.position_error_m,
        final_heading_error_rad=_heading_error(score.heading_error_rad, scheduler, robot, body),
        path_length_m=score.path_m,
        sim_time_s=score.time_s,
        wall_time_s=wall_s,
        frames=body.frames,
        decisions=tally.decisions,
        milestones=tally.milestones,
        replans=tally.replans,
        relocalizations=tally.relocalizations,
        sketches=tally.sketches,
        collisions=score.collisions,
        max_cross_track_m=tally.max_cross_track_m,
    )


def _heading_error(wanted: float | None, scheduler: Scheduler, robot: RobotModel, body: SimulatedBody) -> float:
    belief = scheduler.view.latest(Hypothesis, lambda h: h.is_held)
    if wanted is not None or belief is None:
        return wanted or 0.0
    return wrap_angle(belief.value.world_from_robot(robot.world).heading_rad - body.truth.world_from_robot.heading_rad)
