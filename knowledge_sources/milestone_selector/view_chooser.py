"""View chooser (§3.3, §4): in which direction the next milestone of a plan sketch is looked for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

from blackboard import Change, Effect, Entry, Level, Post, Posted, Revised, View, Watch
from knowledge_sources.methods.verification import CHECK_TOLERANCE_M, choose_heading, find_untried, turn_headings
from knowledge_sources.priority import Priority
from knowledge_sources.reads import (
    GOING_ON,
    HELD,
    MAX_LOOK_ERROR_RAD,
    MEASURED,
    NO_MILESTONE,
    NOT_LOST,
    SKETCH,
    STANDING,
    find_car,
    find_tried,
    list_log_odds,
)
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.building.building import Building
from world_models.entries import Discrepancy, Hypothesis, Milestone, PlanSketch
from world_models.frames import Pose2, wrap_angle

LONG_TURN_RAD = math.radians(100.0)
"""Before a leg that begins with a longer turn the robot turns first, then looks: few landmarks are followed as it
turns about."""


class ViewChooser(RobotKnowledgeSource):
    """Chooses the direction in which the milestone before a subgoal is looked for (M0 first).

    The heading that the subgoal before it states; before a leg that begins with a long turn the view along that leg, as
    the turn leaves the heading open; the view ahead if it is good; the next one on the way; then the one that tells
    the place best. Where a view was not testable, it tries another.
    """

    level, priority = Level.PLAN, Priority.LOOK
    on = (
        Watch(PlanSketch, (Posted, Revised), lambda s: s.is_active and not s.verified),
        Watch(Discrepancy, (Posted, Revised)),
        Watch(Hypothesis, (Revised,), lambda h: h.is_held),
        Watch(Milestone, (Revised,), lambda m: not m.is_open),
    )
    needs = (GOING_ON, HELD, STANDING, NOT_LOST, MEASURED, NO_MILESTONE, SKETCH)
    writes = (Milestone,)

    def bind(self, view: View, trigger: Change) -> Entry[PlanSketch] | None:
        """The sketch whose milestone is due."""
        sketch = SKETCH.of(view)
        return None if sketch.value.verified else sketch

    def act(self, view: View, case: Entry[PlanSketch]) -> Iterable[Effect]:
        sketch, s, belief = case, case.value, HELD.of(view)
        robot, pose = belief.seeing, belief.pose
        tried = find_tried(view, lambda m: (m.value.sketch, m.value.index) == (sketch.id, s.at))
        headings = find_untried(self.list_headings(robot.world, s, pose), tried)
        tolerance_m = s.subgoals[s.at - 1].tolerance_m if s.at else CHECK_TOLERANCE_M
        heading = choose_heading(robot, pose, headings, tolerance_m, find_car(s, s.at))
        is_ahead = abs(wrap_angle(pose.heading_rad - heading)) <= MAX_LOOK_ERROR_RAD
        chosen = Milestone(sketch.id, s.at, f"M{s.at} of {s.locale or 'the route'}",
                           pose.heading_rad if is_ahead else heading, tried=tried)
        yield Post(replace(chosen, log_odds_so_far=list_log_odds(view, chosen)), (sketch, belief.entry))

    def list_headings(self, building: Building, sketch: PlanSketch, pose: Pose2) -> Iterator[float]:
        """The headings that come into question [rad, world], the first good one is taken."""
        wanted = sketch.subgoals[sketch.at - 1].destination if sketch.at else None
        if wanted is not None and wanted.heading_rad is not None:
            yield wanted.in_world(building).heading_rad
        end = None if sketch.current is None else sketch.current.destination.in_world(building)
        along = None if end is None else math.atan2(end.y_m - pose.y_m, end.x_m - pose.x_m)
        if along is not None and _begins_with_drive(building, sketch, pose):
            is_long = abs(wrap_angle(along - pose.heading_rad)) > LONG_TURN_RAD
            yield from [along] * is_long  # few landmarks are followed through such a turn: it is done before the look
        yield pose.heading_rad
        if along is not None:
            yield along
        yield from turn_headings(pose)


def _begins_with_drive(building: Building, sketch: PlanSketch, pose: Pose2) -> bool:
    """Whether what comes next is a leg, and not at its end already."""
    s = sketch.current
    return s is not None and s.primitive and pose.distance_to(s.destination.in_world(building)) > s.tolerance_m
