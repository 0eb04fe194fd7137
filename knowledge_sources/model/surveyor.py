"""Surveyor (§4: models are incomplete): do doors and walls stand where the model has them, by a picture's lines?"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from blackboard import Change, Effect, Entry, Level, Post, Posted, View, Watch
from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.belief import hedge
from knowledge_sources.methods.calibration import MIN_MOVE_M, MIN_TURN_RAD, loosen
from knowledge_sources.methods.features import SIGMA_ACROSS_PX
from knowledge_sources.methods.pose import PlanarEstimate, find_beside, find_width, planar_from_lines, weigh_places
from knowledge_sources.methods.pose.standing_beside import BESIDE_M, FoundBeside
from knowledge_sources.methods.verification import list_names, predict_lines
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, find_difference, list_filed_doors
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.building.changes import find_along
from world_models.building.locale_frame import LocaleFrame
from world_models.building.model_errors import list_facing
from world_models.camera import Camera
from world_models.entries import (
    SHARED_SIGMA_M,
    Certificate,
    Evidence,
    Explanation,
    LineMatch,
    Milestone,
    PoseFix,
    Segments,
)
from world_models.entries.difference import DOORS
from world_models.frames import Pose, Pose2

MAX_SIGMA_M = 0.03
"""A place that is known less well along a door's wall tells nothing of it: a board is no wider than three of these."""
Sight = tuple[Floats, Floats, float, Floats, Camera, Pose, Pose2]
"""What :func:`find_beside` goes by, but for how well the pose is known."""


class Surveyed(NamedTuple):
    """A picture with its place, and whether that is verified."""

    fix: Entry[PoseFix]
    match: Entry[LineMatch]
    milestone: Entry[Milestone]
    segments: Entry[Segments]
    is_sure: bool


class Surveyor(RobotKnowledgeSource):
    """Says where along its wall a door's edges are found in a picture, and how far apart two walls are.

    Only a verified place tells of doors, by what it rests on besides: by doors that stand beside it may be off by as
    much. They are told no surer than it is known, with what all pictures share. Each tells once of the doors of the
    building, too. Walls that face each other tell how far they are apart wherever the robot is between them. Nothing is
    said of what stands in its place until it was doubted.
    """

    level, priority = Level.PLAN, Priority.ENTER
    on = (Watch(Certificate, (Posted,), lambda c: c.verdict != "refuted"),)
    needs = (HELD,)
    writes = (Evidence,)

    def bind(self, view: View, trigger: Change) -> Surveyed | None:
        certificate: Certificate = trigger.entry.value
        fix, milestone = view.get(certificate.fix), view.get(certificate.milestone)
        match = None if fix is None else view.get(fix.value.match)
        segments = None if match is None else view.get(match.value.segments)
        if fix is None or match is None or milestone is None or segments is None:
            return None
        return Surveyed(fix, match, milestone, segments, certificate.verdict == "verified")

    def act(self, view: View, case: Surveyed) -> Iterable[Effect]:
        told = [*self._survey_doors(view, case), *self._survey_widths(view, case)]
        for evidence in told:
            yield Post(evidence, (case.fix, case.milestone, case.segments))

    def _survey_doors(self, view: View, case: Surveyed) -> Iterator[Evidence]:
        filed = list_filed_doors(view)
        if not case.is_sure:
            return
        place = self._solve_without(view, case, filed)
        lines = predict_lines(HELD.of(view).robot, place.world_from_robot)
        names = np.array(list_names(lines))
        for door in (filed[name] for name in dict.fromkeys(names.tolist()) if name in filed):
            along = np.array([*find_along(door), 0.0])
            sigma_m = math.sqrt(float(along[:2] @ place.covariance[:2, :2] @ along[:2]) + SHARED_SIGMA_M**2)
            of_door = lines.lines_world[names == door.name]
            sight = self._see(view, case, place.world_from_robot, of_door, along, door.name)
            found = find_beside(*sight, sigma_m) if sigma_m <= MAX_SIGMA_M else None
            yield from _tell(view, case, door.name, found, "jamb", case.fix.value.world_from_robot)
            yield from _tell(view, case, DOORS, found, "jamb", door.pose_from(door.between[0]))

    def _solve_without(self, view: View, case: Surveyed, doors: Collection[str]) -> PlanarEstimate:
        """The pose by the lines that are of no door, and by what was believed before."""
        match, m, belief = case.match.value, case.milestone.value, HELD.of(view)
        names = [m.landmarks[m.landmark_of[line]] for line in match.pairs[:, 0]]
        rest = np.flatnonzero([name not in doors for name in names])
        return planar_from_lines(
            match.lines_world[rest], match.segments_px[rest], belief.robot.camera, belief.robot.mount.camera_from_robot,
            belief.pose, prior_covariance=loosen(belief.covariance), landmark_ids=[names[i] for i in rest],
            sigma_px=SIGMA_ACROSS_PX, errors=m.errors.take(match.pairs[rest, 0]))

    def _survey_widths(self, view: View, case: Surveyed) -> Iterator[Evidence]:
        m, building = case.milestone.value, HELD.of(view).world
        moved = {mode: np.any(shifts != 0.0, axis=1)
                 for mode, shifts in zip(m.errors.displacement_modes, m.errors.displacements, strict=True)}
        rooms = dict.fromkeys(room for name in m.landmarks if (room := name.rpartition("/")[0]))
        for about, sides in (pair for room in rooms for pair in list_facing(building, room).items()):
            if all(side.mode in moved for side in sides):
                here, expected = case.fix.value.world_from_robot, np.asarray(m.expected)
                seen = [weigh_places(*self._see(view, case, here, expected[moved[side.mode]], side.outward, side.mode))
                        for side in sides]
                if seen[0] is not None and seen[1] is not None:
                    found = find_width(seen[0], seen[1])
                    found = replace(found, sigma_m=math.hypot(found.sigma_m, SHARED_SIGMA_M))
                    yield from _tell(view, case, about, found, "wall", here)

    def _see(self, view: View, case: Surveyed, here: Pose2, lines: Floats, along: Floats, name: str) -> Sight:
        """What a search for lines (n, 2, 3) from a pose goes by."""
        robot = HELD.of(view).robot
        changes = (change for entry in view.all(LocaleFrame) for change in entry.value.changes)
        known_m = next((float(along[:2] @ change.by_m) for change in changes
                        if (change.what, change.name) == ("beside", name)), 0.0)
        return (lines, along, known_m, case.segments.value.segments_px,
                robot.camera, robot.mount.camera_from_robot, here)


def _tell(
    view: View, case: Surveyed, about: str, found: FoundBeside | None, kind: Literal["jamb", "wall"], at: Pose2
) -> Iterator[Evidence]:
    """What the picture says, where that was not expected; evidence ``at`` one place counts once."""
    if found is None or (found.log_ratio <= 0.0 and not find_difference(view, about).rivals):
        return
    frame, beside_cm = view.get(case.segments.value.frame), 100.0 * found.off_m
    what = (f"{about} {abs(beside_cm):.0f} cm {'farther' if beside_cm > 0.0 else 'nearer'}" if kind == "wall" else
            f"{about} beside" if about == DOORS else f"{about} that stands {abs(beside_cm):.0f} cm beside")
    size = (0.0, BESIDE_M) if about == DOORS else (round(found.off_m, 4), round(found.sigma_m, 4))
    told = (Explanation("chance", f"{about} as in the file", 0.0),
            Explanation(kind, what, hedge({kind: found.log_ratio})[kind], *size))
    yield Evidence(about, f"{found.edges} of its edges from {case.fix.id}", told, at.x_m, at.y_m, at.heading_rad,
                   MIN_MOVE_M, MIN_TURN_RAD, 0.0 if frame is None else frame.value.sim_time_s)
