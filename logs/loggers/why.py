"""Why: what Harvey wants, believes, does, expects, sees and doubts, in plain sentences."""

from __future__ import annotations

import math
from collections.abc import Callable

import rerun as rr

from blackboard.entry import Entry, Ref
from blackboard.level import Level
from blackboard.servoing import Discrepancy
from logs.loggers.robots import believed
from logs.loggers.sketch_tree import subgoal_label
from logs.mirror import Mirror, Moment
from logs.paths import WHY
from logs.tape import Tape
from world_models.body import MotorCommand
from world_models.location import Hypothesis
from world_models.percepts import LineMatch, PoseFix, Segments, Tracks
from world_models.task import Certificate, Goal, Leg, Milestone, Outcome, PlanSketch

NOTABLE = (Goal, PlanSketch, Leg, Milestone, Certificate, Discrepancy, Outcome, Hypothesis, Tracks, MotorCommand)

MOST_NAMES = 4
MOST_REASONS = 5


class Why:
    """Logs the text when something in it may have changed."""

    def __init__(self) -> None:
        self._last = ""

    def begin(self, tape: Tape) -> None:
        """Nothing holds at all times."""

    def log(self, tape: Tape, moment: Moment) -> None:
        if not moment.touched(*NOTABLE):
            return
        text = story(moment.mirror)
        if text != self._last:
            self._last = text
            tape.log(WHY, rr.TextDocument(text, media_type="text/markdown"))


def story(mirror: Mirror) -> str:
    """The text, as markdown: one short paragraph a theme, none where there is nothing to say."""
    parts = ((title, tell(mirror)) for title, tell in CHAPTERS)
    return "\n\n".join(f"**{title}** {text}" for title, text in parts if text)


def _ended(mirror: Mirror) -> str:
    outcome = mirror.latest(Outcome)
    return f"{outcome.value.kind}: {outcome.value.reason}" if outcome else ""


def _wants(mirror: Mirror) -> str:
    goal = mirror.latest(Goal)
    return f"to go from {goal.value.origin} to {goal.value.destination} ({goal.value.status})." if goal else ""


def _believes(mirror: Mirror) -> str:
    held = believed(mirror)
    if held is None:
        return "nothing about where he is: he is lost."
    pose = held.locale_from_robot
    where = f"({pose.x_m:.2f}, {pose.y_m:.2f}) m, heading {math.degrees(pose.heading_rad):.1f}°"
    return (f"he is in {held.locale} at {where}, "
            f"give or take {1e3 * held.sigma_m:.0f} mm and {math.degrees(held.sigma_rad):.2f}° (from {held.basis}).")


def _does(mirror: Mirror) -> str:
    leg = mirror.latest(Leg, lambda g: g.status == "moving")
    sketch = mirror.latest(PlanSketch, lambda s: s.is_active and s.current is not None)
    if leg is None or sketch is None:
        return "stands still" + (f"; next: {_next(sketch.value)}." if sketch else ".")
    way = math.hypot(leg.value.x1_m - leg.value.x0_m, leg.value.y1_m - leg.value.y0_m)
    doing = "has halted on" if _is_halted(mirror) else "drives"
    return f"{doing} a straight leg of {way:.1f} m, {_next(sketch.value)}; {leg.value.increments} increments so far."


def _is_halted(mirror: Mirror) -> bool:
    """Nothing moves while something above the action level is in doubt."""
    return mirror.latest(Discrepancy, lambda d: d.is_open and d.level is not Level.ACTION) is not None


def _next(sketch: PlanSketch) -> str:
    subgoal = sketch.current
    where = f" in {sketch.locale}" if sketch.locale else ""
    return f"part {sketch.at + 1} of {len(sketch.subgoals)}{where} ({subgoal_label(subgoal)})" if subgoal else "done"


def _expects(mirror: Mirror) -> str:
    last = mirror.latest(Milestone, lambda m: m.is_open)
    if last is None:
        return ""
    milestone = last.value
    if milestone.status == "turning":
        return f"to see {milestone.what}, once he has turned to {math.degrees(milestone.look_heading_rad):.0f}°."
    return f"{milestone.what}: {len(milestone.expected)} lines of {_list(milestone.landmarks)}."


def _sees(mirror: Mirror) -> str:
    return " ".join(part for part in (_followed(mirror), _verified(mirror)) if part)


def _followed(mirror: Mirror) -> str:
    tracks = mirror.latest(Tracks)
    if tracks is None or not tracks.value.items:
        return ""
    items = tracks.value.items
    found = [track for track in items if track.found_px]
    return f"{len(found)} of the {len(items)} points that he follows."


def _verified(mirror: Mirror) -> str:
    """The evidence for or against the milestone that is open, as far as it goes."""
    milestone, segments = mirror.latest(Milestone, lambda m: m.is_open), mirror.latest(Segments)
    if milestone is None or segments is None or segments.value.milestone != milestone.id:
        return ""
    words = [f"{len(segments.value.segments_px)} line segments"]
    match = mirror.latest(LineMatch, lambda m: m.milestone == milestone.id)
    if match:
        words.append(f"{len(match.value.pairs)} matched")
        fix = mirror.latest(PoseFix, lambda f: f.match == match.id)
        words += [f"{int(fix.value.inliers.sum())} of these agree on one pose"] if fix else []
    return ", ".join(words) + "."


def _concludes(mirror: Mirror) -> str:
    entry = mirror.latest(Certificate)
    if entry is None:
        return ""
    c = entry.value
    off = f"{1e3 * c.deviation_m:.0f} mm and {math.degrees(c.deviation_rad):.2f}° from what he believed"
    return (f"**{c.verdict}**: {c.reason} (tolerance {c.tolerance_px:.1f} px); {off}; "
            f"a wrong place looks so with probability {c.p_false:.1g}.")


def _doubts(mirror: Mirror) -> str:
    open_ones = [e.value for e in mirror.all(Discrepancy) if e.value.is_open]
    return " ".join(map(_discrepancy, open_ones)) or "nothing at the moment."


def _discrepancy(d: Discrepancy) -> str:
    size = "not yet measured" if d.magnitude is None else f"{d.magnitude:.1f} {d.unit}"
    size = size if d.magnitude != math.inf else "too large to be measured"
    bound = f", may correct up to {d.bound:.1f} {d.unit}" if math.isfinite(d.bound) else ""
    return f"{d.what}: {size} (at the {d.level} level{bound})."


def _because(mirror: Mirror) -> str:
    """The chain of reasons behind the last motor command."""
    command = mirror.latest(MotorCommand)
    if command is None:
        return ""
    turn, move = math.degrees(command.value.turn_rad), command.value.move_m
    chain = " ← ".join(_chain(mirror, command))
    return f"TURN {turn:+.1f}°, MOVE {move:.2f} m" + (f" because of {chain}." if chain else ".")


def _chain(mirror: Mirror, entry: Entry[object]) -> list[str]:
    """What an entry rests on, what that rests on, and so on: always the first reason."""
    names: list[str] = []
    reasons: tuple[Ref, ...] = entry.because
    while reasons and len(names) < MOST_REASONS and str(reasons[0]) not in names:
        names.append(str(reasons[0]))
        known = mirror.get(reasons[0].id)
        reasons = known.because if known else ()
    return names


def _list(names: tuple[str, ...]) -> str:
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more


CHAPTERS: tuple[tuple[str, Callable[[Mirror], str]], ...] = (
    ("The end:", _ended), ("Harvey wants", _wants), ("He believes", _believes), ("He does:", _does),
    ("He expects", _expects), ("He sees", _sees), ("He doubts:", _doubts), ("He last judged", _concludes),
    ("Last motor command:", _because),
)
