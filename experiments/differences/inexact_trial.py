"""One mission on a floor that its model describes by centimetres wrongly: how it ended, and what covariances hold."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from blackboard.journal import Decision
from experiments.generated.missions import WHEELS_WORSE, write_inexact_mission
from harvey.agent import build_agent
from harvey.campaign.campaign import Task
from harvey.simulation.run import SimulatedRun, build_head
from logs.run_recorder import RunRecorder
from sim.body.simulated_body import SimulatedBody
from sim.differences.inexact import TrueInexact
from world_models.entries.percepts import PoseFix
from world_models.entries.task import Certificate
from world_models.frames import wrap_angle

CHI2_95, CHI2_9999 = 7.815, 21.108
"""Of three unknowns: 95 % and 99.99 % are below."""


@dataclass(frozen=True, slots=True)
class InexactTrial:
    """A mission.

    Attributes:
        row: of the table.
        seed: of floor, displacements and run.
        sigma_m: of the displacements; missing, extra: shares of the things.
        stated_m: what the world file states.
        worse_wheels: whether the wheels are three times worse than believed.
    """

    row: str
    seed: int
    sigma_m: float = 0.0
    stated_m: float = 0.0
    missing: float = 0.3
    extra: float = 0.1
    worse_wheels: bool = False


@dataclass(frozen=True, slots=True)
class InexactResult:
    """How a mission ended, in plain types.

    Attributes:
        error_m: true distance from the goal.
        chi2: of each verified milestone, the squared error over the stated covariance; three unknowns.
        fix_errors_m, fix_sigmas_m: of the same, the true distance, and the stated deviation.
        wrong: how many of them are false beyond what is stated, and beyond what the model's error explains.
    """

    row: str
    seed: int
    outcome: str
    reason: str
    error_m: float
    chi2: list[float]
    fix_errors_m: list[float]
    fix_sigmas_m: list[float]
    wrong: int
    refuted: int
    collisions: int
    relocations: int
    robot_s: float
    wall_s: float


@dataclass
class Witness:
    """A sink that compares verified poses with the truth."""

    chi2: list[float] = field(default_factory=list)
    errors_m: list[float] = field(default_factory=list)
    sigmas_m: list[float] = field(default_factory=list)
    turns_rad: list[float] = field(default_factory=list)
    body: SimulatedBody | None = None
    _fix: PoseFix | None = None

    def __call__(self, decision: Decision) -> None:
        for change in decision.made:
            value = change.entry.value
            if isinstance(value, PoseFix):
                self._fix = value
            elif isinstance(value, Certificate) and value.verdict == "verified" and self._fix is not None:
                self._compare(self._fix)

    def _compare(self, fix: PoseFix) -> None:
        if self.body is None:
            return
        believed, true = fix.world_from_robot, self.body.truth.world_from_robot
        turn = wrap_angle(believed.heading_rad - true.heading_rad)
        off = np.array([believed.x_m - true.x_m, believed.y_m - true.y_m, turn])
        self.chi2.append(float(off @ np.linalg.solve(fix.covariance, off)))
        self.errors_m.append(float(np.hypot(off[0], off[1])))
        self.turns_rad.append(abs(turn))
        self.sigmas_m.append(math.sqrt(0.5 * float(np.trace(fix.covariance[:2, :2]))))


MAX_ERROR_M, MAX_ERROR_RAD, MODEL_SIGMAS = 0.15, 0.06, 3.0
"""The referee's bounds on what is accepted, and how many standard deviations of the model are added to them."""


def run_inexact_mission(trial: InexactTrial) -> InexactResult:
    """Run the mission of a trial."""
    witness = Witness()
    with TemporaryDirectory() as folder:
        truth = TrueInexact(sigma_m=trial.sigma_m, missing=trial.missing, extra=trial.extra)
        path = write_inexact_mission(Path(folder), trial.seed, truth, stated_m=trial.stated_m,
                                     more=WHEELS_WORSE if trial.worse_wheels else "")
        stage = Task(str(path), (), trial.seed).stage()
        head = build_head(stage, trial.seed)
        agent = build_agent(head)
        recorder = RunRecorder(None, head, agent.world, agent.robot)
        with SimulatedRun(stage, head, agent, recorder, [witness]) as run:
            witness.body = run.simulated_body
            r = run.drive(None)
    most_m = math.hypot(MAX_ERROR_M, MODEL_SIGMAS * trial.sigma_m)
    wrong = sum(
        e > most_m or (turn > MAX_ERROR_RAD and chi2 > CHI2_9999)
        for e, turn, chi2 in zip(witness.errors_m, witness.turns_rad, witness.chi2, strict=True))
    return InexactResult(
        trial.row, trial.seed, r.outcome, r.reason, r.error_m, witness.chi2, witness.errors_m, witness.sigmas_m, wrong,
        r.milestones["refuted"] or 0, r.collisions or 0, r.relocalizations, r.sim_time_s, r.wall_time_s)
