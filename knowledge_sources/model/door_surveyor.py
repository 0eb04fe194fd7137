"""Door surveyor (§4: models are incomplete): does a door stand where the model has it, by the lines of a good fix?"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from blackboard import Change, Effect, Entry, Level, Post, Posted, View, Watch
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.belief import hedge
from knowledge_sources.methods.calibration import MIN_MOVE_M, MIN_TURN_RAD
from knowledge_sources.methods.doors import find_beside
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, find_difference, list_filed_doors
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.building.changes import find_along
from world_models.building.locale_frame import LocaleFrame
from world_models.building.locales import Doorway
from world_models.entries import (
    SHARED_SIGMA_M,
    Certificate,
    Evidence,
    Explanation,
    Milestone,
    PoseFix,
    Segments,
)


class Surveyed(NamedTuple):
    """A picture whose place is verified, and the doors of which it should show lines, as the file has them."""

    fix: Entry[PoseFix]
    milestone: Entry[Milestone]
    segments: Entry[Segments]
    doors: tuple[Doorway, ...]


class DoorSurveyor(RobotKnowledgeSource):
    """Says of each door in a picture of a verified place where along its wall its edges are found.

    Only a place that is protected tells it, and no surer than it is known, with what all pictures share. Nothing is
    said of a door that stands in its place until something else was.
    """

    level, priority = Level.PLAN, Priority.ENTER
    on = (Watch(Certificate, (Posted,), lambda c: c.verdict == "verified"),)
    needs = (HELD,)
    writes = (Evidence,)

    def bind(self, view: View, trigger: Change) -> Surveyed | None:
        fix, milestone = view.get(trigger.entry.value.fix), view.get(trigger.entry.value.milestone)
        match = None if fix is None else view.get(fix.value.match)
        segments = None if match is None else view.get(match.value.segments)
        if fix is None or milestone is None or segments is None or not fix.value.protection.is_available:
            return None
        filed = list_filed_doors(view)
        doors = tuple(filed[name] for name in milestone.value.landmarks if name in filed)
        return Surveyed(fix, milestone, segments, doors) if doors else None

    def act(self, view: View, case: Surveyed) -> Iterable[Effect]:
        for door in case.doors:
            told = self._survey(view, case, door)
            if told is not None:
                yield Post(told, (case.fix, case.milestone, case.segments))

    def _survey(self, view: View, case: Surveyed, door: Doorway) -> Evidence | None:
        """What the picture says of a door; None where it says nothing that was not expected."""
        m, robot, here = case.milestone.value, HELD.of(view).robot, case.fix.value.world_from_robot
        of_door = [m.landmarks[i] == door.name for i in m.landmark_of]
        lines: Floats = np.asarray(m.expected)[of_door]
        along = np.array([*find_along(door), 0.0])
        variance = float(along[:2] @ case.fix.value.covariance[:2, :2] @ along[:2])
        found = find_beside(
            lines, along, _find_known_m(view, door, along), case.segments.value.segments_px, robot.camera,
            robot.mount.camera_from_robot, here, math.sqrt(variance + SHARED_SIGMA_M**2))
        if found is None or (found.log_ratio <= 0.0 and not find_difference(view, door.name).rivals):
            return None
        left = hedge({"jamb": found.log_ratio})
        frame = view.get(case.segments.value.frame)
        what = f"{door.name} that stands {abs(100.0 * found.off_m):.0f} cm beside"
        return Evidence(
            door.name, f"{found.edges} of its edges from {case.fix.id}",
            (Explanation("chance", f"{door.name} in its place", 0.0),
             Explanation("jamb", what, left["jamb"], round(found.off_m, 4), round(found.sigma_m, 4))),
            here.x_m, here.y_m, here.heading_rad, MIN_MOVE_M, MIN_TURN_RAD,
            0.0 if frame is None else frame.value.sim_time_s)


def _find_known_m(view: View, door: Doorway, along: Floats) -> float:
    """How far beside its place in the file a door is believed to stand."""
    changes = (change for entry in view.all(LocaleFrame) for change in entry.value.changes)
    return next((float(along[:2] @ change.by_m) for change in changes
                 if (change.what, change.name) == ("beside", door.name)), 0.0)
