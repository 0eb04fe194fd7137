"""Goal changer (§2): asked on its way to go elsewhere, the robot takes a new goal in place of the old one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revise, View, Watch, rule
from knowledge_sources.priority import Priority
from knowledge_sources.reads import GOAL, HELD, find_building, open_discrepancy, open_milestone
from world_models.building.locale_frame import FrameRequest
from world_models.commands import read_destination
from world_models.entries import GO_ON, Goal, Milestone, Place, Redirection

Asked = tuple[Entry[Redirection], ...]


def find_asked(view: View, _trigger: Change) -> Asked | None:
    """What was asked and is not answered yet, the last at the end."""
    return view.where(Redirection, lambda redirection: not redirection.answer) or None


@rule(on=(Watch(Redirection, (Posted,)), Watch(Goal, (Posted,), lambda goal: goal.is_active)),
      writes=(Redirection, Goal, Milestone, FrameRequest), needs=(GOAL, HELD), bind=find_asked,
      priority=Priority.REVISE)
def goal_changer(view: View, case: Asked) -> Iterable[Effect]:
    """Abandons the goal for the one that somebody asks for, from where the robot believes to be.

    A milestone that waits to be judged is withdrawn; the goal sketcher supersedes the old goal's sketches. A robot that
    is lost keeps its goal, with the new destination, until it knows from where to go. What cannot be understood is
    answered, and the robot goes on as before. It acts at once, before the next increment; where there is no goal yet,
    when there is one. Of what was asked meanwhile the last counts. A source of another package that understands more
    than one place comes first, at the priority of what is entered.
    """
    (*overtaken, asked), goal, belief, building = case, GOAL.of(view), HELD.of(view), find_building(view)
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
    lost, waiting = open_discrepancy(view, Level.GOAL), open_milestone(view)
    if lost is not None:
        yield Revise(goal, replace(goal.value, destination=destination), (asked, goal, lost))
        return
    if waiting is not None:
        yield Revise(waiting, replace(waiting.value, status="withdrawn"), (asked, waiting))
    yield Revise(goal, replace(goal.value, status="abandoned"), (asked, goal))
    here = belief.value.locale_from_robot
    yield Post(Goal(Place(belief.locale, here.x_m, here.y_m), destination), (asked, goal, belief.entry))
