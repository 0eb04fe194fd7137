"""What an entry says, in plain words with numbers and units: one sentence-maker for each type of value.

They read the journal's JSON, so that a recorded run is explained without the code that made it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from harvey.records import EntryRecord
from harvey.units import count, degrees, metres, number, point, quantity, turn

Value = Mapping[str, Any]
LONGEST = 160


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
    text = ", ".join(f"{key} = {item}" for key, item in fields)
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
    shown = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
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
    found = [t for t in v["items"] if t["found_px"] is not None]
    head = f"{len(found)} of {count(len(v['items']), 'landmark')} found in {v['frame']}"
    return head + "".join(f"; {_track(t)}" for t in found[:3]) + ("; ..." if len(found) > 3 else "")


def _track(t: Value) -> str:
    du, dv = (f - p for f, p in zip(t["found_px"], t["predicted_px"], strict=True))
    return (f"{t['landmark']} {abs(du):.1f} px {'right' if du >= 0 else 'left'} and {abs(dv):.1f} px"
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
    return f"{v['status']}: in {v['locale']} at {where}, by {v['basis']}"


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
    return f"asked for a picture ({v['purpose']})"


def _frame(v: Value) -> str:
    purpose = v["purpose"] or "no purpose"
    return f"camera frame {v['number']} at {number(v['sim_time_s']):.1f} s ({purpose}, {v['jpeg']['bytes']} bytes)"


def _discrepancy(v: Value) -> str:
    unit, level = v["unit"], v["level"]
    size = "not yet measured there" if v["magnitude"] is None else quantity(v["magnitude"], unit)
    bounds = dict(zip(("action", "plan"), v["bounds"], strict=True))
    bound = f", where up to {quantity(bounds[level], unit)} may be corrected" if level in bounds else ""
    return f"{level}-level discrepancy, {v['what']}: {size}{bound}; {v['status']}"


def _quiescence(v: Value) -> str:
    return f"nothing was left to do after cycle {v['cycle']}"


def _root(variance: Any) -> float:
    return math.sqrt(max(0.0, number(variance)))


MAKERS: Mapping[str, Callable[[Value], str]] = {
    "Command": _command, "Goal": _goal, "PlanSketch": _plan_sketch, "Leg": _leg, "Milestone": _milestone,
    "Certificate": _certificate, "Outcome": _outcome, "Tracks": _tracks, "Segments": _segments,
    "LineMatch": _line_match, "PoseFix": _pose_fix, "Hypothesis": _hypothesis,
    "MotorCommand": _motion, "MotionReport": _motion_report, "Look": _look, "Frame": _frame,
    "Discrepancy": _discrepancy, "Quiescence": _quiescence,
}
