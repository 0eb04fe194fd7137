"""What a mission's board may forget, and when: beside the wiring, because it follows from what all experts ask for.

Nothing is forgotten that an expert can still find by its questions: the newest of its kind, what is open or active,
what an entry on the board names by its id, and what a pending activation was triggered by. Types that are not listed
stay.
"""

from __future__ import annotations

from typing import Any

from blackboard.board import View
from blackboard.change import Quiescence
from blackboard.entry import Entry
from blackboard.index import Index
from blackboard.level import Level
from blackboard.retention import Forget
from blackboard.servoing import OPEN, Discrepancy
from knowledge_sources.plan.obstruction_finder import LOOKS
from knowledge_sources.questions import last_escalated
from world_models.entries.body import (
    BodyFault,
    Course,
    Frame,
    Look,
    MotionReport,
    MotorCommand,
    Recovery,
    Ride,
    RideReport,
)
from world_models.entries.percepts import LineMatch, Panorama, PoseFix, Segments, Tracks
from world_models.entries.task import Certificate, Goal, Leg, Milestone, PlanSketch

LAST_MOTIONS = 8
"""The fault_handler looks so far back, and a little less, when it asks whether the base gets on."""

FIX: Index[Certificate] = Index(Certificate, lambda certificate: certificate.fix)
MATCH: Index[PoseFix] = Index(PoseFix, lambda fix: fix.match)
SEGMENTS: Index[LineMatch] = Index(LineMatch, lambda match: match.segments)
MATCHED: Index[LineMatch] = Index(LineMatch, lambda match: match.milestone)
SOUGHT: Index[Segments] = Index(Segments, lambda segments: segments.milestone or None)
REQUEST: Index[BodyFault] = Index(BodyFault, lambda fault: fault.request if fault.is_open else None)


def named_by(*indexes: Index[Any]) -> Any:
    """A test whether some entry names another by its id, as the indexes tell."""
    return lambda view, entry: any(view.newest(index, entry.id) is not None for index in indexes)


def is_template(view: View, frame: Entry[Frame]) -> bool:
    """Whether templates of tracks are cut from a frame."""
    tracks = view.latest(Tracks)
    return tracks is not None and any(track.template_frame == frame.id for track in tracks.value.items)


def is_probe(view: View, segments: Entry[Segments]) -> bool:
    """Whether segments may be of a probe that is counted while the robot is lost."""
    return segments.value.milestone == "" and view.newest(OPEN, Level.GOAL) is not None


def is_of_use(view: View, segments: Entry[Segments]) -> bool:
    return view.newest(SEGMENTS, segments.id) is not None or is_probe(view, segments)


def request_is_there(view: View, fault: Entry[BodyFault]) -> bool:
    """Whether the request that a fault broke off is still on the board."""
    return view.get(fault.value.request) is not None


def is_last_of_its_level(view: View, found: Entry[Discrepancy]) -> bool:
    """Whether it is the last that its level passed up: by it is counted how often it does."""
    last = last_escalated(view, found.value.level)
    return last is not None and last.id == found.id


RETENTION: tuple[Forget[Any], ...] = (
    Forget(Frame, keep=2, unless=is_template),
    Forget(Segments, keep=LOOKS, unless=is_of_use),
    Forget(LineMatch, keep=2, unless=named_by(MATCH)),
    Forget(PoseFix, keep=2, unless=named_by(FIX)),
    Forget(Certificate, keep=2),
    Forget(Milestone, keep=2, when=lambda milestone: not milestone.is_open, unless=named_by(MATCHED, SOUGHT)),
    Forget(Discrepancy, keep=2, when=lambda found: not found.is_open, unless=is_last_of_its_level),
    Forget(PlanSketch, keep=2, when=lambda sketch: not sketch.is_active),
    Forget(Goal, keep=2, when=lambda goal: not goal.is_active),
    Forget(Leg, keep=2),
    Forget(Course, keep=LAST_MOTIONS, unless=named_by(REQUEST)),
    Forget(Look, keep=LAST_MOTIONS, unless=named_by(REQUEST)),
    Forget(MotorCommand, keep=LAST_MOTIONS, unless=named_by(REQUEST)),
    Forget(MotionReport, keep=2),
    Forget(Ride, keep=LAST_MOTIONS, unless=named_by(REQUEST)),
    Forget(RideReport, keep=2),
    Forget(Panorama, keep=2),
    Forget(BodyFault, keep=LAST_MOTIONS, when=lambda fault: not fault.is_open, unless=request_is_there),
    Forget(Recovery, keep=LAST_MOTIONS, when=lambda recovery: recovery.status == "over"),
    Forget(Quiescence),
)
