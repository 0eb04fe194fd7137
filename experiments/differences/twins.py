"""Missions on floors of identical rooms: does it use what it was told, and notice where that is wrong?

The robot is told the room at the start, right with probability 0.98. Otherwise it is put down in another room that
looks the same, at the same place of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from blackboard import Decision, Level, Ref
from experiments import drives
from experiments.drives import Driven, GoalEnd, Trial
from experiments.generated.missions import write_twin_mission
from experiments.report import Cell, Claim, Report
from experiments.trials import at_least, at_most, judge_rare
from harvey.campaign.mission_task import Task
from world_models.entries import AliasOdds, Discrepancy, Outcome, PlaceOdds

RIGHT, WRONG = "right", "wrong"
MISSIONS, QUICK_MISSIONS = 3_000, 4
P_TOLD_RIGHT = 0.98
MIN_REACHED, MIN_NOTICED, MAX_WRONG = 0.99, 0.90, 0.001


@dataclass(frozen=True, slots=True)
class TwinEnd(GoalEnd):
    """How a mission ended, in whose row the robot was told the room right or wrong.

    Attributes:
        rooms: number of identical rooms.
        doubts: times that the robot doubted its place at the goal level.
        by_odds: times that a place was believed by what was told or tracked.
        said: probability that it is where it believes, as it says at the end where other places agree with its
            pictures; None where it says nothing of others, and is sure.
    """

    rooms: int
    doubts: int
    by_odds: int
    said: float | None

    @property
    def is_wrong_and_sure(self) -> bool:
        """Whether it says that it reached the goal, says nothing of other places, and is at one."""
        return self.is_wrong and self.said is None

    @property
    def is_noticed(self) -> bool:
        """Whether it doubted its place, and does not say that it is at the goal while it is elsewhere."""
        return self.doubts > 0 and not self.is_wrong


def drive(trial: Trial) -> TwinEnd:
    """Drive the mission of a trial."""
    doubts: set[str] = set()
    odds: list[PlaceOdds] = []
    twins: dict[Ref, float] = {}
    said: list[float] = []

    def note(decision: Decision) -> None:
        for change in decision.made:
            value = change.entry.value
            if isinstance(value, Discrepancy) and value.level is Level.GOAL:
                doubts.add(change.entry.id)
            elif isinstance(value, PlaceOdds):
                odds.append(value)
            elif isinstance(value, AliasOdds):
                twins[change.entry.ref] = value.probability
            elif isinstance(value, Outcome):
                said[:] = [twins[ref] for ref in change.entry.because if ref in twins]

    with TemporaryDirectory() as folder:
        mission = write_twin_mission(Path(folder), trial.seed, is_told_right=trial.row == RIGHT)
        driven = drives.drive_task(Task(str(mission.path), (), trial.seed), note)
    return TwinEnd.of(trial, driven, rooms=mission.rooms, doubts=len(doubts), by_odds=len(odds),
                      said=said[0] if said else None)


def _wrong_at_most(ends: Sequence[TwinEnd]) -> Cell:
    return f"{at_most(sum(e.is_wrong_and_sure for e in ends), len(ends)):.2%}"


FIGURES: Mapping[str, drives.Figure[TwinEnd]] = {
    **drives.pick("missions"), "reached": drives.total(lambda e: e.is_right),
    "proves at least": drives.proved(lambda e: e.is_right), "noticed": drives.total(lambda e: e.is_noticed),
    "wrong, and said so of other places": drives.total(lambda e: e.is_wrong and not e.is_wrong_and_sure),
    "wrong and confident": drives.total(lambda e: e.is_wrong_and_sure), "proves at most": _wrong_at_most,
    "believed by odds": drives.total(lambda e: e.by_odds), **drives.pick("relocated", "robot's mean s", "mean CPU s"),
}


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Drive so many missions; quick: one of the few is told wrong."""
    first = drives.first_seed(seed)
    trials = [Trial(RIGHT if (k > 0 if quick else _is_told_right(first + k)) else WRONG, first + k)
              for k in range(missions or (QUICK_MISSIONS if quick else MISSIONS))]
    driven = drives.drive_all("twins", drive, trials, TwinEnd, quick=quick, seed=seed, missions=missions,
                              rows=(RIGHT, WRONG))
    return driven.report(
        "Missions on floors of 5 to 40 identical rooms", "told", FIGURES,
        notes=(
            "reached: the goal, and in truth. noticed: it doubted its place, and does not end as reached elsewhere."
            " wrong and confident: it ends as reached, is elsewhere, and says nothing of other places. Where others"
            " agree with all pictures it says so, and how likely it is where it believes. believed by odds: times that"
            " a place was believed by what was told or tracked, of several that look alike.",
            "Paper and peers have no such missions: the paper's robot always knows where it begins.",
        ),
        claims=_claims(driven, quick), is_flawed=lambda e: not (e.is_right if e.row == RIGHT else e.is_noticed),
        tell=lambda e: f"{e.rooms} rooms, {e.outcome}: {e.reason}",
    )


def _is_told_right(seed: int) -> bool:
    return bool(np.random.default_rng([seed, 11]).random() < P_TOLD_RIGHT)


def _claims(driven: Driven[TwinEnd], quick: bool) -> Iterator[Claim]:
    if right := driven.rows.get(RIGHT):
        yield drives.claim_share(f"told right: at least {MIN_REACHED:.0%} reach", lambda e: e.is_right, right,
                                 MIN_REACHED)
    if (wrong := driven.rows.get(WRONG)) and not quick:
        yield drives.claim_share(f"told wrong: at least {MIN_NOTICED:.0%} notice", lambda e: e.is_noticed, wrong,
                                 MIN_NOTICED)
    confident, of = sum(e.is_wrong_and_sure for e in driven.ends), len(driven.ends)
    yield (f"wrong and confident: at most {MAX_WRONG:.1%}: {confident} of {of}, so at most"
           f" {at_most(confident, of):.2%}", judge_rare(confident, of, MAX_WRONG))
    if not quick and (unsure := [e for e in driven.ends if e.is_reached and e.said is not None]):
        yield claim_said(unsure)


def claim_said(unsure: Sequence[TwinEnd]) -> Claim:
    """That it is elsewhere no more often than it says; only of missions that are told wrong as often as it assumes."""
    wrong, said = sum(e.is_wrong for e in unsure), float(np.mean([1.0 - (e.said or 0.0) for e in unsure]))
    return (f"where it names other places it is there no more often than it says ({said:.1%}): {wrong} of"
            f" {len(unsure)}, so at least {at_least(wrong, len(unsure)):.1%}", at_least(wrong, len(unsure)) <= said)
