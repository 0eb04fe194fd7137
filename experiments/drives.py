"""The form of experiments that drive missions: what is driven, how each mission ended, and the table over them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, NamedTuple, Protocol, Self, TypeVar

from blackboard import Decision, Sink
from experiments.report import Cell, Claim, Report
from experiments.trials import RESULTS, at_least, at_most, campaign_folder, judge_rare, judge_share, run_trials
from harvey.agent import build_agent
from harvey.campaign.mission_task import Task, run_task
from harvey.runner.result import MissionResult
from harvey.simulation.simulated_run import SimulatedRun
from knowledge_sources.methods.belief import to_probability
from logs.run_recorder import RunRecorder
from sim.body.simulated_body import SimulatedBody
from sim.ground_truth.table import TrueDoor
from world_models.entries import DoorState

WORST_SHOWN = 6
NO_PEER = "no peer with one camera and a building's model is known."
JUDGED = "; no constant was chosen on them. Bounds are one-sided, of 95 %, by Clopper and Pearson."
MAX_P_SHUT = 0.9
"""No door that is open is ever believed to be shut above this probability."""
IN_PLACE_M = 0.1
"""No mission ends lost this near to where the robot believed to be."""


@dataclass(frozen=True, slots=True)
class Trial:
    """A mission: the row of the table that it counts in, and the seed of what is drawn for it and of all chance."""

    row: str
    seed: int


@dataclass
class DoorBeliefs:
    """A sink that keeps which doors are open in truth and were believed to be shut, with the time of the picture.

    A door that was shut before counts as open no more: the robot cannot know when it was opened.

    Attributes:
        doors: that differ from the model.
    """

    doors: Sequence[TrueDoor]
    shut: dict[str, float] = field(default_factory=dict)

    def __call__(self, decision: Decision) -> None:
        for change in decision.made:
            value = change.entry.value
            if isinstance(value, DoorState) and to_probability(value.log_odds) > MAX_P_SHUT and not any(
                    d.name == value.door and d.state != "open" and d.at_s <= value.seen_s for d in self.doors):
                self.shut.setdefault(value.door, value.seen_s)


class Mission(NamedTuple):
    """How a mission went, and the open doors that were believed to be shut."""

    result: MissionResult
    shut: Mapping[str, float]


def drive_task(task: Task, *sinks: Sink) -> Mission:
    """Drive a mission in the simulator, which alone knows the truth."""
    beliefs = DoorBeliefs(task.load().truth.doors)
    return Mission(run_task(task, sinks=[*sinks, beliefs]), beliefs.shut)


class Beside(Protocol):
    """A sink that is given the body, and with it the truth, before the first decision."""

    body: SimulatedBody | None

    def __call__(self, decision: Decision, /) -> None: ...


def drive_beside(task: Task, witness: Beside) -> Mission:
    """Drive a mission with somebody who compares what is decided with the truth."""
    stage = task.stage()
    head, beliefs = task.head(stage), DoorBeliefs(stage.scenario.truth.doors)
    agent = build_agent(head)
    recorder = RunRecorder(None, head, agent.world, agent.robot)
    with SimulatedRun(stage, head, agent, recorder, [witness, beliefs]) as driving:
        witness.body = driving.simulated_body
        return Mission(driving.drive(None), beliefs.shut)


@dataclass(frozen=True, slots=True)
class End:
    """How a mission ended, in plain types.

    Attributes:
        error_m: true distance from the goal.
        false_accepts: milestones that were verified while the robot was elsewhere.
        robot_s: time of the robot; wall_s: of the processor, and waiting.
        believed_shut: doors that are open, and were believed to be shut above :data:`MAX_P_SHUT`.
        belief_off_m: true distance of where it believed to be at the end; None where it believed nothing.
    """

    row: str
    seed: int
    outcome: str
    reason: str
    error_m: float
    path_m: float
    verified: int
    refuted: int
    not_testable: int
    false_accepts: int
    contacts: int
    relocations: int
    replans: int
    robot_s: float
    wall_s: float
    believed_shut: list[str]
    belief_off_m: float | None

    @classmethod
    def of(cls, trial: Trial, mission: Mission, **more: Any) -> Self:
        """The end of a trial; ``more`` are the fields of the experiment's own kind."""
        r, shut = mission.result, [f"{door} at {seen_s:.1f} s" for door, seen_s in sorted(mission.shut.items())]
        count = {key: value or 0 for key, value in r.milestones.items()}
        return cls(trial.row, trial.seed, r.outcome, r.reason, r.error_m, r.path_length_m, count["verified"],
                   count["refuted"], count["not_testable"], r.false_accepts, r.collisions or 0, r.relocalizations,
                   r.replans, r.sim_time_s, r.wall_time_s, shut, r.belief_off_m, **more)

    @property
    def is_reached(self) -> bool:
        """Whether it says that it reached its goal."""
        return self.outcome == "reached"

    @property
    def is_lost_in_place(self) -> bool:
        """Whether it ended lost, though it was where it believed."""
        return self.outcome == "lost" and self.belief_off_m is not None and self.belief_off_m <= IN_PLACE_M


REACHED_M = 0.3
"""A robot that says that it has reached the goal is wrong if it is farther away: another room is metres away."""


@dataclass(frozen=True, slots=True)
class GoalEnd(End):
    """The end of a mission that may be at another place than it says: one that looks alike."""

    @property
    def is_right(self) -> bool:
        """Whether it reached the goal, and says so."""
        return self.is_reached and self.error_m <= REACHED_M

    @property
    def is_wrong(self) -> bool:
        """Whether it says that it reached the goal, and is elsewhere."""
        return self.is_reached and self.error_m > REACHED_M


def first_seed(seed: int, first: int = 1_000_000, apart: int = 10_000) -> int:
    """Of the missions that judge, on none of which a constant was chosen; ``seed`` is the experiment's own."""
    return first + apart * seed


E = TypeVar("E", bound=End)
Figure = Callable[[Sequence[E]], Cell]
"""A cell of the table, from the missions of its row."""


def total(value: Callable[[E], int]) -> Figure[E]:
    """The sum of something over the missions."""
    return lambda ends: sum(map(value, ends))


def mean(value: Callable[[E], float]) -> Figure[E]:
    """The mean of something over the missions."""
    return lambda ends: math.fsum(map(value, ends)) / len(ends) if ends else math.nan


def proved(is_right: Callable[[E], bool]) -> Figure[E]:
    """The lower bound of the share of missions that are right."""
    return lambda ends: f"{at_least(sum(map(is_right, ends)), len(ends)):.1%}"


COMMON: Mapping[str, Figure[End]] = {
    "missions": len, "reached": total(lambda e: e.is_reached), "proves at least": proved(lambda e: e.is_reached),
    "verified": total(lambda e: e.verified), "refuted": total(lambda e: e.refuted),
    "not testable": total(lambda e: e.not_testable), "false accepts": total(lambda e: e.false_accepts),
    "contacts": total(lambda e: e.contacts), "relocated": total(lambda e: e.relocations),
    "replans": total(lambda e: e.replans), "robot's mean s": mean(lambda e: e.robot_s),
    "mean CPU s": mean(lambda e: e.wall_s),
}


OPEN_HELD_SHUT: Figure[End] = total(lambda e: len(e.believed_shut))
HELD_SHUT = (f"open held shut: doors that are open by the truth, and were at some time believed to be shut above"
             f" {MAX_P_SHUT:g}.")


def pick(*names: str) -> Mapping[str, Figure[End]]:
    """Columns that several experiments have."""
    return {name: COMMON[name] for name in names}


def claim_share(what: str, is_right: Callable[[E], bool], ends: Sequence[E], least: float) -> Claim:
    """That at least such a share of the missions is right; ``what``: "told right: at least 99% reach"."""
    right, of = sum(map(is_right, ends)), len(ends)
    return f"{what}: {right} of {of}, so at least {at_least(right, of):.1%}", judge_share(right, of, least)


def has_false_accept(end: End) -> bool:
    """Whether a milestone was verified while the robot was elsewhere."""
    return end.false_accepts > 0


def claim_none(what: str, ends: Sequence[E], is_wrong: Callable[[E], bool] = has_false_accept) -> Claim:
    """That something happens in no mission; ``what``: "no milestone is accepted at a wrong place".

    No number of missions proves it; the bound says how rare it is at least.
    """
    wrong, of = sum(map(is_wrong, ends)), len(ends)
    return f"{what}: {wrong} of {of} missions, so in at most {at_most(wrong, of):.2%}", judge_rare(wrong, of, 0.0)


def claim_open_doors(ends: Sequence[End]) -> Claim:
    """That no open door was believed to be shut."""
    return claim_none(f"no open door is ever believed shut above {MAX_P_SHUT:g}", ends, lambda e: bool(e.believed_shut))


def claim_not_lost_in_place(ends: Sequence[End]) -> Claim:
    """That no mission ended lost where the robot believed to be."""
    return claim_none(f"no mission ends lost within {100.0 * IN_PLACE_M:g} cm of its belief", ends,
                      lambda e: e.is_lost_in_place)


def spread(shares: Mapping[str, float], first: int, number: int | None) -> list[Trial]:
    """Each row's share of so many missions, from a seed on; one of each row without a number."""
    return [Trial(row, first + k) for row, share in shares.items()
            for k in range(1 if number is None else max(1, math.ceil(number * share - 1e-9)))]


@dataclass(frozen=True)
class Driven(Generic[E]):
    """Missions that were driven: their ends by row, and the folder of the campaign."""

    rows: Mapping[str, list[E]]
    folder: Path

    @property
    def ends(self) -> list[E]:
        """All of them."""
        return [end for ends in self.rows.values() for end in ends]

    def report(
        self, title: str, what: str, figures: Mapping[str, Figure[E]], *, notes: Sequence[str], claims: Iterable[Claim],
        is_flawed: Callable[[E], bool], tell: Callable[[E], str] = lambda end: f"{end.outcome}: {end.reason}",
        worst: Callable[[E], Any] = lambda end: end.seed, sides: Sequence[str] = ("paper", "peer"), about: str = JUDGED,
    ) -> Report:
        """The table, a row a line, written into the folder too; all of them tell of open doors believed to be shut.

        Args:
            what: the missions of a row differ in.
            is_flawed, tell: which missions are to be looked at, and what is said of them; worst: their order.
            sides: columns of others, who have no figures.
            about: what is to be said of the seeds.
        """
        none, columns = (None,) * len(sides), {**figures, "open held shut": OPEN_HELD_SHUT}
        report = Report(
            title, (what, *sides, *columns),
            tuple((row, *none, *(figure(ends) for figure in columns.values())) for row, ends in self.rows.items()),
            notes=(
                f"{self.seeds}{about}", *notes, HELD_SHUT,
                *self.name_flawed(lambda e: is_flawed(e) or bool(e.believed_shut) or e.is_lost_in_place,
                                  lambda e: "; held shut: ".join([tell(e), *e.believed_shut]), worst),
                f"One line per mission: {self.folder / RESULTS}",
            ),
            claims=(*claims, claim_open_doors(self.ends), claim_not_lost_in_place(self.ends)),
        )
        return self.keep(report)

    @property
    def seeds(self) -> str:
        """The first and the last."""
        seeds = [end.seed for end in self.ends]
        return f"Seeds {min(seeds)} to {max(seeds)}"

    def name_flawed(
        self, is_flawed: Callable[[E], bool], tell: Callable[[E], str], worst: Callable[[E], Any]
    ) -> Iterator[str]:
        """The missions to look at, some of each row."""
        for row, ends in self.rows.items():
            if flawed := sorted(filter(is_flawed, ends), key=worst)[:WORST_SHOWN]:
                yield f"{row}, missions to look at: {'; '.join(f'{end.seed} ({tell(end)})' for end in flawed)}"

    def keep(self, report: Report) -> Report:
        """Write a report beside the results."""
        (self.folder / "table.txt").write_text(report.text() + "\n", encoding="utf-8")
        return report


def drive_all(
    name: str, drive: Callable[[Trial], E], trials: Sequence[Trial], kind: type[E], *, quick: bool, seed: int,
    missions: int | None = None, rows: Sequence[str] = (),
) -> Driven[E]:
    """Drive the missions of an experiment; those that its folder has already are not driven again.

    Args:
        drive: a function of a module: drives one mission.
        missions: as the user gave it; such campaigns have a folder of their own.
        rows: their order; that of the trials unless given.
    """
    folder = campaign_folder(f"{name}-{missions}" if missions else name, seed, quick=quick)
    ends = run_trials(drive, trials, kind, folder, "mission")
    names = rows or list(dict.fromkeys(trial.row for trial in trials))
    return Driven({row: some for row in names if (some := [end for end in ends if end.row == row])}, folder)
