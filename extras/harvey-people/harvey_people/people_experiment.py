"""Missions among people who walk by a model: does it arrive, whom does it touch, how near does it come, how late is it?

Along 34 feet of a hallway, with one to six people who come towards it, overtake it, cross its way or stand. The same
mission is driven with the sources of this package; where it takes people as standing where they are; where it stops
until nobody is ahead; without these sources; and where nobody walks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from blackboard import KnowledgeSource, View
from experiments import drives
from experiments.drives import Driven, GoalEnd, Mission, Trial
from experiments.report import Claim, Report
from harvey.agent import build_agent
from harvey.simulation.simulated_run import SimulatedRun, build_head
from harvey.wiring import knowledge_sources
from harvey_people.behaving.passing import PassingWay
from harvey_people.behaving.people_ahead import PeopleAhead, look_ahead
from harvey_people.behaving.people_passer import PeoplePasser
from harvey_people.behaving.people_waiter import PeopleWaiter
from harvey_people.seeing.mover import Mover
from harvey_people.simulated.peopled import STEP_S, People, people_in
from harvey_people.simulated.walking import CLOSE_M, NEAR_M
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from knowledge_sources.settings import Settings
from logs.run_recorder import RunRecorder
from sim.body.collision import Obstacles
from sim.scenario import parse_scenario
from sim.stage import build_stage

AMONG, UNFORESEEN, STOPS, WITHOUT, ALONE = (
    "with its sources", "without prediction", "stops when blocked", "without them", "nobody there")
ROWS = (AMONG, UNFORESEEN, STOPS, WITHOUT, ALONE)
MISSIONS, QUICK = 20, 1
MOST_WALKERS = 6
MIN_REACHED, MOST_LATE, MOST_NEAR, MOST_LONGER = 0.97, 1.5, 0.10, 0.05
STOPS_M = 1.2
"""So far ahead nobody may be, where it stops when blocked."""
STOOD_SIGMA_M = 0.2
LEAST_WAY_M = 3.0
"""A person who has come less far tells nothing of how much longer the way became."""
MISSION = """
world = "research_center"
details = ["research_center_details"]
goal = "(ptrans (hallway (10,4,0)) (hallway (44,4,0)))"
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
        nearest_m: least distance of a person's middle from the robot's rim.
        close_s, near_s: time of a person on the way within CLOSE_M and NEAR_M of it.
        longer: by how much people's ways became longer, on the mean, against the same people without the robot.
    """

    towards: int
    walked_into: int
    nearest_m: float
    close_s: float
    near_s: float
    longer: float


class StillPasser(PeoplePasser):
    """Takes people as standing where they were seen last."""

    def look(self, view: View) -> PeopleAhead | None:
        return look_ahead(view, self._settings, stand)


class StillWaiter(PeopleWaiter):
    """Takes people as standing where they were seen last."""

    def look(self, view: View) -> PeopleAhead | None:
        return look_ahead(view, self._settings, stand)


class StopWaiter(PeopleWaiter):
    """Waits while anybody who may walk is ahead and near; goes to no side, and no slower."""

    def look(self, view: View) -> PeopleAhead | None:
        ahead = look_ahead(view, self._settings)
        if ahead is None:
            return None
        here = ahead.belief.pose
        for mover in (entry.value for entry in ahead.movers if entry.value.is_walking):
            x, y = (here.inverse().apply((mover.x_m, mover.y_m)))
            if 0.0 < x < ahead.belief.robot.radius_m + STOPS_M and abs(y) < 2.0 * ahead.belief.robot.radius_m:
                return ahead._replace(way=PassingWay(ahead.leg.value, 0.0, 0.0, mover, 1.0))
        return ahead._replace(way=None)


def stand(mover: Mover) -> Mover:
    """The same, as if it stood."""
    rows = tuple(tuple(STOOD_SIGMA_M**2 if i == j < 2 else 1e-6 * (i == j) for j in range(4)) for i in range(4))
    return replace(mover, vx_m_per_s=0.0, vy_m_per_s=0.0, covariance=rows)


INSTEAD: Mapping[str, tuple[type[RobotKnowledgeSource], ...]] = {
    UNFORESEEN: (StillPasser, StillWaiter), STOPS: (StopWaiter,)}
"""What acts in a row in place of the people passer and the people waiter."""
KEPT: Mapping[str, tuple[str, ...]] = {
    UNFORESEEN: ("mover_watcher", "mover_explainer", "people_masker"),
    STOPS: ("mover_watcher", "mover_explainer", "people_masker"), WITHOUT: ()}


def drive(trial: Trial) -> PeopleEnd:
    """Drive the mission of a trial."""
    text = "walkers = []\n" + MISSION if trial.row == ALONE else MISSION + draw_walkers(trial.seed)
    stage = build_stage(parse_scenario(text))
    head = build_head(stage, trial.seed)
    if trial.row in KEPT:
        head = replace(head, plugins={name: of for name, of in head.plugins.items() if name in KEPT[trial.row]})
    agent = build_agent(head, _sources(INSTEAD.get(trial.row, ())))
    with SimulatedRun(stage, head, agent, RunRecorder(None, head, agent.world, agent.robot)) as driving:
        result = driving.drive(None)
        people, lasted_s = people_in(driving.simulated_body.building), driving.simulated_body.truth.time_s
    into = sum("walked into it" in happening.what for happening in result.happened or ())
    return PeopleEnd.of(
        trial, Mission(result, {}), walked_into=into,
        towards=sum(contact.thing.startswith("people/") for contact in result.contacts or ()),
        nearest_m=min((person.nearest_m for person in people), default=99.0),
        close_s=sum(person.close_s for person in people), near_s=sum(person.near_s for person in people),
        longer=measure_longer(people, walk_alone(people_in(stage.body(trial.seed).building),
                                                 stage.building.obstacles, lasted_s)))


def _sources(instead: tuple[type[RobotKnowledgeSource], ...]) -> Callable[[Settings], tuple[KnowledgeSource, ...]]:
    return lambda settings: (*knowledge_sources(settings), *(source(settings) for source in instead))


def walk_alone(people: People, obstacles: Obstacles, lasts_s: float) -> People:
    """The same people so much later, where there is no robot."""
    for step in range(math.ceil(lasts_s / STEP_S)):
        people = tuple(person.after(step * STEP_S, STEP_S, [other for other in people if other is not person], None,
                                    obstacles) for person in people)
    return people


def measure_longer(people: People, alone: People) -> float:
    """By how much people walk further to come as far on their ways, on the mean; 0 where nobody tells."""
    ratios = [(one.walked_m / one.measure_way_m()) / (other.walked_m / other.measure_way_m()) - 1.0
              for one, other in zip(people, alone, strict=True)
              if min(one.measure_way_m(), other.measure_way_m()) > LEAST_WAY_M]
    return float(np.mean(ratios)) if ratios else 0.0


def draw_walkers(seed: int) -> str:
    """One to six ``[[walkers]]``."""
    rng = np.random.default_rng(seed)
    count, side_ft = int(rng.integers(1, MOST_WALKERS + 1)), float(rng.choice([1.8, 6.2]))  # where they stand
    return "".join(_draw_walker(rng, number, side_ft) for number in range(count))


def _draw_walker(rng: np.random.Generator, number: int, side_ft: float) -> str:
    kind = ("comes", "overtakes", "crosses", "stands")[int(rng.integers(4))]
    y_ft = side_ft if kind == "stands" else float(rng.uniform(2.0, 6.0))
    ways = {"comes": (("hallway", 80.0, y_ft), ("hallway", 3.0, y_ft)),
            "overtakes": (("hallway", 3.0, 2.0 if y_ft < 4.0 else 6.0), ("hallway", 80.0, 2.0 if y_ft < 4.0 else 6.0)),
            "crosses": CROSSINGS[int(rng.integers(len(CROSSINGS)))],
            "stands": (("hallway", float(rng.uniform(15.0, 38.0)), y_ft),)}
    way = ", ".join(f'{{locale = "{locale}", x_ft = {x:.2f}, y_ft = {y:.2f}}}' for locale, x, y in ways[kind])
    starts_s = float(rng.uniform(0.0, 30.0)) if kind != "stands" else 0.0
    return (f'[[walkers]]\nname = "{kind}-{number}"\nway = [{way}]\nspeed_m_per_s = {rng.uniform(0.5, 1.5):.2f}\n'
            f"starts_s = {starts_s:.1f}\nmakes_way = {'true' if rng.random() < 0.7 else 'false'}\n")


def _share(ends: Sequence[PeopleEnd], time_s: Callable[[PeopleEnd], float]) -> float:
    """The part of the robot's time, of each person alone."""
    return sum(map(time_s, ends)) / sum(e.robot_s for e in ends)


FIGURES: Mapping[str, drives.Figure[PeopleEnd]] = {
    **drives.pick("missions", "reached", "proves at least"),
    "towards a person": drives.total(lambda e: e.towards), "walked into": drives.total(lambda e: e.walked_into),
    "nearest m": lambda ends: min(end.nearest_m for end in ends),
    f"within {CLOSE_M:g} m": lambda ends: f"{_share(ends, lambda e: e.close_s):.1%}",
    f"within {NEAR_M:g} m": lambda ends: f"{_share(ends, lambda e: e.near_s):.0%}",
    "ways longer": lambda ends: f"{np.mean([e.longer for e in ends]):.1%}",
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
            f" nearest: a person's middle from the robot's rim; within {CLOSE_M:g} and {NEAR_M:g} m of it: of the time,"
            " the sum over people on their way. 30 % of the people make no way. Each act is charged a stated time, in"
            " which people walk. Ways longer: than those of the same people without the robot.",
            "Without prediction: people are taken as standing where they were seen last. Stops when blocked: it"
            f" stands until nobody who walks is within {STOPS_M:g} m ahead. Without them: the sources of the core"
            " alone, to which people are things in the way.",
        ),
        claims=_claims(driven), is_flawed=lambda e: not e.is_reached or e.towards > 0,
    )


def _claims(driven: Driven[PeopleEnd]) -> Iterator[Claim]:
    among = driven.rows[AMONG]
    yield drives.claim_share(f"at least {MIN_REACHED:.0%} reach", lambda e: e.is_right, among, MIN_REACHED)
    yield drives.claim_none("no contact in which it moves towards a person", among, lambda e: e.towards > 0)
    yield drives.claim_none("no milestone is accepted at a wrong place", among)
    late = sum(e.robot_s for e in among) / sum(e.robot_s for e in driven.rows[ALONE])
    yield f"at most {MOST_LATE:g} times as late as alone, on the mean: {late:.2f}", late <= MOST_LATE
    near = _share(among, lambda e: e.near_s)
    yield f"somebody within {NEAR_M:g} m at most {MOST_NEAR:.0%} of the time: {near:.0%}", near <= MOST_NEAR
    longer = float(np.mean([e.longer for e in among]))
    yield f"people's ways longer by at most {MOST_LONGER:.0%}, on the mean: {longer:.1%}", longer <= MOST_LONGER
