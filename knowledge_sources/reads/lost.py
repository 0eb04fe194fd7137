"""What the knowledge sources of a lost robot have in common: when they may act, and the looks since it was lost."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from blackboard import Condition, Entry, Level, Post, View
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.features import picture
from knowledge_sources.methods.localization import CameraView
from knowledge_sources.reads.conditions import GOING_ON, HELD, LOST, STANDING
from knowledge_sources.reads.questions import find_robot, list_touches
from world_models.entries import (
    Contact,
    Discrepancy,
    Glimpse,
    MotionReport,
    Panorama,
    PlanSketch,
    Segments,
)
from world_models.frames import Pose2


def declare_lost(what: str, because: tuple[object, ...]) -> Post:
    """The robot may be elsewhere: the goal level measures that again, by a look round."""
    return Post(Discrepancy(Level.GOAL, what, None, (0.0, 0.0), "px"), because)


def find_panorama(view: View, doubt: Entry[Discrepancy]) -> Entry[Panorama] | None:
    """The looks since the robot is lost."""
    found = view.latest(Panorama)
    return found if found is not None and found.cycle >= doubt.cycle else None


def list_views(view: View, glimpses: Iterable[Glimpse]) -> list[CameraView]:
    """The looks with their segments."""
    return [CameraView(view[g.segments].value.segments_px, g.now_from_then, np.array(g.covariance)) for g in glimpses]


def list_contacts(view: View, doubt: Entry[Discrepancy]) -> list[Entry[Contact]]:
    """What was touched since the robot is lost, and the last before that, where the direction is known."""
    last = view.latest(Contact)
    return [entry for entry in list_touches(view)
            if entry.cycle >= doubt.cycle or (last is not None and entry.id == last.id)]


def locate_contact(view: View, contact: Entry[Contact]) -> Floats:
    """Where something was touched, (2,) [m] in the robot's frame now: at its rim then, and as it has moved since."""
    robot, direction, now_from_then = find_robot(view), contact.value.direction_rad, Pose2(0.0, 0.0, 0.0)
    for report in view.since(MotionReport, contact.cycle):
        if report.because[0].id != contact.because[0].id:
            moved = robot.actuator.predict_motion(report.value.turn_rad, report.value.move_m)
            now_from_then = moved.inverse() @ now_from_then
    return now_from_then.apply(robot.radius_m * np.array([math.cos(direction), math.sin(direction)]))


def is_dark(segments: Segments) -> bool:
    """Whether the picture of these segments is dark."""
    return picture.is_dark(segments.brightness, segments.contrast)


def _has_just_ridden(view: View) -> bool:
    """Whether no milestone was verified since an elevator ride: then it may be on any floor."""
    return view.latest(PlanSketch, lambda s: s.is_active and s.at > 0 and not s.verified
                       and s.subgoals[s.at - 1].is_ride) is not None


FLOOR_KNOWN = Condition("a known floor", lambda view: not _has_just_ridden(view),
                        "no milestone was verified since the elevator ride")
WHILE_LOST: tuple[Condition[Any], ...] = (GOING_ON, HELD, LOST, STANDING, FLOOR_KNOWN)
"""What a lost robot needs to look round: it stands, and knows on which floor."""
