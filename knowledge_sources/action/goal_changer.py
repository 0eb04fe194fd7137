"""Goal changer (§2): asked on its way to go elsewhere, the robot takes a new goal in place of the old one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard.board import View
from blackboard.change import Change, Posted, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.questions import active_goal, find_belief, find_building, open_discrepancy, open_milestone
from knowledge_sources.robot_knowledge_source import OlderSource
from world_models.commands import read_destination
from world_models.entries.location import Place
from world_models.entries.task import Goal, Milestone
from world_models.entries.user_reports import Redirection


class GoalChanger(OlderSource):
    """Abandons the goal for the one that somebody asks for, from where the robot believes to be.

    A milestone that waits to be judged is withdrawn; the sketcher supersedes the sketches of the old goal. A robot that
    is lost keeps its goal, with the new destination, until it knows from where to go. What cannot be understood is
    answered, and the robot goes on as before. It acts at once, before the next increment; where there is no goal yet,
    when there is one. Of what was asked meanwhile the last counts.
    """

    level = Level.ACTION
    on = (Watch(Redirection, (Posted,)), Watch(Goal, (Posted,), lambda goal: goal.is_active))
    writes = (Redirection, Goal, Milestone)

    def judge(self, view: View, trigger: Change) -> float | None:
        is_ready = active_goal(view) is not None and find_belief(view) is not None
        return 1.0 if is_ready and _list_unanswered(view) else None

    def answer(self, view: View, trigger: Change) -> Iterable[Effect]:
        goal, belief, building = active_goal(view), find_belief(view), find_building(view)
        if goal is None or belief is None:
            return
        *overtaken, asked = _list_unanswered(view)
        for earlier in overtaken:
            yield Revise(earlier, replace(earlier.value, answer="but was asked again since"), (earlier, asked))
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
        yield Post(Goal(Place(belief.value.locale, here.x_m, here.y_m), destination), (asked, goal, belief))


def _list_unanswered(view: View) -> tuple[Entry[Redirection], ...]:
    """What was asked and not taken up yet, in the order in which it was."""
    return view.where(Redirection, lambda asked: not asked.answer)
