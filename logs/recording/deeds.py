"""What a change on the board amounts to, in a few plain words: one teller for each type of value."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from blackboard.change import Change, Quiescence, Retracted, Revised
from blackboard.servoing import Discrepancy
from logs.recording import words
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
from world_models.entries.location import Hypothesis
from world_models.entries.obstruction import Obstruction
from world_models.entries.percepts import LineMatch, Panorama, PoseFix, Segments, Tracks
from world_models.entries.task import Certificate, Goal, Leg, Milestone, Outcome, PlanSketch, Resumed
from world_models.entries.wheels import Drift

PURPOSES: Mapping[str, str] = {
    "track": "to follow landmarks by", "milestone": "to check a milestone", "probe": "to find out where he is",
}


class Deeds:
    """Tells changes in their order; it remembers the last belief, to tell by how much it was corrected."""

    def __init__(self) -> None:
        self._beliefs: dict[str, Hypothesis] = {}

    def tell(self, change: Change) -> str:
        """A few words, without a full stop; "" for what goes without saying."""
        value = change.entry.value
        if isinstance(change, Retracted):
            return f"drops {change.entry.id}"
        if isinstance(value, Hypothesis):
            return self._belief(change, value)
        teller = TELLERS.get(type(value))
        return teller(value, isinstance(change, Revised)) if teller else f"{change.kind.lower()} {change.entry.ref}"

    def _belief(self, change: Change, new: Hypothesis) -> str:
        old = self._beliefs.get(change.entry.id)
        self._beliefs[change.entry.id] = new
        if not new.is_held:
            return f"perhaps in {new.locale} (weight {new.weight:.2f})"
        pose = new.locale_from_robot
        if old is None or old.locale != new.locale or new.basis in ("command", "relocalization"):
            return f"believes himself in {new.locale} at ({pose.x_m:.2f}, {pose.y_m:.2f}) m"
        by = old.locale_from_robot.inverse() @ pose
        size = f"{words.metres(math.hypot(by.x_m, by.y_m))} and {words.degrees(abs(by.heading_rad))}"
        if new.basis == "odometry":
            return f"moves his belief on by {size}, as the wheels claim"
        return f"corrects his belief by {size}"


def _goal(goal: Goal, revised: bool) -> str:
    return f"the goal is {goal.status}" if revised else f"takes as goal: {words.place(goal.destination)}"


def _sketch(sketch: PlanSketch, revised: bool) -> str:
    where = f"through {sketch.locale}" if sketch.locale else "of the route"
    if sketch.status != "active":
        return f"the sketch {where} is {sketch.status}"
    if not revised:
        return f"sketches the way {where}: {words.count(len(sketch.subgoals), 'part')}"
    return f"M{sketch.at} {where} holds" if sketch.verified else f"goes on to M{sketch.at} {where}"


def _leg(leg: Leg, revised: bool) -> str:
    if not revised:
        return f"begins a straight leg of {words.metres(math.hypot(leg.x1_m - leg.x0_m, leg.y1_m - leg.y0_m))}"
    return "" if leg.status == "moving" else f"the leg is done: {leg.status}"


def _milestone(milestone: Milestone, revised: bool) -> str:
    if revised:
        return "" if not milestone.is_open else f"now {milestone.status}"
    return f"expects {words.count(len(milestone.expected), 'line')} of {words.listed(milestone.landmarks, 2)}"


def _certificate(c: Certificate, _revised: bool) -> str:
    """The verdict and what it rests on most; a line has no room for all of it."""
    return f"{c.verdict}: {', '.join(c.reason.partition(';')[0].split(', ')[:2])}"


def _panorama(panorama: Panorama, _revised: bool) -> str:
    return panorama.found or f"has {words.count(len(panorama.glimpses), 'look')} to find himself by"


def _discrepancy(d: Discrepancy, _revised: bool) -> str:
    if d.status == "corrected":
        return "that is put right"
    if d.status == "escalated":
        return f"too much for the {d.level} level, passed on to the {d.level.above} level"
    size = "" if d.magnitude is None or not math.isfinite(d.magnitude) else f" ({words.pixels(d.magnitude)})"
    return f"{d.what}{'' if d.unit == 'px' and words.pixels(d.magnitude or 0.0) in d.what else size}"


def _command(command: MotorCommand, _revised: bool) -> str:
    return words.motion(command.turn_rad, command.move_m)


def _course(course: Course, _revised: bool) -> str:
    if not course.is_rolling:
        return "come to a stand"
    return f"roll on at {course.speed_m_per_s:.2f} m/s, bending by {words.degrees(course.curvature_per_m)} a metre"


def _report(report: MotionReport, _revised: bool) -> str:
    return f"the wheels claim: {words.motion(report.turn_rad, report.move_m)}"


def _tracks(tracks: Tracks, _revised: bool) -> str:
    found = sum(track.found_px is not None for track in tracks.items)
    points = words.count(len(tracks.items), "landmark point")
    return f"follows {found} of {points}" if tracks.items else "follows nothing"


def _match(match: LineMatch, _revised: bool) -> str:
    return f"matches {len({int(line) for line, _ in match.pairs})} of the {len(match.coverage)} expected lines"


def _fix(fix: PoseFix, _revised: bool) -> str:
    return f"{int(fix.inliers.sum())} of {words.count(len(fix.inliers), 'pair')} agree on one place"


def _fault(fault: BodyFault, _revised: bool) -> str:
    return f"{fault.part}: {fault.what} ({fault.detail})" if fault.is_open else f"{fault.what} is over"


def _recovery(recovery: Recovery, _revised: bool) -> str:
    if recovery.status == "asked":
        return f"waits {recovery.wait_s:.1f} s and tries again"
    return f"trying again was {recovery.status}" if recovery.status == "in vain" else "it is over"


TELLERS: Mapping[type[Any], Callable[[Any, bool], str]] = {
    Goal: _goal, PlanSketch: _sketch, Leg: _leg, Milestone: _milestone, Certificate: _certificate,
    Discrepancy: _discrepancy, MotorCommand: _command, Course: _course, MotionReport: _report, Tracks: _tracks,
    LineMatch: _match,
    PoseFix: _fix, BodyFault: _fault, Recovery: _recovery,
    Segments: lambda s, _: f"finds {words.count(len(s.segments_px), 'line segment')}",
    Look: lambda k, _: f"asks for a picture {PURPOSES.get(k.purpose, k.purpose)}",
    Ride: lambda r, _: f"asks for a ride from {r.origin} to {r.destination}",
    RideReport: lambda r, _: f"the doors open: {r.destination}, after {r.duration_s:.0f} s",
    Frame: lambda f, _: f"picture {f.number}",
    Panorama: _panorama,
    Drift: lambda _d, _r: "",
    Obstruction: lambda o, _: "something is before the camera and hides a part of every picture",
    Outcome: lambda o, _: f"{o.kind}: {o.reason}",
    Resumed: lambda r, _: f"goes on after cycle {r.after_cycle}, where the run was cut off",
    Quiescence: lambda _q, _r: "nothing is left to do",
}
