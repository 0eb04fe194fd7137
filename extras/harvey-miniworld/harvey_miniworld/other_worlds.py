"""Missions in rooms by others: miniworld's textures and renderer, and of each floor only what a floor plan says.

60 on 6 floors, 20 in which the robot is carried to anywhere, 20 with things in the way.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments import drives
from experiments.drives import Driven, GoalEnd, Mission, Trial
from experiments.report import Claim, Report
from harvey_miniworld.drawn_floor import load_miniworld
from harvey_miniworld.floor_missions import draw_mission
from harvey_miniworld.floor_missions import drive as drive_mission

SHARES: Mapping[str, int] = {"plain": 60, "kidnap": 20, "things": 20}
FLOORS = 6
AT_GOAL_M = 0.1
"""So near to its goal a mission has arrived."""
MIN_REACHED, MIN_FOUND, MAX_CONTACT_M_PER_S = 0.9, 0.8, 0.1


@dataclass(frozen=True, slots=True)
class OtherWorldEnd(GoalEnd):
    """How a mission ended.

    Attributes:
        fastest_m_per_s: of its contacts; 0 without any.
    """

    fastest_m_per_s: float

    @property
    def has_arrived(self) -> bool:
        """Whether it says that it reached its goal, and truly is there."""
        return self.is_reached and self.error_m <= AT_GOAL_M

    @property
    def is_found(self) -> bool:
        """Whether it knew at the end where it was."""
        return self.is_reached and self.belief_off_m is not None and self.belief_off_m <= AT_GOAL_M

    @property
    def is_false(self) -> bool:
        """Whether a milestone was accepted at a wrong place, or the goal."""
        return self.false_accepts > 0 or self.is_wrong


def drive(trial: Trial) -> OtherWorldEnd:
    """Drive the mission of a trial; floors are shared by missions."""
    first = trial.seed - trial.seed % 10_000
    drawn = draw_mission(trial.seed, trial.row, first + trial.seed % FLOORS)
    with TemporaryDirectory() as folder:
        result, body = drive_mission(drawn, trial.seed, Path(folder))
    return OtherWorldEnd.of(trial, Mission(result, {}), fastest_m_per_s=max(body.contacts, default=0.0))


FIGURES: Mapping[str, drives.Figure[OtherWorldEnd]] = {
    **drives.pick("missions"), "arrived": drives.total(lambda e: e.has_arrived),
    "proves at least": drives.proved(lambda e: e.has_arrived), "lost": drives.total(lambda e: e.outcome == "lost"),
    "blocked": drives.total(lambda e: e.outcome == "blocked"),
    **drives.pick("verified", "refuted", "not testable", "false accepts", "contacts", "relocated", "robot's mean s",
                  "mean CPU s"),
    "most CPU s": lambda ends: max((end.wall_s for end in ends), default=0.0),
}


def run(quick: bool, seed: int) -> Report:
    """Drive them all; quick: one of each row. Raises BadInput where miniworld cannot draw."""
    load_miniworld()
    first = drives.first_seed(seed)
    trials = [Trial(row, first + k) for row, number in SHARES.items() for k in range(1 if quick else number)]
    driven = drives.drive_all("other-worlds", drive, trials, OtherWorldEnd, quick=quick, seed=seed)
    return driven.report(
        "Missions in rooms by others (miniworld), by floor plan", "missions", FIGURES,
        notes=(
            f"arrived: says so, and truly is within {AT_GOAL_M:g} m of the goal. false accepts: milestones"
            " verified while the robot was elsewhere. kidnap: carried to anywhere after 1 to 5 m. things: one in the"
            " corridor, one in the last room. Put down 3 cm and 2 degrees off, which is the sigma that it is told.",
            f"The paper drove in its own building, and {drives.NO_PEER}",
        ),
        claims=_claims(driven), is_flawed=lambda e: not e.has_arrived or e.is_false,
    )


def _claims(driven: Driven[OtherWorldEnd]) -> Iterator[Claim]:
    rows = driven.rows
    yield drives.claim_share(f"plain: at least {MIN_REACHED:.0%} arrive", lambda e: e.has_arrived, rows["plain"],
                             MIN_REACHED)
    yield drives.claim_share(f"kidnap: at least {MIN_FOUND:.0%} find themselves and arrive", lambda e: e.is_found,
                             rows["kidnap"], MIN_FOUND)
    yield drives.claim_none(f"things: no contact above {MAX_CONTACT_M_PER_S:g} m/s", rows["things"],
                            lambda e: e.fastest_m_per_s > MAX_CONTACT_M_PER_S)
    yield drives.claim_none("nothing is accepted at a wrong place, and no goal reached wrongly", driven.ends,
                            lambda e: e.is_false)
