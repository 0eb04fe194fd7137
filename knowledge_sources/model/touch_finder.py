"""Touch finder (§4: models are incomplete): what was touched, and is not in the model, is in the way."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from blackboard import Change, Effect, Entry, Level, Post, Revise, Revised, View, Watch
from knowledge_sources.methods.doors import is_in_opening
from knowledge_sources.methods.floor import (
    TOUCH_MARGIN_M,
    explain_touch,
    find_touched,
    judge_by,
    locate_touch,
    touch_again,
    touch_first,
)
from knowledge_sources.methods.floor.weigh_touch import Touched
from knowledge_sources.methods.motion import find_nearest
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, Belief, find_difference
from knowledge_sources.reads.questions import list_touches
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import Contact, Course, Difference, Evidence, Hypothesis, MotorCommand, Obstacle

MAX_TOUCH_SIGMA_RAD = 0.6  # a contact whose direction is less sure tells of no obstacle


Case = tuple[Touched, float, Entry[Obstacle] | None, tuple[Entry[Any], ...]]
"""Where something was touched, by what deviation; what is known to stand there, if anything is; what tells it."""


class TouchFinder(RobotKnowledgeSource):
    """Concludes that something stands where the robot touched.

    It waits until a milestone was verified where the robot touched: as long as its place is in doubt, a contact may be
    with a wall. The model explains a contact where a wall or a thing is near enough to be touched, by what the belief
    leaves open. Then nothing is concluded; nor where the contact's direction is not known. How large the thing is a
    touch does not tell: it is taken to be ``obstacle_width_m`` wide and deep.
    """

    level, priority = Level.ACTION, Priority.REVISE
    on = (Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis in ("milestone", "relocalization")),)
    needs = (HELD,)
    writes = (Obstacle, Evidence)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """The newest contact, where its direction is known well enough and the model does not explain it."""
        touch, belief = _find_new_touch(view), HELD.of(view)
        if touch is None or touch[0].value.sigma_rad > MAX_TOUCH_SIGMA_RAD:
            return None
        contact, turned_rad, turns = touch
        radius_m, b, because = belief.robot.radius_m, belief.value, (contact, *turns, belief.entry)
        touched = locate_touch(belief.pose, radius_m, contact.value, turned_rad)
        sigma_m = math.hypot(b.sigma_m, radius_m * math.hypot(b.sigma_rad, contact.value.sigma_rad))
        reach_m = TOUCH_MARGIN_M + 3.0 * b.sigma_m
        obstacles = {entry.id: entry for entry in view.all(Obstacle)}
        id = find_touched({id: o.value for id, o in obstacles.items()}, touched, reach_m + 3.0 * sigma_m)
        if id is not None:
            return touched, sigma_m, obstacles[id], because
        if find_nearest(belief.world, b.locale, belief.pose.position, of_model=True)[0] <= radius_m + reach_m:
            return None
        return touched, sigma_m, None, because

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        (touched, sigma_m, known, because), belief, s = case, HELD.of(view), self._settings.action
        new = touch_again(belief.world, touched, known.value) if known is not None else touch_first(
            belief.world, touched, belief.locale, sigma_m, 1 + len(view.all(Obstacle)), s.obstacle_width_m)
        before = find_difference(view, new.name)
        told = _tell(belief, new.name, touched, before, s.max_obstacle_certainty)
        new = judge_by(told, new, before, s)
        yield Post(new, because) if known is None else Revise(known, new, (*because, known))
        yield Post(told, because)


def _tell(belief: Belief, about: str, touched: Touched, known: Difference, most: float) -> Evidence:
    """What a touch says of what was touched: in an opening it may be a leaf as well as a thing."""
    at = belief.pose
    doors = (d.name for d in belief.world.doorways_of(belief.locale)
             if is_in_opening(d, belief.locale, touched.at, TOUCH_MARGIN_M))
    leaf = next((f"the leaf of {door}, shut" for door in doors), None)
    return Evidence(about, touched.contact.sentence(), explain_touch(leaf, known, most), at.x_m, at.y_m,
                    at.heading_rad, 0.0, 0.0, touched.contact.when_s)


def _find_new_touch(view: View) -> tuple[Entry[Contact], float, tuple[Entry[MotorCommand], ...]] | None:
    """The newest contact, if no obstacle rests on it yet and the robot stands where it touched: it has only turned; by
    how much [rad], and by which commands.
    """
    contact = next(reversed(list_touches(view)), None)
    if contact is None or any(o.value.touched_s == contact.value.when_s for o in view.all(Obstacle)):
        return None
    asked = contact.because[0].id  # of the same cycle as the contact, or the one before
    since = tuple(command for command in view.since(MotorCommand, contact.cycle) if command.id != asked)
    has_rolled = any(course.id != asked for course in view.since(Course, contact.cycle))
    if view.get(asked) is None or has_rolled or any(command.value.move_m != 0.0 for command in since):
        return None
    return contact, math.fsum(command.value.turn_rad for command in since), since
