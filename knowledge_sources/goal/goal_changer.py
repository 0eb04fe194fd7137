"""Goal changer (§2): asked on its way to go elsewhere, the robot takes a new goal in place of the old one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, View, Watch
from knowledge_sources.priority import Priority
from knowledge_sources.reads import GOAL, HELD, Belief, find_building, open_discrepancy, open_milestone
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.commands import read_destination
from world_models.entries import GO_ON, Goal, Milestone, Place, Redirection


class Case(NamedTuple):
    """What was asked last, what it overtakes, the goal that it replaces, and where the robot is."""

    asked: Entry[Redirection]
    overtaken: tuple[Entry[Redirection], ...]
    goal: Entry[Goal]
    belief: Belief


class GoalChanger(RobotKnowledgeSource):
    """Abandons the goal for the one that somebody asks for, from where the robot believes to be.

    A milestone that waits to be judged is withdrawn; the goal sketcher supersedes the old goal's sketches. A robot that
    is lost keeps its goal, with the new destination, until it knows from where to go. What cannot be understood is
    answered, and the robot goes on as before. It acts at once, before the next increment; where there is no goal yet,
    when there is one. Of what was asked meanwhile the last counts.
    """

    level, priority = Level.ACTION, Priority.ENTER
    on = (Watch(Redirection, (Posted,)), Watch(Goal, (Posted,), lambda goal: goal.is_active))
    needs = (GOAL, HELD)
    writes = (Redirection, Goal, Milestone)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """What was asked and is not answered yet."""
        asked = view.where(Redirection, lambda redirection: not redirection.answer)
        return Case(asked[-1], asked[:-1], GOAL.of(view), HELD.of(view)) if asked else None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        asked, overtaken, goal, belief = case
        building = find_building(view)
        for earlier in overtaken:
            yield Revise(earlier, replace(earlier.value, answer="but was asked again since"), (earlier, asked))
        if asked.value.text == GO_ON:
            yield Revise(asked, replace(asked.value, answer="and does"), (asked,))
            return
        try:
            destination = read_destination(asked.value.text, building, building.find_rooms)
        except ValueError as error:
            yield Revise(asked, replace(asked.value, answer=f"which cannot be: {error}"), (asked,))
            return
        yield Revise(asked, replace(asked.value, answer=f"and goes to {destination.words()}"), (asked,))
        lost = open_discrepancy(view, Level.GOAL)
        if lost is not None:
            yield Revise(goal, replace(goal.value, destination=destination), (asked, goal, lost))
            return
        waiting = open_milestone(view)
        if waiting is not None:
            yield Revise(waiting, replace(waiting.value, status="withdrawn"), (asked, waiting))
        yield Revise(goal, replace(goal.value, status="abandoned"), (asked, goal))
        here = belief.value.locale_from_robot
        yield Post(Goal(Place(belief.locale, here.x_m, here.y_m), destination), (asked, goal, belief.entry))
