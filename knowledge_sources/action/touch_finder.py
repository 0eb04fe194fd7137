"""Touch finder (§4: models are incomplete): what was touched, and is not in the model, is in the way."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

from blackboard.board import View
from blackboard.change import Change, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.conditions import HELD
from knowledge_sources.methods.floor.weigh_touch import (
    TOUCH_MARGIN_M,
    find_touched,
    locate_touch,
    touch_again,
    touch_first,
)
from knowledge_sources.methods.motion.routes import find_nearest
from knowledge_sources.priority import Priority
from knowledge_sources.questions import last_motion
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries.body import MotorCommand
from world_models.entries.location import Hypothesis
from world_models.entries.obstacle import Contact, Obstacle

MAX_TOUCH_SIGMA_RAD = 0.6  # a contact whose direction is less sure tells of no obstacle


class Case(NamedTuple):
    """What was known of what was touched, if anything was; what is known of it now; and what tells it."""

    known: Entry[Obstacle] | None
    found: Obstacle
    because: tuple[Entry[Any], ...]


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
    writes = (Obstacle,)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """The newest contact, where its direction is known well enough and the model does not explain it."""
        touch, belief, s = _find_new_touch(view), HELD.of(view), self._settings.action
        if touch is None or touch.contact.value.sigma_rad > MAX_TOUCH_SIGMA_RAD:
            return None
        radius_m, b, because = belief.robot.radius_m, belief.value, (*touch.because, belief.entry)
        touched = locate_touch(belief.pose, radius_m, touch.contact.value, touch.turned_rad)
        sigma_m = math.hypot(b.sigma_m, radius_m * math.hypot(b.sigma_rad, touch.contact.value.sigma_rad))
        reach_m = TOUCH_MARGIN_M + 3.0 * b.sigma_m
        obstacles = {entry.id: entry for entry in view.all(Obstacle)}
        id = find_touched({id: o.value for id, o in obstacles.items()}, touched, reach_m + 3.0 * sigma_m)
        if id is not None:
            known = obstacles[id]
            return Case(known, touch_again(belief.world, touched, known.value, s), (*because, known))
        if find_nearest(belief.world, b.locale, belief.pose.position, of_model=True)[0] <= radius_m + reach_m:
            return None
        return Case(None, touch_first(belief.world, touched, b.locale, sigma_m, 1 + len(obstacles), s), because)

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        known, found, because = case
        yield Post(found, because) if known is None else Revise(known, found, because)


class _Touch(NamedTuple):
    """A contact, and what the robot has turned since.

    Attributes:
        because: the contact and the turns.
    """

    contact: Entry[Contact]
    turned_rad: float
    because: tuple[Entry[Any], ...]


def _find_new_touch(view: View) -> _Touch | None:
    """The newest contact, if no obstacle rests on it yet and the robot stands where it touched: it has only turned."""
    contact, last = view.latest(Contact), last_motion(view)
    if contact is None or last is None or any(o.value.touched_s == contact.value.when_s for o in view.all(Obstacle)):
        return None
    turned_rad, because = 0.0, list[Entry[Any]]([contact])
    if last.id != contact.because[0].id:
        for command in view.newest_first(MotorCommand):
            if command.id == contact.because[0].id:
                break
            if command.value.move_m != 0.0:
                return None
            turned_rad += command.value.turn_rad
            because.append(command)
        else:
            return None
    return _Touch(contact, turned_rad, tuple(because))
