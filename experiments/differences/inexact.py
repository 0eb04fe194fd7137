"""Missions on floors that their model describes by centimetres wrongly: is a goal reached, is a covariance honest?

Each wall, door and thing is displaced on its own, by a standard deviation that the world file states; 30 % of the
things are missing, and 10 % more are there. Wheels three times worse than believed are driven on exact floors.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from blackboard.journal import Decision
from experiments.generated.missions import WHEELS_WORSE, write_inexact_mission
from experiments.report import OURS, PAPER, Cell, Report, chart
from experiments.trials import RESULTS, at_least, at_most, campaign_folder, run_trials
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


MISSIONS, QUICK_MISSIONS = 1_000, 4
FIRST_SEED, SEEDS_APART = 1_000_000, 10_000
"""Seeds below 1,000 are for development: constants were chosen on some of them."""
MISSING, EXTRA = 0.3, 0.1
SIGMAS_CM: Mapping[str, float] = {"2 cm": 2.0, "5 cm": 5.0, "10 cm": 10.0, "wheels 3 x worse": 0.0}
MIN_REACHED: Mapping[str, float] = {"2 cm": 0.99, "5 cm": 0.97, "10 cm": 0.90, "wheels 3 x worse": 0.99}
GOAL_M, MODEL_SIGMAS = 0.0254, 3.0
"""A goal is reached within an inch and so many standard deviations of the model."""
HELD = 0.92, 0.98
WORST_SHOWN = 6
COLUMNS = ("model", "paper", "peer", "missions", "reached", "proves at least", "95 % ellipsoids hold", "milestones",
           "accepted wrongly", "contacts", "refuted", "relocated", "mean goal cm", "robot's mean s", "mean CPU s")


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Drive so many missions a row, of seeds 1,000,000 + 10,000 ``seed`` + 0, 1, ...."""
    number = missions or (QUICK_MISSIONS if quick else MISSIONS)
    first, each = FIRST_SEED + SEEDS_APART * seed, max(1, number // len(SIGMAS_CM) if quick else number)
    trials = [_build_trial(row, first + k) for row in SIGMAS_CM for k in range(each)]
    folder = campaign_folder(f"inexact-{missions}" if missions else "inexact", seed, quick=quick)
    ends = run_trials(run_inexact_mission, trials, InexactResult, folder, "mission")
    found = {row: [end for end in ends if end.row == row] for row in SIGMAS_CM}
    picture = folder / "inexact.png"
    _draw(found, picture)
    report = Report(
        "Missions on floors that the model describes by centimetres wrongly", COLUMNS,
        tuple(_row(row, e) for row, e in found.items()),
        notes=(
            f"Seeds {first} to {first + each - 1}; no constant was chosen on them. Bounds are one-sided, of 95 %, by"
            " Clopper and Pearson.",
            f"Displacements of each wall, door and thing have this standard deviation, which the world file states;"
            f" {MISSING:.0%} of the things are missing, {EXTRA:.0%} more are there. reached: within an inch and"
            f" {MODEL_SIGMAS:g} standard deviations of the model. 95 % ellipsoids: of the poses of verified milestones."
            " accepted wrongly: further off than the referee's 15 cm and those deviations together, or turned by more"
            " than 3.4 degrees.",
            "The paper worries how its requirement of accurate landmarks can be relaxed, and gives no figures; no peer"
            " with one camera and a building's model is known.",
            *(line for row, e in found.items() for line in _worst(row, e)),
            f"As a picture: {picture}; one line per mission: {folder / RESULTS}",
        ),
        claims=tuple(_claims(found, quick)),
    )
    (folder / "table.txt").write_text(report.text() + "\n", encoding="utf-8")
    return report


def _build_trial(row: str, seed: int) -> InexactTrial:
    sigma_m = 0.01 * SIGMAS_CM[row]
    if not sigma_m:
        return InexactTrial(row, seed, missing=0.0, extra=0.0, worse_wheels=True)
    return InexactTrial(row, seed, sigma_m, sigma_m, MISSING, EXTRA)


def is_reached(end: InexactResult) -> bool:
    """Whether a mission reached its goal, within the model's own error."""
    return end.outcome == "reached" and end.error_m <= GOAL_M + MODEL_SIGMAS * 0.01 * SIGMAS_CM[end.row]


def _held(ends: Sequence[InexactResult]) -> tuple[int, int]:
    """How many ellipsoids hold the truth, and of how many."""
    chi2 = [value for end in ends for value in end.chi2]
    return sum(value <= CHI2_95 for value in chi2), len(chi2)


def _row(row: str, ends: Sequence[InexactResult]) -> tuple[Cell, ...]:
    reached, (held, of) = sum(map(is_reached, ends)), _held(ends)
    goals = [end.error_m for end in ends if end.outcome == "reached"]
    return (
        row, None, None, len(ends), reached, f"{at_least(reached, len(ends)):.1%}",
        f"{held / of:.1%}" if of else None, of, sum(e.wrong for e in ends), sum(e.collisions for e in ends),
        sum(e.refuted for e in ends), sum(e.relocations for e in ends),
        100.0 * math.fsum(goals) / len(goals) if goals else None, math.fsum(e.robot_s for e in ends) / len(ends),
        math.fsum(e.wall_s for e in ends) / len(ends),
    )


def _claims(found: Mapping[str, Sequence[InexactResult]], quick: bool) -> Iterator[tuple[str, bool]]:
    everywhere = [e for ends in found.values() for e in ends]
    wrong, of = sum(e.wrong for e in everywhere), sum(len(e.chi2) for e in everywhere)
    if of:
        yield (f"no milestone is accepted wrongly: {wrong} of {of}, so at most {at_most(wrong, of):.2%}", not wrong)
    if quick:
        return
    for row, ends in found.items():
        reached = sum(map(is_reached, ends))
        yield (f"{row}: at least {MIN_REACHED[row]:.0%} reach: {reached} of {len(ends)}, so at least"
               f" {at_least(reached, len(ends)):.1%}", reached >= MIN_REACHED[row] * len(ends))
    for row, ends in found.items():
        held, number = _held(ends)
        if SIGMAS_CM[row] and number:
            low, high = HELD
            yield (f"{row}: 95 % ellipsoids hold {low:.0%} to {high:.0%}: {held} of {number} ({held / number:.1%})",
                   low * number <= held <= high * number)


def _worst(row: str, ends: Sequence[InexactResult]) -> list[str]:
    """Name the floors to look at."""
    flawed = [e for e in ends if not is_reached(e) or e.wrong][:WORST_SHOWN]
    told = "; ".join(f"{e.seed} ({e.outcome}: {e.reason}; {100.0 * e.error_m:.1f} cm)" for e in flawed)
    return [f"{row}, floors to look at: {told}"] if flawed else []


def _draw(found: Mapping[str, Sequence[InexactResult]], path: Path) -> None:
    with chart(path, "Inexact models", "", "share that reaches, and what that proves") as axes:
        axes.bar(list(found), [sum(map(is_reached, e)) / len(e) for e in found.values()], color=PAPER, label="found")
        axes.bar(list(found), [at_least(sum(map(is_reached, e)), len(e)) for e in found.values()], color=OURS,
                 label="proved, 95 %")
