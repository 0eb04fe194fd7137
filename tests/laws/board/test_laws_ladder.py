"""The ladder of Figure 2 with the knowledge sources themselves, without images: only what is measured is given.

Tracker, judge and localizer are replaced by knowledge sources that post what a picture says in figures; all others,
and the board, are the real ones. The body does what it is asked. Every picture's figure is drawn by hypothesis.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import cache

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule

from blackboard import (
    Change,
    Decision,
    Effect,
    Entry,
    Level,
    Post,
    Posted,
    Quiescence,
    Ref,
    Revise,
    Revised,
    View,
    Watch,
)
from harvey.runner.ports import build_scheduler
from harvey.simulation.simulated_run import build_robot_model
from harvey.wiring import KNOWLEDGE_SOURCES
from knowledge_sources.goal.discrepancy_raiser import MAX_CHECKS_PER_SUBGOAL, MAX_LOST_PER_MISSION
from knowledge_sources.methods.verification import MAX_MILESTONE_LOOKS
from knowledge_sources.reads import (
    active_goal,
    find_belief,
    find_building,
    open_discrepancy,
    open_milestone,
    rolling_course,
    unmeasured_doubt,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from knowledge_sources.settings import DEFAULT
from sim.scenario import load_scenario, with_settings
from world_models.building.world import World
from world_models.entries import (
    CameraPicture,
    Certificate,
    Course,
    Discrepancy,
    Goal,
    Hypothesis,
    Milestone,
    MotionReport,
    MotorCommand,
    Outcome,
    PictureRequest,
    PlanSketch,
    PoseFix,
    diagonal,
)
from world_models.files.world_files import load_world
from world_models.robot import RobotModel

ACTION_PX, PLAN_PX = 6.0, DEFAULT.plan.max_deviation_px
PERCEIVERS = {"correlator_tracker", "landmark_chooser", "line_finder", "matcher", "med_r_and_t", "milestone_judge",
              "probe_photographer", "panorama_builder", "localizer", "prober", "pose_adopter", "goal_renewer",
              "floor_watcher", "door_watcher", "shut_door_explainer"}
SURE = diagonal(0.002, 0.001)


UNCONFIRMED = -1.0
"""What a picture says of a milestone where it cannot be told."""


def figure(frame: Entry[CameraPicture]) -> float:
    """What a picture says: how far things are from where they are expected [px], or UNCONFIRMED."""
    return float(frame.value.jpeg)


class ScriptedTracker(RobotKnowledgeSource):
    """Posts what the action level measures, and corrects the belief where it may."""

    level, closes, priority = Level.ACTION, Level.ACTION, 0.9
    on = (Watch(CameraPicture, (Posted,), lambda f: f.purpose == "track"),)
    writes = (Hypothesis, Discrepancy)

    def bind(self, view: View, trigger: Change) -> Change | None:
        if unmeasured_doubt(view) is not None or open_discrepancy(view, Level.GOAL) is not None:
            return None
        return trigger if find_belief(view) is not None else None

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        belief, last = find_belief(view), open_discrepancy(view, Level.ACTION)
        found = Discrepancy(Level.ACTION, "landmarks are elsewhere", figure(trigger.entry), (ACTION_PX, PLAN_PX), "px")
        assert belief is not None
        if not found.exceeds:
            yield Revise(belief, replace(belief.value, covariance=SURE, basis="tracks"), (trigger.entry,))
        if last is None or not last.value.exceeds:
            yield Post(found, (trigger.entry,)) if last is None else Revise(last, found, (trigger.entry,))


class ScriptedJudge(RobotKnowledgeSource):
    """Posts what the plan level measures of the milestone that is looked for, and its verdict."""

    level, priority = Level.PLAN, 0.8
    on = (Watch(CameraPicture, (Posted,), lambda f: f.purpose == "milestone"),)
    writes = (PoseFix, Certificate, Milestone, Discrepancy)

    def bind(self, view: View, trigger: Change) -> Change | None:
        return trigger if find_belief(view) is not None and open_milestone(view) is not None else None

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        belief, milestone, last = find_belief(view), open_milestone(view), open_discrepancy(view, Level.PLAN)
        assert belief is not None and milestone is not None
        px = figure(trigger.entry)
        verdict = "not testable" if px == UNCONFIRMED else "verified" if px <= PLAN_PX else "refuted"
        here, nothing = belief.value.world_from_robot(find_building(view)), np.zeros((0, 2))
        fix = Post(PoseFix("", here, np.array(SURE), nothing[:, 0] > 0, nothing, ()), (trigger.entry,))
        yield fix
        told = Certificate(milestone.id, _next_fix(view), verdict, "", 9, 9, 9, 1.0, 0.5, 0.0, 0.0, px, PLAN_PX,
                           0.0, 0.0, 0.006)
        yield Post(told, (fix, milestone))
        yield Revise(milestone, replace(milestone.value, status=verdict), (fix,))
        if px == UNCONFIRMED and len(milestone.value.tried) + 1 < MAX_MILESTONE_LOOKS:
            return
        magnitude = math.inf if px == UNCONFIRMED else px
        found = Discrepancy(Level.PLAN, "a milestone is elsewhere", magnitude, (0.0, PLAN_PX), "px")
        yield Post(found, (fix,)) if last is None else Revise(last, found, (fix,))


def _next_fix(view: View) -> str:
    last = view.latest(PoseFix)
    return f"PoseFix-{1 + (0 if last is None else int(last.id.partition('-')[2]))}"


class ScriptedRelocalizer(RobotKnowledgeSource):
    """Finds the robot where it believes to be, or not at all."""

    level, closes, priority = Level.GOAL, Level.GOAL, 0.7
    on = (Watch(Discrepancy, (Posted,), lambda d: d.is_open and d.level is Level.GOAL),
          Watch(CameraPicture, (Posted,), lambda f: f.purpose == "probe"))
    writes = (PictureRequest, Hypothesis, Goal, Discrepancy)

    def bind(self, view: View, trigger: Change) -> Change | None:
        return trigger if open_discrepancy(view, Level.GOAL) is not None and find_belief(view) is not None else None

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        belief, lost, goal = find_belief(view), open_discrepancy(view, Level.GOAL), active_goal(view)
        assert belief is not None and lost is not None
        if isinstance(trigger.entry.value, Discrepancy):
            yield Post(PictureRequest("probe"), (lost,))
        elif goal is not None and figure(trigger.entry) <= PLAN_PX:
            here = Revise(belief, replace(belief.value, basis="relocalization"), (trigger.entry, lost))
            yield here
            for level in Level:
                found = open_discrepancy(view, level)
                if found is not None:
                    yield Revise(found, found.value.corrected(), (here,))
            yield Revise(goal, replace(goal.value, status="abandoned"), (here,))
            yield Post(Goal(goal.value.origin, goal.value.destination), (here,))


class ScriptedBody:
    """Does what it is told; a picture says what is next for its purpose."""

    name = "body"

    def __init__(self) -> None:
        self.says: dict[str, float] = {"track": 1.0, "milestone": 1.0, "probe": 1.0}
        self.is_stuck = False
        self._number = 0

    def answer(self, change: Change) -> Iterable[Effect]:
        value, entry = change.entry.value, change.entry
        if isinstance(value, MotorCommand) and isinstance(change, Posted):
            yield Post(MotionReport(value.turn_rad, 0.0 if self.is_stuck else value.move_m, 1.0, 0.0), (entry,))
        elif isinstance(value, Course):
            yield Post(MotionReport(0.0, value.speed_m_per_s / 4.0, 0.25, 0.0), (entry,))
            yield self._picture(entry, "track")
        elif isinstance(value, PictureRequest) and isinstance(change, Posted):
            yield self._picture(entry, value.purpose)

    def _picture(self, entry: Entry[object], purpose: str) -> Effect:
        self._number += 1
        return Post(CameraPicture(str(self.says[purpose]).encode(), self._number, 0.0, purpose), (entry,))


@cache
def world() -> World:
    return load_world(load_scenario("lab-to-allens-office").world)


@cache
def robot(continuous: bool) -> RobotModel:
    goal = {"goal": "(ptrans (allens-office (7,4,0)) (allens-office (13,12,0)))", "motion.continuous": continuous}
    return build_robot_model(with_settings(load_scenario("lab-to-allens-office"), goal), world())


class Ladder:
    """A mission of the real knowledge sources with scripted measurements; each decision is compared with the laws."""

    def __init__(self, continuous: bool = False) -> None:
        real = [source() for source in KNOWLEDGE_SOURCES]
        scripted = [ScriptedTracker(), ScriptedJudge(), ScriptedRelocalizer()]
        self.body = ScriptedBody()
        self.seen: dict[Ref, Discrepancy] = {}
        self.scheduler = build_scheduler(
            [*(s for s in real if s.name not in PERCEIVERS), *scripted], world(), robot(continuous), ports=[self.body])
        task = with_settings(load_scenario("lab-to-allens-office"), {
            "goal": "(ptrans (allens-office (7,4,0)) (allens-office (13,12,0)))"}).command
        self.scheduler.post([Post(task)], "user")

    @property
    def view(self) -> View:
        return self.scheduler.view

    @property
    def outcome(self) -> Outcome | None:
        found = self.view.latest(Outcome)
        return None if found is None else found.value

    def go_on(self, cycles: int) -> None:
        """Cycle; stillness is told, as the loop of a run does."""
        still = False
        for _ in range(cycles):
            if self.outcome is not None:
                return
            above = [level for level in (Level.PLAN, Level.GOAL) if open_discrepancy(self.view, level) is not None]
            decision = self.scheduler.step()
            if decision is not None:
                self.is_lawful(decision, above)
                still = False
            elif still:
                return
            else:
                self.scheduler.post([Post(Quiescence(self.scheduler.cycle))], "scheduler")
                still = True

    def is_lawful(self, decision: Decision, above: list[Level]) -> None:
        assert decision.refused == ""
        for change in (*decision.observed, *decision.made):
            if isinstance(change.entry.value, Discrepancy):
                self.seen[change.entry.ref] = change.entry.value
        for change in decision.made:
            value, entry = change.entry.value, change.entry
            if isinstance(value, Discrepancy):
                self.climbs_lawfully(change)
            elif isinstance(value, Goal) and value.status == "abandoned":
                assert Level.GOAL in above  # a goal is given up only when lost
            elif isinstance(value, PlanSketch) and value.status == "superseded":
                assert entry.author in ("goal_sketcher", "refiner", "lookout_planner")
            elif isinstance(value, PlanSketch) and isinstance(change, Revised) and value.adjustments:
                assert any(reason.id.startswith(("Milestone", "Leg", "PlanSketch")) for reason in entry.because)
            elif isinstance(value, MotorCommand) and value.move_m > 0.0:
                assert not above or not self.is_in_doubt(above)
            elif isinstance(value, MotorCommand) and self.is_in_doubt(above):  # it turns, for another look
                assert unmeasured_doubt(self.view) is not None and Level.GOAL not in above
                assert any(reason.id.startswith("Milestone") for reason in entry.because)
            elif isinstance(value, Milestone):
                assert len(value.tried) < MAX_MILESTONE_LOOKS
            elif isinstance(value, Course) and value.is_rolling:
                assert not self.is_in_doubt(above)

    def is_in_doubt(self, above: list[Level]) -> bool:
        found = [open_discrepancy(self.view, level) for level in above]
        return any(f is not None and (f.value.magnitude is None or f.value.exceeds) for f in found)

    def climbs_lawfully(self, change: Change) -> None:
        """One level at a time, from what its level measured beyond the bound that it states."""
        value: Discrepancy = change.entry.value
        if change.entry.author == "discrepancy_raiser" and isinstance(change, Posted):
            below = self.seen[change.entry.because[0]]
            assert below.status == "escalated" and below.magnitude is not None and below.magnitude > below.bound
            assert value.level == below.level + 1 and value.magnitude is None
        elif value.level is Level.GOAL and isinstance(change, Posted):
            raise AssertionError("only the discrepancy raiser raises anything to the goal level")
        if value.status == "escalated":
            assert value.magnitude is not None and value.magnitude > value.bound
        if value.status == "corrected" and change.entry.author in ("motor", "path_follower"):
            assert value.level is Level.ACTION and value.magnitude is not None and value.magnitude <= value.bound


figures = st.sampled_from([0.0, 1.0, 5.9, 6.1, 20.0, 29.9, 30.1, 500.0, math.inf])
of_milestones = figures | st.just(UNCONFIRMED)


class LadderMachine(RuleBasedStateMachine):
    """A mission in which pictures say anything at any time."""

    continuous = False

    def __init__(self) -> None:
        super().__init__()
        self.ladder = Ladder(self.continuous)

    @rule(purpose=st.sampled_from(["track", "probe"]), px=figures)
    def pictures_say(self, purpose: str, px: float) -> None:
        self.ladder.body.says[purpose] = px

    @rule(px=of_milestones)
    def pictures_of_milestones_say(self, px: float) -> None:
        self.ladder.body.says["milestone"] = px

    @rule(cycles=st.integers(1, 40))
    def go_on(self, cycles: int) -> None:
        self.ladder.go_on(cycles)

    def teardown(self) -> None:
        """Success comes back down: as soon as all is as expected again, the robot arrives, or had given up before."""
        ladder = self.ladder
        lost_before = open_discrepancy(ladder.view, Level.GOAL) is not None
        ladder.body.says = {"track": 1.0, "milestone": 1.0, "probe": 1.0}
        ladder.go_on(800)
        assert ladder.outcome is not None
        if ladder.outcome.kind == "reached":
            for level in Level:
                found = open_discrepancy(ladder.view, level)
                assert found is None or not found.value.exceeds
            assert rolling_course(ladder.view) is None
        else:
            given_up = ladder.outcome.kind in ("lost", "blocked")
            assert given_up and (lost_before or any(d.times for d in ladder.seen.values()))


class RollingLadderMachine(LadderMachine):
    """The same, with motions that are steered on the move."""

    continuous = True


TestLadder = LadderMachine.TestCase
TestLadder.settings = settings(max_examples=12, stateful_step_count=12, deadline=None)
TestRollingLadder = RollingLadderMachine.TestCase
TestRollingLadder.settings = settings(max_examples=12, stateful_step_count=12, deadline=None)


@settings(max_examples=20, deadline=None)
@given(track=figures, milestone=of_milestones, probe=figures, continuous=st.booleans())
def test_whatever_pictures_go_on_saying_the_mission_ends_and_says_how(
    track: float, milestone: float, probe: float, continuous: bool
) -> None:
    """No livelock: the same failure is not answered the same way for ever."""
    ladder = Ladder(continuous)
    ladder.body.says = {"track": track, "milestone": milestone, "probe": probe}
    ladder.go_on(6000)
    assert ladder.outcome is not None
    raised = [d for d in ladder.seen.values() if d.times]
    checks, lost = MAX_CHECKS_PER_SUBGOAL, MAX_LOST_PER_MISSION
    assert all(d.times <= (checks if d.level is Level.ACTION else lost) for d in raised)
    if track <= ACTION_PX and 0.0 <= milestone <= PLAN_PX:
        assert ladder.outcome.kind == "reached" and not raised
    if milestone > PLAN_PX or milestone == UNCONFIRMED:
        assert ladder.outcome.kind == "lost"


def test_in_doubt_it_looks_in_other_directions_before_it_is_lost() -> None:
    """Landmarks are lost once; of the looks that follow the last that is allowed tells that all is well."""
    ladder = Ladder()
    ladder.go_on(30)
    ladder.body.says.update(track=500.0, milestone=UNCONFIRMED)
    looked: list[float] = []
    while len(looked) < MAX_MILESTONE_LOOKS and ladder.outcome is None:
        if len(looked) == MAX_MILESTONE_LOOKS - 1:
            ladder.body.says.update(track=1.0, milestone=1.0)
        ladder.go_on(1)
        milestone = open_milestone(ladder.view)
        if unmeasured_doubt(ladder.view) is not None and milestone is not None and milestone.value.status == "expected":
            looked = [*milestone.value.tried, milestone.value.look_heading_rad]
    assert len({round(heading, 3) for heading in looked}) == MAX_MILESTONE_LOOKS
    ladder.go_on(2000)
    assert ladder.outcome is not None and ladder.outcome.kind == "reached"
    assert not any(d.level is Level.GOAL for d in ladder.seen.values())
    assert len(ladder.view.all(Goal)) == 1


def test_a_robot_that_something_stops_again_and_again_gives_up() -> None:
    ladder = Ladder()
    ladder.body.is_stuck = True
    ladder.go_on(3000)
    assert ladder.outcome is not None and ladder.outcome.kind == "blocked"
    assert str(MAX_CHECKS_PER_SUBGOAL) in ladder.outcome.reason


@settings(max_examples=10, deadline=None)
@given(track=st.floats(0.0, ACTION_PX), milestone=st.floats(0.0, 5.0))
def test_no_plan_is_changed_while_correcting_the_motion_is_enough(track: float, milestone: float) -> None:
    ladder = Ladder()
    ladder.body.says.update(track=track, milestone=milestone)
    ladder.go_on(2000)
    assert ladder.outcome is not None and ladder.outcome.kind == "reached"
    assert not any(d.status == "escalated" for d in ladder.seen.values())
    assert len(ladder.view.all(Goal)) == 1
    assert all(s.value.adjustments == 0 and s.value.status != "superseded" for s in ladder.view.all(PlanSketch))
