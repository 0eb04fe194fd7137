"""Missions among people who walk by a model: does it arrive, whom does it touch, how near does it come, how late is it?

Along a hallway of 40 feet, with one to three people who come towards it, overtake it, cross its way or stand. The same
mission is driven with the sources of this package, without them, and where nobody walks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from experiments import drives
from experiments.drives import Driven, GoalEnd, Mission, Trial
from experiments.report import Claim, Report
from harvey.agent import build_agent
from harvey.simulation.simulated_run import SimulatedRun, build_head
from harvey_people.peopled import people_in
from harvey_people.walking import NEAR_M
from logs.run_recorder import RunRecorder
from sim.scenario import parse_scenario
from sim.stage import build_stage

AMONG, WITHOUT, ALONE = "with its sources", "without them", "nobody there"
ROWS = (AMONG, WITHOUT, ALONE)
MISSIONS, QUICK = 30, 2
MIN_REACHED = 0.97
MISSION = """
world = "research_center"
details = ["research_center_details"]
goal = "(ptrans (hallway (4,4,0)) (hallway (44,4,0)))"
[start]
heading_deg = 0.0
put_down_sigma_m = 0.02
put_down_sigma_deg = 1.0
[ranges]
sensors = 24
[limits]
max_collisions = 10
max_time_s = 400.0
"""
CROSSINGS = (
    (("conference-room", 7.5, 10.5), ("hallway", 43.5, 6.0), ("hallway", 46.3, 1.5), ("graduate-office", 7.8, 10.0)),
    (("graduate-office", 7.8, 10.0), ("hallway", 46.3, 1.5), ("hallway", 43.5, 6.0), ("conference-room", 7.5, 10.5)),
)
"""Ways across, from door to door: locale and place [ft]."""


@dataclass(frozen=True, slots=True)
class PeopleEnd(GoalEnd):
    """How a mission ended.

    Attributes:
        towards: contacts in which the robot moved towards a person.
        walked_into: how often a person walked into the robot.
        nearest_m: least distance of a person's middle from the robot's rim; near_s: time within NEAR_M of it.
    """

    towards: int
    walked_into: int
    nearest_m: float
    near_s: float


def drive(trial: Trial) -> PeopleEnd:
    """Drive the mission of a trial."""
    text = "walkers = []\n" + MISSION if trial.row == ALONE else MISSION + draw_walkers(trial.seed)
    stage = build_stage(parse_scenario(text))
    head = build_head(stage, trial.seed)
    if trial.row == WITHOUT:
        head = replace(head, plugins={})
    agent = build_agent(head)
    with SimulatedRun(stage, head, agent, RunRecorder(None, head, agent.world, agent.robot)) as driving:
        result = driving.drive(None)
        people = people_in(driving.simulated_body.building)
    into = sum("walked into it" in happening.what for happening in result.happened or ())
    return PeopleEnd.of(
        trial, Mission(result, {}), walked_into=into,
        towards=sum(contact.thing.startswith("people/") for contact in result.contacts or ()),
        nearest_m=min((person.nearest_m for person in people), default=99.0),
        near_s=sum(person.near_s for person in people))


def draw_walkers(seed: int) -> str:
    """One to three ``[[walkers]]``."""
    rng = np.random.default_rng(seed)
    return "".join(_draw_walker(rng, number) for number in range(int(rng.integers(1, 4))))


def _draw_walker(rng: np.random.Generator, number: int) -> str:
    kind = ("comes", "overtakes", "crosses", "stands")[int(rng.integers(4))]
    y_ft = float(rng.choice([1.8, 6.2]) if kind == "stands" else rng.uniform(2.0, 6.0))
    ways = {"comes": (("hallway", 80.0, y_ft), ("hallway", 3.0, y_ft)),
            "overtakes": (("hallway", 3.0, 2.0 if y_ft < 4.0 else 6.0), ("hallway", 80.0, 2.0 if y_ft < 4.0 else 6.0)),
            "crosses": CROSSINGS[int(rng.integers(len(CROSSINGS)))],
            "stands": (("hallway", float(rng.uniform(15.0, 38.0)), y_ft),)}
    way = ", ".join(f'{{locale = "{locale}", x_ft = {x:.2f}, y_ft = {y:.2f}}}' for locale, x, y in ways[kind])
    starts_s = float(rng.uniform(0.0, 30.0)) if kind != "stands" else 0.0
    return (f'[[walkers]]\nname = "{kind}-{number}"\nway = [{way}]\nspeed_m_per_s = {rng.uniform(0.5, 1.5):.2f}\n'
            f"starts_s = {starts_s:.1f}\nmakes_way = {'true' if rng.random() < 0.7 else 'false'}\n")


FIGURES: Mapping[str, drives.Figure[PeopleEnd]] = {
    **drives.pick("missions", "reached", "proves at least"),
    "towards a person": drives.total(lambda e: e.towards), "walked into": drives.total(lambda e: e.walked_into),
    "nearest m": lambda ends: min(end.nearest_m for end in ends),
    f"within {NEAR_M:g} m": lambda ends: f"{sum(e.near_s for e in ends) / sum(e.robot_s for e in ends):.0%}",
    **drives.pick("robot's mean s", "refuted", "not testable", "false accepts", "mean CPU s"),
}


def run(quick: bool, seed: int) -> Report:
    """Drive them all; quick: two of each row."""
    first = drives.first_seed(seed)
    trials = [Trial(row, first + k) for k in range(QUICK if quick else MISSIONS) for row in ROWS]
    driven = drives.drive_all("people", drive, trials, PeopleEnd, quick=quick, seed=seed, rows=ROWS)
    return driven.report(
        "Missions among people (social force, 1995)", "the robot", FIGURES,
        notes=(
            "towards a person: contacts in which the robot moved. walked into: by people, the robot's way or none."
            f" nearest: a person's middle from the robot's rim; within {NEAR_M:g} m of it, of the time, each person"
            " alone. 30 % of the people make no way. Each act is charged a stated time, in which people walk.",
            "Without them: the sources of the core alone, to which people are things in the way.",
        ),
        claims=_claims(driven), is_flawed=lambda e: not e.is_reached or e.towards > 0,
    )


def _claims(driven: Driven[PeopleEnd]) -> Iterator[Claim]:
    among = driven.rows[AMONG]
    yield drives.claim_share(f"at least {MIN_REACHED:.0%} reach", lambda e: e.is_right, among, MIN_REACHED)
    yield drives.claim_none("no contact in which it moves towards a person", among, lambda e: e.towards > 0)
    yield drives.claim_none("no milestone is accepted at a wrong place", among)
    late = sum(e.robot_s for e in among) / sum(e.robot_s for e in driven.rows[ALONE])
    yield f"at most 1.5 times as late as alone, on the mean: {late:.2f}", late <= 1.5
