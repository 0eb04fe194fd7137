"""Missions on floors whose doors differ from the model: does the robot see it, and find another way?

A door on the way is shut, with another way or with none; it opens or shuts during the mission; a door that the model
has closed stands open; there is a door that the model lacks; a leaf stands before an open one; and nothing differs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from blackboard import Decision
from experiments import drives
from experiments.drives import Driven, End, Trial
from experiments.generated.door_missions import write_door_mission
from experiments.report import Claim, Report
from harvey.campaign.mission_task import Task
from sim.scenario import load_scenario
from world_models.entries import DoorState
from world_models.words import listed

SHARES: Mapping[str, float] = {
    "another way": 0.3, "no way": 0.25, "extra door": 0.05, "stands open": 0.05, "opens": 0.05, "shuts": 0.05,
    "ajar": 0.05, "as filed": 0.15, "loose leaf": 0.05,
}
"""Of the missions, of each case of :data:`experiments.generated.door_missions.CASES`. A leaf that is ajar stands into a
room: that is for those who see what is in the way, and only counted here."""
MISSIONS = 1_000
QUICK = ("another way", "no way", "shuts", "as filed", "loose leaf")
HARMLESS = ("opens", "shuts", "stands open", "extra door", "as filed")
MIN_OTHER_WAY, MIN_BLOCKED = 0.99, 1.0


@dataclass(frozen=True, slots=True)
class DoorEnd(End):
    """How a mission ended.

    Attributes:
        door: the door that differs; "" where none is.
        is_found: whether that was ever held to be shut.
        false_states: what was held of doors and is not so.
    """

    door: str
    is_found: bool
    false_states: list[str]

    @property
    def is_right(self) -> bool:
        """Whether it ended as it should."""
        if self.row == "no way":
            return self.outcome == "blocked" and f"{self.door} is shut" in self.reason
        return self.is_reached


def drive(trial: Trial) -> DoorEnd:
    """Drive the mission of a trial."""
    states: dict[tuple[str, str], float] = {}

    def note(decision: Decision) -> None:
        """Note each door and its state, with when it was first seen so, where that is certain."""
        for change in decision.made:
            value = change.entry.value
            if isinstance(value, DoorState) and value.state != "unknown":
                states.setdefault((value.door, value.state), value.seen_s)

    with TemporaryDirectory() as folder:
        mission = write_door_mission(Path(folder), trial.seed, trial.row)
        doors = load_scenario(mission.path).truth.doors
        driven = drives.drive_task(Task(str(mission.path), (), trial.seed), note)
    wrong = []
    for (door, state), seen_s in sorted(states.items()):
        true = {d.state for d in doors if d.name == door and d.at_s <= seen_s < d.until_s} or {"open"}
        if (state == "open") != (true == {"open"}):
            wrong.append(f"{door} is {state} at {seen_s:.1f} s")
    found = any(door == mission.door and state != "open" for door, state in states)
    return DoorEnd.of(trial, driven, door=mission.door, is_found=found, false_states=wrong)


FIGURES: Mapping[str, drives.Figure[DoorEnd]] = {
    **drives.pick("missions"), "as it should end": drives.total(lambda e: e.is_right),
    "proves at least": drives.proved(lambda e: e.is_right), "door found": drives.total(lambda e: e.is_found),
    "false states": drives.total(lambda e: bool(e.false_states)),
    **drives.pick("false accepts", "contacts", "relocated", "robot's mean s", "mean CPU s"),
}


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Drive each case's share of so many missions; quick: one of each of some cases."""
    shares = {case: share for case, share in SHARES.items() if case in QUICK or not quick}
    trials = drives.spread(shares, drives.first_seed(seed), None if quick else missions or MISSIONS)
    driven = drives.drive_all("doors", drive, trials, DoorEnd, quick=quick, seed=seed, missions=missions)
    return driven.report(
        "Missions on floors whose doors differ", "doors", FIGURES,
        notes=(
            "as it should end: reached; with no way left blocked, and the outcome names that door. door found: it was"
            " held to be shut at some time; a way need not lead past it. false states: a door that is held to"
            " be shut and is open, or open and is shut, when it was seen. false accepts: milestones verified while the"
            " robot was elsewhere.",
            f"The paper's doors are as its model says, and {drives.NO_PEER}",
        ),
        claims=_claims(driven), is_flawed=lambda e: not e.is_right or bool(e.false_states) or bool(e.false_accepts),
        tell=lambda e: "; ".join([f"{e.outcome}: {e.reason}", *e.false_states]),
    )


def _claims(driven: Driven[DoorEnd]) -> Iterator[Claim]:
    yield drives.claim_share(f"another way: at least {MIN_OTHER_WAY:.0%} take another way", lambda e: e.is_right,
                             driven.rows["another way"], MIN_OTHER_WAY)
    yield drives.claim_share(f"no way: at least {MIN_BLOCKED:.0%} end blocked, and name the door", lambda e: e.is_right,
                             driven.rows["no way"], MIN_BLOCKED)
    cases = [case for case in HARMLESS if case in driven.rows]
    yield drives.claim_share(f"{listed(cases, 9)}: harms nothing: at least {MIN_OTHER_WAY:.0%} reach",
                             lambda e: e.is_right, [end for case in cases for end in driven.rows[case]], MIN_OTHER_WAY)
    for case in ("as filed", "loose leaf"):
        yield drives.claim_none(f"{case}: no door is held to be shut", driven.rows[case],
                                lambda e: bool(e.false_states))
    yield drives.claim_none("no milestone is accepted at a wrong place", driven.ends)
