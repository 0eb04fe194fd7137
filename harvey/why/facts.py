"""What an entry and its neighbours in the journal say together, in whole sentences: the stuff of explanations.

Source: the entries themselves; no number is computed here that does not follow from two of them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

from harvey.run_files.records import EntryRecord
from harvey.why.history import History
from harvey.why.links import reason
from world_models.words import count, degrees, landmark, listed, metres, number, point, quantity, size, turn

Value = Mapping[str, Any]
SLIGHT_RAD = math.radians(0.05)
LEVELS: Mapping[str, str] = {
    "action": "on the move", "plan": "at a milestone", "goal": "by finding out anew where it is",
}


def place(p: Value) -> str:
    return f"{point(p['x_m'], p['y_m'])} of {p['locale']}"


def pose(hypothesis: Value) -> str:
    """Where a hypothesis says that the robot stands, and how surely."""
    p = hypothesis["locale_from_robot"]
    (a, b, _), (_, d, _), (_, _, h) = ((number(x) for x in row) for row in hypothesis["covariance"])
    spread = math.sqrt(max(0.0, (a + d) / 2.0 + math.hypot((a - d) / 2.0, b)))
    sure = f"sure to {metres(spread)} and {degrees(math.sqrt(max(0.0, h)))}"
    return f"{point(p['x_m'], p['y_m'])} of {hypothesis['locale']}, heading {degrees(p['heading_rad'])} ({sure})"


def frame_number(frame: EntryRecord | None, ref: str = "") -> str:
    return f"camera frame {frame.value['number']}" if frame is not None else f"a camera frame ({ref or 'not known'})"


def line(leg: EntryRecord, sketch: EntryRecord | None) -> str:
    """The line that is driven, and how the robot stood to it."""
    v = leg.value
    length_m = math.hypot(v["x1_m"] - v["x0_m"], v["y1_m"] - v["y0_m"])
    end = f" to {place(sketch.value['subgoals'][v['index']]['destination'])}" if sketch is not None else ""
    text = f"It was driving a straight line of {metres(length_m)}{end}"
    if v.get("to_go_m") is None:
        return text + f" ({v['status']} after {count(int(v['increments']), 'increment')})."
    text += f": {metres(abs(v['to_go_m']))} {'were left' if v['to_go_m'] >= 0 else 'too far'}"
    side = "left" if v["left_m"] >= 0 else "right"
    beside = f"{metres(abs(v['left_m']))} to the {side} of" if abs(v["left_m"]) >= 0.0005 else "on"
    text += f", it stood {beside} the line"
    if v["status"] == "moving":
        text += f", and the point of the line that it steers at lay {turn(v['aim_rad'])} of where it faced"
    else:
        text += f", near enough within {metres(v['tolerance_m'])}"
    return text + "."


def tracking(tracks: EntryRecord, frame: EntryRecord | None) -> str:
    """Which landmarks were found where, against where they were expected."""
    found = followed(tracks.value)
    old = [t for t in tracks.value["items"] if t["template_frame"] != tracks.value["frame"]]
    where = frame_number(frame, tracks.value["frame"])
    if not found:
        return f"In {where} none of {count(len(old), 'landmark')} that it follows was found." if old else (
            f"It chose {count(len(tracks.value['items']), 'landmark')} of {where} to follow.")
    middle = sorted(math.hypot(*shift_px(t)) for t in found)[len(found) // 2]
    return (f"In {where} it found {len(found)} of the {count(len(old), 'landmark')} that it follows; a corner of"
            f" {off(found[0])}, the furthest of them; half of them were within {middle:.1f} px.")


def followed(tracks: Value) -> list[Value]:
    """The landmarks that were found again, the one furthest from its prediction first."""
    again = (t for t in tracks["items"] if t["found_px"] is not None and t["template_frame"] != tracks["frame"])
    return sorted(again, key=lambda t: -math.hypot(*shift_px(t)))


def shift_px(track: Value) -> tuple[float, float]:
    """How far right of and below its prediction a landmark was found."""
    du, dv = (number(f) - number(p) for f, p in zip(track["found_px"], track["predicted_px"], strict=True))
    return du, dv


def off(track: Value) -> str:
    """Where a landmark was, against its prediction."""
    (du, dv), (u, v) = shift_px(track), track["predicted_px"]
    parts = [f"{abs(du):.1f} px {'right' if du >= 0 else 'left'} of"] if abs(du) >= 0.05 else []
    parts += [f"{abs(dv):.1f} px {'below' if dv >= 0 else 'above'}"] if abs(dv) >= 0.05 else []
    name = landmark(track["landmark"])
    return f"{name} was {' and '.join(parts) or 'at'} its prediction at ({number(u):.0f}, {number(v):.0f}) px"


def moved_belief(now: EntryRecord, before: EntryRecord) -> str:
    """How far a new belief is from the one before; empty where they are in different frames."""
    if now.value["locale"] != before.value["locale"]:
        return ""
    a, b = before.value["locale_from_robot"], now.value["locale_from_robot"]
    way = math.hypot(b["x_m"] - a["x_m"], b["y_m"] - a["y_m"])
    angle = math.remainder(b["heading_rad"] - a["heading_rad"], math.tau)
    turned = f" and turned it {turn(angle)}" if abs(angle) >= SLIGHT_RAD else ""
    return f"That moved its belief by {metres(way)}{turned}."


def wheels(report: EntryRecord) -> str:
    """What the wheels claim."""
    v = report.value
    parts = [f"turned {turn(v['turn_rad'])}"] * (abs(v["turn_rad"]) > 1e-6)
    parts += [f"moved {metres(v['move_m'])} ahead"] * (abs(v["move_m"]) > 1e-6)
    return f"the wheels claimed to have {' and '.join(parts) or 'stood still'}"


def matched(history: History, fix: EntryRecord) -> str:
    """Which segments of which frame were taken for which model elements, and what pose follows."""
    match = reason(history, fix, "LineMatch")
    if match is None:
        return f"The pose was solved from {fix.value['match']}."
    milestone, segments = reason(history, match, "Milestone"), reason(history, match, "Segments")
    frame = None if segments is None else reason(history, segments, "Frame")
    good = [pair for pair, inlier in zip(match.value["pairs"], fix.value["inliers"], strict=True) if inlier]
    where = f" in {frame_number(frame)}"
    if milestone is None or not good:
        return f"The pose was solved from {count(len(good), 'pair')} of segment and model line{where}."
    names, of = milestone.value["landmarks"], milestone.value["landmark_of"]
    by_name = Counter(names[of[model]] for model, _ in good)
    best = by_name.most_common(1)[0][0]
    numbers = [str(segment) for model, segment in good if names[of[model]] == best]
    segment = "segment" if len(numbers) == 1 else "segments"
    rest = [f"{landmark(n)} ({k})" for n, k in by_name.most_common() if n != best]
    others = f"; the other {len(good) - len(numbers)} with {listed(rest)}" if rest else ""
    total = len(segments.value["segments_px"]) if segments is not None else None
    of_all = f" of {count(total, 'line segment')}" if total is not None else ""
    return (f"{len(good)}{of_all}{where} were matched with model lines: {segment} {listed(numbers)} with"
            f" {landmark(best)}{others}.")


def best_pairs(history: History, fix: EntryRecord, match: EntryRecord) -> str:
    """The segments of the landmark with most of them: ``segments 12, 31 and 40 in camera frame 88 against ...``."""
    milestone, segments = reason(history, match, "Milestone"), reason(history, match, "Segments")
    frame = None if segments is None else reason(history, segments, "Frame")
    good = [pair for pair, inlier in zip(match.value["pairs"], fix.value["inliers"], strict=True) if inlier]
    if milestone is None or not good:
        return f"{count(len(good), 'pair')} in {frame_number(frame)}"
    names, of = milestone.value["landmarks"], milestone.value["landmark_of"]
    best = Counter(names[of[model]] for model, _ in good).most_common(1)[0][0]
    numbers = [str(segment) for model, segment in good if names[of[model]] == best]
    segment = "segment" if len(numbers) == 1 else "segments"
    return f"{segment} {listed(numbers)} in {frame_number(frame)} against {landmark(best)}"


def verdict(certificate: EntryRecord, milestone: EntryRecord | None) -> str:
    """What was concluded, with the numbers that decided."""
    v = certificate.value
    what = milestone_name(milestone.value) if milestone is not None else v["milestone"]
    chance = f"the probability that so much agrees at a wrong place is {number(v['p_false']):.2g}"
    away = f"the pose is {metres(v['deviation_m'])} and {degrees(abs(v['deviation_rad']))} from what was believed"
    if v["verdict"] != "verified":
        return f"{what} was judged {v['verdict']}: {v['reason']}; {chance}."
    return (f"{what} was verified: {v['reason']} (up to {number(v['tolerance_px']):.0f} px may be corrected); {away};"
            f" {chance}.")


def milestone_name(v: Value) -> str:
    """``milestone M1 of the route``, or the check that it is."""
    what = str(v["what"]).partition(", because")[0]
    return f"milestone {what}" if v["sketch"] else f"the {what}"


def expectation(v: Value) -> str:
    """What a milestone says should be seen."""
    if not v["expected"]:
        return f"It was to look for {milestone_name(v)}, and first had to turn to where most is to be seen of it."
    names = [landmark(name) for name in v["landmarks"]]
    return f"At {milestone_name(v)} it expected to see {count(len(v['expected']), 'model line')} of {listed(names, 4)}."


def plan(v: Value) -> str:
    """Which sketch, how far along."""
    subgoals, at = v["subgoals"], int(v["at"])
    where = f"through {v['locale']}" if v["locale"] else "from room to room"
    if v["status"] != "active":
        how = "was carried out to its end" if v["status"] == "done" else f"was {v['status']} in part {at + 1}"
        return f"Its plan {where} {how}, {place(subgoals[-1]['destination'])}." if v["status"] == "done" else (
            f"Its plan {where} {how} of {len(subgoals)}.")
    if at < len(subgoals):
        by = f" by {subgoals[at]['passage']}" if subgoals[at]["passage"] else ""
        now = f"part {at + 1} of {len(subgoals)}, to {place(subgoals[at]['destination'])}{by}"
    else:
        now = f"at its end, {place(subgoals[-1]['destination'])}"
    return f"This is in its plan {where}: {now}."


def goal(v: Value) -> str:
    way = f"from {place(v['origin'])} to {place(v['destination'])}"
    if v["status"] == "reached":
        return f"The goal was reached: {way}."
    if v["status"] == "abandoned":
        return f"The goal was given up for a new one, from where it turned out to be: {way}."
    return f"All of it serves the goal: {way}."


def puzzled(segments: EntryRecord, frame: EntryRecord | None) -> str:
    """What was seen while nobody knew where the robot was."""
    v = segments.value
    seen = f"In {frame_number(frame, v['frame'])} there were {count(len(v['segments_px']), 'line segment')}"
    return f"{seen} (contrast {number(v['contrast']):.0f} of 255); where it is did not yet follow from them."


def doubt(v: Value) -> str:
    """A discrepancy in words."""
    large = "" if v["magnitude"] is None else f" ({size(v['magnitude'], v['unit'])}{_bound(v)})"
    came = {"escalated": ", so the next level had to deal with it", "corrected": ", and was corrected"}
    return f"Something was not as expected, to be dealt with {LEVELS[v['level']]}: {v['what']}{large}" + (
        came.get(v["status"], "") + ".")


def _bound(v: Value) -> str:
    bounds = dict(zip(("action", "plan"), v["bounds"], strict=True))
    bound = bounds.get(v["level"])
    return "" if bound is None else f"; up to {quantity(bound, v['unit'])} may be corrected there"
