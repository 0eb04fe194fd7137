"""A run in a page of text: sentences, each with its cycle, and a table of milestones."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from logs.explain import phrases, turning_points
from logs.explain.phrases import Sentence, Story, capital, named, plainly, said, sentence, wrap
from logs.explain.turning_points import (
    COLLISION,
    SIMULATOR,
    TurningPoint,
    read_trouble,
    read_truth,
    read_turning_points,
    turn_lines,
)
from logs.records import EntryRecord, is_a
from logs.run_directory import RunDirectory, read_head
from logs.run_errors import reading
from logs.tables import table
from logs.timeline import Timeline
from world_models.building.locale_frame import LocaleFrame
from world_models.entries import (
    CameraState,
    Certificate,
    Command,
    Contact,
    Discrepancy,
    DoorState,
    Goal,
    Hypothesis,
    Milestone,
    Obstacle,
    Outcome,
    PictureRequest,
    PlanSketch,
    Redirection,
    UserReport,
    find_camera_lessons,
)
from world_models.words import count, listed, metres

WITHOUT: Mapping[str, str] = {
    "action": "no landmark was followed, and it drove by dead reckoning between milestones",
    "plan": "no pose was taken over from a milestone",
    "goal": "a robot that is lost does not look for where it is",
}
"""What it means that a level is off."""
WHAT_CHANGES: tuple[type[Any], ...] = (DoorState, Obstacle, Contact, UserReport, Redirection)
"""What changes the knowledge of a locale."""
COLUMNS = ("cycle", "s", "milestone", "verdict", "lines", "off mm", "off deg", "chance elsewhere", "bound")
MOST_ROWS = 60
"""Of more rows only those are printed that were not verified, and the last ones."""
MILESTONES = "Milestones"
LEGEND = """\
Places are in metres in each room's own frame. Times are by the body's clock. All of it is from the journal, as the
robot knew it, except where the simulator is named. Names in brackets are entries: ask on with harvey why RUN NAME, or
with harvey why RUN --at CYCLE."""


@dataclass(frozen=True, slots=True)
class MilestoneRow:
    """What became of a milestone.

    Attributes:
        cycle: of the verdict; of a milestone that was not judged its last.
        time_s: since the run began; None where it is unknown.
        name: ``M1 of hallway``, or ``the place where it believes to be``.
        verdict: verified, refuted, not testable; or withdrawn, expected, turning.
        expected, matched: numbers of model lines.
        deviation_m, deviation_rad: from the belief that predicted it; None where it was not judged.
        p_wrong, most_p_wrong: probability of a wrong place by which it was decided, and the bound on it that decided;
            None where it was not judged.
        refs: certificate and milestone.
    """

    cycle: int
    time_s: float | None
    name: str
    verdict: str
    expected: int
    matched: int
    deviation_m: float | None
    deviation_rad: float | None
    p_wrong: float | None
    most_p_wrong: float | None
    refs: tuple[str, ...]

    def cells(self, unknown: str) -> tuple[str, ...]:
        """Time [s], lines, deviation [mm, degrees], and the two probabilities, as a table for people has them."""
        off_m, off_rad = self.deviation_m, self.deviation_rad
        return (
            unknown if self.time_s is None else f"{self.time_s:.1f}", f"{self.matched} of {self.expected}",
            unknown if off_m is None else f"{1e3 * off_m:.1f}",
            unknown if off_rad is None else f"{math.degrees(abs(off_rad)):.1f}",
            unknown if self.p_wrong is None else f"{self.p_wrong:.2g}",
            unknown if self.most_p_wrong is None else (
                f"{'from ' if self.verdict == 'refuted' else ''}{self.most_p_wrong:.2g}"))


@dataclass(frozen=True, slots=True)
class RunStory:
    """What happened in a run.

    Attributes:
        opening: its first lines.
        turning_points: all of them, as the robot knew them.
        sections: what happened, by subject.
        milestones: what became of each.
    """

    opening: tuple[str, ...]
    turning_points: tuple[TurningPoint, ...]
    sections: tuple[Story, ...]
    milestones: tuple[MilestoneRow, ...]


def run_name(run: RunDirectory) -> str:
    """``hallway-kidnap, seed 0``; the directory's name where its head cannot be read."""
    head = read_head(run.path)
    name, seed = head.get("name"), head.get("seed")
    if not isinstance(name, str):
        return run.path.resolve().name
    return f"{name}, seed {seed}" if isinstance(seed, int) and head.get("kind") == "simulator" else name


def levels_off(run: RunDirectory) -> Iterator[str]:
    """Which servo levels were switched off, as run.json says; nothing where it does not."""
    head = read_head(run.path)
    try:
        set_since = {key: value == "on" for key, value in head["constants"] if key.startswith("servo.")}
        servo = {**head["servo"], **{key.removeprefix("servo."): is_on for key, is_on in set_since.items()}}
    except (AttributeError, ValueError, KeyError, TypeError):
        return
    for level, is_on in servo.items():
        if is_on is False:
            yield f"The {level} level of servoing was off in this run: {WITHOUT.get(level, 'nobody closed it')}."


def opening(run: RunDirectory, history: Timeline, *, is_short: bool = False) -> Iterator[str]:
    """Which run it is, how it ended, and, unless it is to be short, what went wrong on the way: a story's first lines.

    Raises BadInput where the journal has no decision, or ``result.json`` is malformed.
    """
    history.expect_decisions()
    with reading(history.source):
        outcome = history.last(Outcome)
        cycle = history.cycles[-1] if outcome is None else outcome.cycle
        end = "cut off" if outcome is None else outcome.value.kind
        yield f"{run_name(run)}: {end} in {phrases.moment(history, cycle)}."
        yield from levels_off(run)
        if is_short:
            return
        yield from turn_lines(history, run.read_result(), is_whole=outcome is not None)


def first_lines(path: Path | None) -> tuple[str, ...]:
    """As :func:`opening`, of a run that has just ended; none where it is not on the disk."""
    if path is None:
        return ()
    run = RunDirectory(path)
    return tuple(opening(run, Timeline(run.journal)))


def tell_run(run: RunDirectory, history: Timeline) -> RunStory:
    """The story of a run. Raises BadInput where journal or ``result.json`` cannot be read as this version's."""
    first, result = tuple(opening(run, history)), run.read_result()
    with reading(history.source):
        turns, sections = tuple(read_turning_points(history)), tuple(
            tell_part(history, title, result) for title in PARTS if title != TROUBLE)
        return RunStory(first, turns, sections, read_milestones(history))


def tell_part(history: Timeline, title: str, result: Mapping[str, Any]) -> Story:
    """A part of the story, by its title in PARTS; ``result``: ``result.json``, or nothing."""
    tell, nothing = PARTS[title]
    sentences = list(tell(history, result)) or [Sentence(nothing)] * bool(nothing)
    return Story(title, tuple(
        one if one.cycle is None else replace(one, time_s=history.time_at(one.cycle)) for one in sentences))


def _tell_errand(history: Timeline, _: Mapping[str, Any]) -> Iterator[Sentence]:
    """What was asked for, and what it was told on the way."""
    asked = history.of_kind(Command, UserReport, Redirection)
    return (said(plainly(one), one) for one in asked if one.observed)


def _tell_happenings(history: Timeline, result: Mapping[str, Any]) -> Iterator[Sentence]:
    """What the simulator did to the robot and its building, as far as its result says."""
    yield from _points(read_truth(history, result), SIMULATOR)
    if result.get("happened") is None:
        yield Sentence("What was done to the robot nobody recorded: there is no result of the simulator.")


def _tell_plans(history: Timeline, _: Mapping[str, Any]) -> Iterator[Sentence]:
    """Each goal, each sketch, and each that was withdrawn."""
    for record in history.of_kind(Goal, PlanSketch):
        if text := _plan(history, record):
            yield said(text, record)


def _plan(history: Timeline, record: EntryRecord[Any]) -> str:
    sketch = record.value
    if isinstance(sketch, Goal):
        return plainly(record) if record.is_new or not sketch.is_active else ""
    if record.is_new:
        look = f"to look from elsewhere {_doubted(history, record)}, " if sketch.is_look else ""
        parts = count(len(sketch.subgoals), "part")
        return f"Plan {look}{sketch.where()}, {parts}: to {phrases.steps(sketch.subgoals)}."
    if turning_points.is_adjusted(sketch, record.author):
        return (f"The plan {sketch.where()} was adjusted in part {min(sketch.at + 1, len(sketch.subgoals))} of "
                f"{len(sketch.subgoals)}, as a milestone told where the robot is: to {phrases.steps(sketch.subgoals)}.")
    if sketch.status != "superseded":
        return ""
    causes = listed([cause for ref in record.because if (cause := _cause(history, ref))]) or "it no longer held"
    part = f"in part {sketch.at + 1} of {len(sketch.subgoals)}"
    return f"The plan {sketch.where()} was withdrawn {part}, because of this: {causes}."


def _doubted(history: Timeline, record: EntryRecord[PlanSketch]) -> str:
    """What it hopes to see from there."""
    below = [one for ref in record.because if (one := history.entry(ref)) is not None]
    doors = [f"whether {one.value.door} is shut" for one in below if is_a(one, DoorState)]
    things = [f"whether {one.value.name} is in the way" for one in below if is_a(one, Obstacle)]
    return next(iter((*doors, *things)), "at what leaves no way")


def _cause(history: Timeline, ref: str) -> str:
    """What an entry says that a plan was withdrawn for, in its first clause."""
    record = history.entry(ref)
    if record is None:
        return ""
    if record.kind is Goal:
        asked = history.nearest(record, Redirection)
        return "there was a new goal" if asked is None else f"it {sentence(asked).partition(';')[0]}"
    if record.kind is LocaleFrame:  # the changes of a frame are many; only the cause of the last is given
        record = history.nearest(record, *WHAT_CHANGES) or record
    return sentence(record).partition(";")[0]


def _tell_lost(history: Timeline, _: Mapping[str, Any]) -> Iterator[Sentence]:
    """Each time that it was lost."""
    found = [one for one in history.of_kind(Hypothesis)
             if turning_points.may_turn(one) and turning_points.is_found(one.value)]
    for record in history.of_kind(Discrepancy):
        if turning_points.may_turn(record) and turning_points.is_lost(record.value):
            until = next((one for one in found if one.cycle >= record.cycle), None)
            yield from sorted(_tell_loss(history, record, until), key=lambda one: one.cycle or 0)


def _tell_loss(
    history: Timeline, lost: EntryRecord[Discrepancy], found: EntryRecord[Hypothesis] | None
) -> Iterator[Sentence]:
    what, below = lost.value.what, history.nearest(lost, Hypothesis)
    where = "" if below is None else f" {phrases.believed(below.value)}"
    yield said(f"It was lost: {what}.{where}", lost, below)
    if (certificate := history.nearest(lost, Certificate)) is not None:
        verdict = f"{certificate.value.verdict}: {certificate.value.reason}"
        yield said(f"The last verdict on a milestone was {verdict}.", certificate)
    began = next((one for one in history.within(lost) if is_a(one, Discrepancy) and one.value.what != what), None)
    if began is not None:
        yield said(f"It began to doubt: {began.value.what}.", history.entry(f"{began.id}.0") or began)
    yield from _tell_search(history, lost, history.cycles[-1] if found is None else found.cycle)
    if found is None:
        yield Sentence("It did not find out where it was.", cycle=history.cycles[-1])
        return
    now, then_s, now_s = found.value, history.time_at(lost.cycle), history.time_at(found.cycle)
    later = f"{count(found.cycle - lost.cycle, 'cycle')} later"
    later += "" if then_s is None or now_s is None else f", after {now_s - then_s:.1f} s"
    how = f": {now.evidence}" if now.evidence else ""
    where = f"{phrases.pose(now)}{'' if below is None else _apart(below.value, now)}{how}"
    yield said(f"It found out where it was, {later}: at {where}.", found)


def _tell_search(history: Timeline, lost: EntryRecord[Any], last: int) -> Iterator[Sentence]:
    """How many pictures it took to find itself, and which places came into question."""
    looks = [record for record in history.of_kind(PictureRequest, until=last)
             if record.cycle >= lost.cycle and record.value.purpose == "probe"]
    candidates = [record for record in history.of_kind(Hypothesis, until=last)
                  if record.cycle >= lost.cycle and record.is_new and record.field("status") == "candidate"]
    if not looks and not candidates:
        return
    text = f"To find out where it was it took {count(len(looks), 'picture')}"
    candidates = [one for one in candidates if one.cycle == candidates[-1].cycle]  # what was weighed together last
    if candidates:
        text += f"; in the end it may have stood at {phrases.perhaps(one.value for one in candidates)}"
    first = min((*looks, *candidates), key=lambda record: record.cycle)
    yield said(f"{text}.", first, *candidates)


def _apart(before: Hypothesis, now: Hypothesis) -> str:
    """How far that is from where it had believed to be, where both are in one frame."""
    if before.locale != now.locale:
        return f", and not in {before.locale}"
    return f", {metres(now.locale_from_robot.distance_to(before.locale_from_robot))} from where it had believed"


def _tell_contacts(history: Timeline, result: Mapping[str, Any]) -> Iterator[Sentence]:
    """What it felt; and, where the simulator says so, what it truly touched."""
    yield from _points(read_turning_points(history, main=True), "contact") or [Sentence("It felt no contact.")]
    truly = [point for point in read_truth(history, result) if point.kind == COLLISION]
    yield from (Sentence(f"It truly touched {point.text}.", cycle=point.cycle) for point in truly)
    if result.get("collisions") is None:
        yield Sentence("What it touched without feeling it nobody recorded: there is no result of the simulator.")
    elif (missing := result["collisions"] - len(truly)) > 0:
        yield Sentence(f"The simulator counts {missing} more, and does not say where.")


def _tell_things(history: Timeline, _: Mapping[str, Any]) -> list[Sentence]:
    """Doors found shut, things in the way, and what became of them; what differs else; faults of its body."""
    return _points(read_turning_points(history, main=True), "door", "thing", "differs", "fault", "resumed")


def _points(turns: Iterable[TurningPoint], *kinds: str) -> list[Sentence]:
    """The turning points of some kinds."""
    return [Sentence(f"{capital(point.text)}.", cycle=point.cycle) for point in turns if point.kind in kinds]


def _tell_camera(history: Timeline, _: Mapping[str, Any]) -> Iterator[Sentence]:
    """How the camera turned out to differ from its nominal state: each difference, from when it held to the end."""
    records = list(history.of_kind(CameraState))
    lessons = [find_camera_lessons(records[0].value, record.value) for record in records]
    for lesson in lessons[-1] if lessons else ():
        has_it = [any(one.what == lesson.what for one in then) for then in lessons]
        since = max((i for i, has in enumerate(has_it) if not has), default=-1) + 1
        yield said(f"The {lesson.text()}; known since then.", records[since], records[-1])


def _tell_end(history: Timeline, result: Mapping[str, Any]) -> Iterator[Sentence]:
    """The outcome, the last belief, and the errors that only the simulator knows."""
    if (outcome := history.last(Outcome)) is not None:
        yield said(plainly(outcome), outcome)
    if (last := history.held()) is not None:
        now = history.newest[last.id] == last.ref and history.retraction(last.ref) is None
        text = "It believed that it stood at" if now else "The last place where it had believed to stand was"
        yield said(f"{text} {phrases.pose(last.value)}.", last)
    yield from (Sentence(f"{capital(text)}.") for text in result.get("starved") or ())
    truth = ", ".join(_truth(result))
    yield Sentence(f"In truth, by the simulator's result.json: {truth}." if truth else
                   "Where it truly was nobody recorded: there is no result of the simulator.")


def _truth(result: Mapping[str, Any]) -> Iterator[str]:
    off_m, touched, path_m = (result.get(key) for key in ("final_error_m", "collisions", "path_length_m"))
    if off_m is None:
        return
    yield f"it stood {metres(off_m)} from the goal"
    if path_m is not None:
        yield f"had driven {path_m:.1f} m"
    if touched is not None:
        yield f"had touched something {count(touched, 'time')}" if touched else "had touched nothing"
    wrong = (result.get("milestones") or {}).get("false_accepts")
    if isinstance(wrong, int):
        yield f"and accepted {count(wrong, 'milestone')} wrongly" if wrong else "and accepted no milestone wrongly"


def _tell_trouble(history: Timeline, result: Mapping[str, Any]) -> Iterator[Sentence]:
    """What a short account of the run does not leave out."""
    points = [point for point in read_trouble(history, result) if point.kind != COLLISION]
    yield from (Sentence(f"{point.kind}: {point.text}.", cycle=point.cycle) for point in points)
    if not points:
        yield Sentence("Nothing went wrong." if history.last(Outcome) is not None else
                       "Nothing had gone wrong when the run was cut off.")


TROUBLE, HAPPENED, LOST, TOUCHED, ENDED = (
    "What went wrong", "What was done to it", "Lost and found", "What it touched", "How it ended")
PARTS: Mapping[str, tuple[Callable[[Timeline, Mapping[str, Any]], Iterable[Sentence]], str]] = {
    "What it was to do": (_tell_errand, ""),
    HAPPENED: (_tell_happenings, "The simulator did nothing to it."),
    "How it planned": (_tell_plans, ""),
    LOST: (_tell_lost, "It was never lost."),
    TOUCHED: (_tell_contacts, ""),
    "Doors, things in the way and faults": (
        _tell_things, "No door was found otherwise than known, nothing stood in the way, and nothing failed."),
    "The camera": (_tell_camera, "The camera was found to be as told."),
    ENDED: (_tell_end, ""),
    TROUBLE: (_tell_trouble, ""),
}
"""Each part of a story by its title: what tells it, and what is said where there is nothing to tell."""


def read_milestones(history: Timeline) -> tuple[MilestoneRow, ...]:
    """Every verdict of a run, and every milestone that got none, in the order of time."""
    rows: list[MilestoneRow] = []
    for record in history.of_kind(Certificate):
        c, below = record.value, history.reason(record, Milestone)
        name, ref = (c.milestone, f"{c.milestone}.0") if below is None else (phrases.milestone_of(below), below.ref)
        rows.append(MilestoneRow(
            record.cycle, history.time_at(record.cycle), name, c.verdict, c.expected, c.matched, c.deviation_m,
            c.deviation_rad, c.p_wrong, c.most_p_wrong, (record.ref, ref)))
    judged = {ref.rpartition(".")[0] for row in rows for ref in row.refs}
    rows += [MilestoneRow(one.cycle, history.time_at(one.cycle), phrases.milestone_of(one), str(one.fields["status"]),
                          len(one.fields["expected"]), 0, None, None, None, None, (one.ref,))
             for one in history.last_of_kind(Milestone) if one.id not in judged]
    return tuple(sorted(rows, key=lambda row: row.cycle))


def milestone_lines(rows: Sequence[MilestoneRow]) -> Iterator[str]:
    """The table; of a long run what was not verified, and the newest."""
    if not rows:
        yield "There was none."
        return
    shown = rows
    if len(rows) > MOST_ROWS:
        failed = (row for row in rows if row.verdict != "verified")
        shown = sorted({*failed, *rows[-MOST_ROWS // 2 :]}, key=lambda row: row.cycle)
    if len(shown) < len(rows):
        yield f"Of {len(rows)} these {len(shown)}; --json has them all."
    lines = []
    for row in shown:
        time, *others = row.cells("-")
        lines.append((str(row.cycle), time, row.name, row.verdict, *others))
    yield from table(COLUMNS, lines).splitlines()


def story_lines(story: RunStory) -> Iterator[str]:
    """The page; the milestones stand before how it ended."""
    yield from story.opening
    *before, last = story.sections
    for section in before:
        yield from ("", section.headline, *_section_lines(section))
    yield from ("", MILESTONES, *(f"  {line}" for line in milestone_lines(story.milestones)))
    yield from ("", last.headline, *_section_lines(last))
    yield from ("", LEGEND)


def _section_lines(section: Story) -> Iterator[str]:
    heads = ["" if one.cycle is None else turning_points.at(one.cycle, one.time_s) for one in section.steps]
    width = max(map(len, heads), default=0)
    for head, one in zip(heads, section.steps, strict=True):
        yield wrap(named(one.text, one.refs), f"  {head:<{width}}" + "  " * (width > 0))
