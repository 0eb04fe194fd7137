"""Obstacle finder (§4: models are incomplete): what was touched where the model has free floor stands in the way."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from blackboard.board import View
from blackboard.change import Change, Revised, Watch
from blackboard.effect import Effect, Post, Revise
from blackboard.entry import Entry
from blackboard.level import Level
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.motion.routes import find_nearest
from knowledge_sources.questions import find_contact, find_frames, find_robot, last_motion
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries.locale_frame import FrameChange, LocaleFrame
from world_models.entries.location import Hypothesis, Place
from world_models.entries.obstacle import Obstacle
from world_models.entries.touch import Contact


class ObstacleFinder(RobotKnowledgeSource):
    """Concludes from a contact that something stands in the way, and puts it into the frame of its locale.

    It waits until a milestone was verified where the robot touched: as long as its place is in doubt, a contact may be
    with a wall. The model explains a contact where a wall or a thing is near enough to be touched, by what the belief
    leaves open. Then nothing is concluded; nor where the contact's direction is not known. How large the thing is a
    touch does not tell: it is taken to be ``obstacle_width_m`` wide and deep.
    """

    level = Level.ACTION
    watches = (Watch(Hypothesis, (Revised,), lambda h: h.is_held and h.basis == "milestone"),)
    writes = (Obstacle, LocaleFrame)

    def rate(self, view: View, trigger: Change) -> float | None:
        contact, most_rad = _find_new_contact(view), self._settings.action.max_touch_sigma_rad
        return 0.95 if contact is not None and contact.value.sigma_rad <= most_rad else None

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        belief: Entry[Hypothesis] = trigger.entry
        contact = _find_new_contact(view)
        if contact is None:
            return
        robot, locale, s = find_robot(view), belief.value.locale, self._settings.action
        pose, c = belief.value.world_from_robot(robot.world), contact.value
        sigma_m = math.hypot(belief.value.sigma_m, robot.radius_m * math.hypot(belief.value.sigma_rad, c.sigma_rad))
        reach_m = robot.radius_m + s.touch_margin_m + 3.0 * belief.value.sigma_m
        if find_nearest(robot.world, locale, pose.position)[0] <= reach_m:
            return
        ahead = pose.heading_rad + c.direction_rad
        out, across = np.array([math.cos(ahead), math.sin(ahead)]), np.array([-math.sin(ahead), math.cos(ahead)])
        touched = np.array(pose.position) + robot.radius_m * out
        footprint = _build_footprint(touched, out, across, s.obstacle_width_m)
        name = f"{locale}/obstacle-{1 + len(view.all(Obstacle))}"
        at = Place.of_world(robot.world, locale, float(touched[0]), float(touched[1]))
        found = Post(Obstacle(name, locale, footprint, sigma_m, at.x_m, at.y_m, s.obstacle_width_m), (contact, belief))
        yield found
        for frame in find_frames(view, (locale,)):
            change = FrameChange("extra", name, self.name, footprint)
            yield Revise(frame, frame.value.changed(change), (found, frame))


def _find_new_contact(view: View) -> Entry[Contact] | None:
    """The contact in the last motion, if no obstacle rests on it yet: the robot stands as it touched."""
    last = last_motion(view)
    contact = None if last is None else find_contact(view, last.id)
    if contact is None or any(contact.ref in obstacle.because for obstacle in view.all(Obstacle)):
        return None
    return contact


def _build_footprint(
    touched: Floats, out: Floats, across: Floats, side_m: float
) -> tuple[tuple[float, float], ...]:
    """The corners of a square behind the point that was touched, its near side across the direction [m, world]."""
    half = 0.5 * side_m
    corners = (touched - half * across, touched - half * across + side_m * out,
               touched + half * across + side_m * out, touched + half * across)
    return tuple((float(x), float(y)) for x, y in corners)
