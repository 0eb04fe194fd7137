"""What an entry says, in plain words with numbers and units: one sentence-maker for each type of value.

They read the journal's JSON, so that a recorded run is explained without the code that made it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from harvey.run_files.records import EntryRecord
from harvey.units import count, degrees, metres, number, point, quantity, turn

Value = Mapping[str, Any]
LONGEST = 160
PURPOSES: Mapping[str, str] = {
    "track": "to follow landmarks", "milestone": "to verify a milestone", "probe": "to find out where it is",
}
"""What a picture is taken for."""


def sentence(record: EntryRecord) -> str:
    """One sentence, without the entry's name and without a full stop."""
    maker = MAKERS.get(record.type)
    try:
        said = maker(record.value) if maker else _anything(record.value)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError):
        said = _anything(record.value)  # fields other than those known here: told as they are
    return f"{said}; no longer believed" if record.change == "Retracted" else said


def _anything(value: Any) -> str:
    fields = value.items() if isinstance(value, Mapping) else [("value", value)]
    text = ", ".join(f"{key} = {item}" for key, item in fields) or "it says nothing"
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


# -- task ------------------------------------------------------------------------------------------------------------


def _command(v: Value) -> str:
    arrival = "" if v["arrival_heading_rad"] is None else f", to arrive at heading {degrees(v['arrival_heading_rad'])}"
    start = f"{degrees(v['start_heading_rad'])}{_sigma(v['start_covariance'])}"
    return f"the user asked for {v['text']}, with Harvey put down at heading {start}{arrival}"


def _place(v: Value) -> str:
    return f"{v['locale']} {point(v['x_m'], v['y_m'])}"


def _goal(v: Value) -> str:
    return f"goal: from {_place(v['origin'])} to {_place(v['destination'])}; {v['status']}"


def _plan_sketch(v: Value) -> str:
    subgoals, at = v["subgoals"], int(v["at"])
    where = f"through {v['locale']}" if v["locale"] else "from locale to locale"
    steps = " then ".join(_place(s["destination"]) + (f" by {s['passage']}" if s["passage"] else "") for s in subgoals)
    adjusted = f", adjusted {count(int(v['adjustments']), 'time')}" if v["adjustments"] else ""
    if v["status"] != "active":
        progress = f"{v['status']} at milestone M{at}"
    else:
        progress = f"milestone M{at} of M{len(subgoals)} {'verified' if v['verified'] else 'yet to be verified'}"
    return f"plan sketch {where}: to {steps}; {progress}{adjusted}"


def _leg(v: Value) -> str:
    length_m = math.hypot(v["x1_m"] - v["x0_m"], v["y1_m"] - v["y0_m"])
    return (f"straight leg of {metres(length_m)} from {point(v['x0_m'], v['y0_m'])} to {point(v['x1_m'], v['y1_m'])}"
            f" in the world (subgoal {v['index']} of {v['sketch']}, near enough within {metres(v['tolerance_m'])});"
            f" {v['status']} after {count(int(v['increments']), 'increment')}")


def _milestone(v: Value) -> str:
    of = f"of {v['sketch']}" if v["sketch"] else "in between"
    names = list(v["landmarks"])
    shown = listed([landmark(name) for name in names], 4)
    seen = f" should show {count(len(v['expected']), 'model line')} of {shown}" if names else ""
    return f"milestone {v['what']} ({of}): looking along {degrees(v['look_heading_rad'])}{seen}; {v['status']}"


def _certificate(v: Value) -> str:
    agree = f"{count(int(v['inliers']), 'line')} agree to {quantity(v['residual_px'], 'px')} of {v['matched']} matched"
    shift = f"{quantity(v['deviation_px'], 'px')} of the {quantity(v['tolerance_px'], 'px')} that may be corrected"
    return (f"{v['milestone']} is {v['verdict']}: {v['reason']}; {agree}; {metres(v['deviation_m'])} and"
            f" {degrees(v['deviation_rad'])} from the belief, {shift}; chance of a wrong place"
            f" {number(v['p_false']):.2g}")


def _outcome(v: Value) -> str:
    return f"the mission ended: {v['kind']}, because {v['reason']}"


# -- percepts --------------------------------------------------------------------------------------------------------


def _tracks(v: Value) -> str:
    fresh = sum(1 for t in v["items"] if t["template_frame"] == v["frame"])
    found = followed(v)
    old = len(v["items"]) - fresh
    parts = [f"{len(found)} of {count(old, 'landmark')} found in {v['frame']}"] if old else []
    parts += [f"{count(fresh, 'landmark')} taken anew from {v['frame']}"] if fresh else []
    head = " and ".join(parts) or f"no landmark is followed as of {v['frame']}"
    return head + "".join(f"; {_track(t)}" for t in found[:3]) + ("; ..." if len(found) > 3 else "")


def followed(tracks: Value) -> list[Value]:
    """The landmarks that were found again, the one that is furthest from its prediction first."""
    again = (t for t in tracks["items"] if t["found_px"] is not None and t["template_frame"] != tracks["frame"])
    return sorted(again, key=lambda t: -math.hypot(*shift_px(t)))


def shift_px(t: Value) -> tuple[float, float]:
    """How far right of and below its prediction a landmark was found."""
    du, dv = (number(f) - number(p) for f, p in zip(t["found_px"], t["predicted_px"], strict=True))
    return du, dv


def _track(t: Value) -> str:
    du, dv = shift_px(t)
    return (f"{landmark(t['landmark'])} {abs(du):.1f} px {'right' if du >= 0 else 'left'} and {abs(dv):.1f} px"
            f" {'below' if dv >= 0 else 'above'} its prediction (correlation {number(t['peak']):.2f})")


def _segments(v: Value) -> str:
    purpose = f" for {v['milestone']}" if v["milestone"] else ""
    contrast = f"contrast {number(v['contrast']):.0f} of 255"
    return f"{count(len(v['segments_px']), 'line segment')} found in {v['frame']}{purpose}, {contrast}"


def _line_match(v: Value) -> str:
    pairs = v["pairs"]
    segments = len({int(pair[1]) for pair in pairs})
    lines = len({int(pair[0]) for pair in pairs})
    return (f"{count(segments, 'segment')} of {v['segments']} matched to {count(lines, 'line')} of {v['milestone']},"
            f" match error {number(v['error']):.3g}")


def _pose_fix(v: Value) -> str:
    agree = f"{sum(1 for i in v['inliers'] if i)} of {count(len(v['inliers']), 'pair')} agree"
    where = f"{_pose(v['world_from_robot'])} in the world{_sigma(v['covariance'])}"
    return f"from {v['match']} the robot stands at {where}; {agree}"


def _hypothesis(v: Value) -> str:
    where = f"{_pose(v['locale_from_robot'])}{_sigma(v['covariance'])}"
    evidence = f" ({v['evidence']})" if v.get("evidence") else ""
    return f"{v['status']}: in {v['locale']} at {where}, by {v['basis']}{evidence}"


def _panorama(v: Value) -> str:
    looks = len(v["glimpses"])
    return f"after {looks} {'look' if looks == 1 else 'looks'} round: {v['found']}"


def _pose(p: Value) -> str:
    return f"{point(p['x_m'], p['y_m'])}, heading {degrees(p['heading_rad'])}"


def _sigma(covariance: Any) -> str:
    """The largest standard deviation of the place, and that of the heading."""
    (a, b, _), (_, d, _), (_, _, heading) = ((number(x) for x in row) for row in covariance)
    place = (a + d) / 2.0 + math.hypot((a - d) / 2.0, b)
    return f" (sigma {metres(_root(place))}, {degrees(_root(heading))})"


# -- body and board ----------------------------------------------------------------------------------------------------


def _motion(v: Value) -> str:
    """The parts of a motion that are worth telling."""
    angle, way = number(v["turn_rad"]), number(v["move_m"])
    parts = [f"turn {turn(angle)}"] * (abs(angle) > 1e-6) + [f"move {metres(way)} ahead"] * (way > 1e-6)
    return " and ".join(parts) or "stand still"


def _motion_report(v: Value) -> str:
    return f"the wheels claim: {_motion(v)}, in {number(v['duration_s']):.1f} s, at {number(v['sim_time_s']):.1f} s"


def _look(v: Value) -> str:
    return f"asked for a picture {_for(v['purpose'])}"


def _frame(v: Value) -> str:
    at = f"camera frame {v['number']} at {number(v['sim_time_s']):.1f} s"
    return f"{at} {_for(v['purpose'])} ({v['jpeg']['bytes'] / 1000.0:.0f} kB)"


def _for(purpose: str) -> str:
    return PURPOSES.get(purpose, f"for {purpose}" if purpose else "for no purpose")


def _body_fault(v: Value) -> str:
    claims = [turn(v["turn_rad"])] if v["turn_rad"] else []
    claims += [f"{metres(v['move_m'])} ahead"] if v["move_m"] else []
    done = f"; of {v['request']} the wheels claim {' and '.join(claims)}" if claims else ""
    how = "" if v["status"] == "open" else f"; {v['status']}"
    return f"the {v['part']} is at fault since {number(v['when_s']):.1f} s: {v['what']} ({v['detail']}){done}{how}"


def _recovery(v: Value) -> str:
    about = f"have {v['request']} answered after {v['fault']}"
    if v["status"] == "asked":
        so_far = f"{count(int(v['tries']), 'try', 'tries')} so far"
        return f"to wait {number(v['wait_s']):.2f} s, then try again to {about} ({so_far})"
    ended = "it worked" if v["status"] == "over" else f"in vain: {v['what']} ({v['detail']})"
    return f"tried to {about}: {ended} after {number(v['waited_s']):.1f} s"


def _discrepancy(v: Value) -> str:
    unit, level = v["unit"], v["level"]
    size = "not yet measured there" if v["magnitude"] is None else size_of(v["magnitude"], unit)
    bounds = dict(zip(("action", "plan"), v["bounds"], strict=True))
    bound = f", where up to {quantity(bounds[level], unit)} may be corrected" if level in bounds else ""
    return f"{level}-level discrepancy, {v['what']}: {size}{bound}; {v['status']}"


def size_of(magnitude: Any, unit: str) -> str:
    """How large a discrepancy is."""
    return quantity(magnitude, unit) if math.isfinite(number(magnitude)) else "too large to be measured"


def landmark(name: str) -> str:
    """``hallway/pillar-4`` as people say it."""
    locale, _, thing = str(name).rpartition("/")
    return f"{thing} of {locale}" if locale else thing


def listed(items: Sequence[Any], most: int = 3) -> str:
    """``a, b and c``; ``a, b, c and 4 more`` where there are more than told."""
    texts = [str(item) for item in items]
    if len(texts) > most:
        return f"{', '.join(texts[:most])} and {len(texts) - most} more"
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)


def _resumed(v: Value) -> str:
    cut_off = f"the run was cut off after cycle {v['after_cycle']} and goes on; the robot was stopped in between"
    return cut_off + "".join(f"; nobody heard how far {ref} was carried out" for ref in v["interrupted"])


def _quiescence(v: Value) -> str:
    return f"nothing was left to do after cycle {v['cycle']}"


def _course(v: Value) -> str:
    if v["speed_m_per_s"] <= 0.0:
        return "come to a stand"
    bend = math.degrees(v["curvature_per_m"])
    side = "left" if bend >= 0.0 else "right"
    return f"roll on at {v['speed_m_per_s']:.2f} m/s, bending by {abs(bend):.2f} degrees a metre to the {side}"


def _drift(v: Value) -> str:
    bend = math.degrees(v["curvature_per_m"])
    side = "left" if bend >= 0.0 else "right"
    return (f"these wheels drift by {abs(bend):.2f} degrees a metre to the {side}"
            f" (+-{math.degrees(v['sigma_per_m']):.2f}), by what was seen until {metres(v['gone_m'])} ago")


def _obstruction(v: Value) -> str:
    corners = ", ".join(f"({u:.0f}, {w:.0f})" for u, w in v["outline_px"])
    return f"something is before the camera: the part of the picture within {corners} px stands still while it turns"


def _ride(v: Value) -> str:
    return f"Harvey stands in the elevator and asks for a ride from {v['origin']} to {v['destination']}"


def _ride_report(v: Value) -> str:
    opened = f"after {number(v['duration_s']):.0f} s the doors opened at {v['destination']}"
    return f"somebody pressed the button, and {opened}"


def _root(variance: Any) -> float:
    return math.sqrt(max(0.0, number(variance)))


MAKERS: Mapping[str, Callable[[Value], str]] = {
    "Command": _command, "Goal": _goal, "PlanSketch": _plan_sketch, "Leg": _leg, "Milestone": _milestone,
    "Certificate": _certificate, "Outcome": _outcome, "Tracks": _tracks, "Segments": _segments,
    "LineMatch": _line_match, "PoseFix": _pose_fix, "Hypothesis": _hypothesis, "Panorama": _panorama,
    "MotorCommand": _motion, "MotionReport": _motion_report, "Look": _look, "Frame": _frame,
    "Discrepancy": _discrepancy, "Quiescence": _quiescence, "Resumed": _resumed, "BodyFault": _body_fault,
    "Recovery": _recovery, "Drift": _drift, "Course": _course, "Ride": _ride, "RideReport": _ride_report,
    "Obstruction": _obstruction,
}
