"""Questions in words: of what was in the way, why it stopped or took a detour, whether a door is shut; and of the whole
run: when was it lost, where did it touch anything, how far off was it in truth.

A question is known by a word of it. Its answer is a story for each thing, stop, detour or door, down to the pixels.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from itertools import groupby
from typing import Any

from logs.explain import phrases
from logs.explain.phrases import plainly, sentence
from logs.explain.story import Section, Sentence, tell_contacts, tell_end, tell_happenings, tell_lost
from logs.explain.turning_points import read_happenings, read_turning_points
from logs.explain.why import Step, Story, headline, label_of, step, story_of
from logs.records import EntryRecord, is_a
from logs.run_directory import RunDirectory
from logs.run_errors import BadInput
from logs.timeline import Timeline
from world_models.building.locale_frame import LocaleFrame
from world_models.entries.body import CameraPicture, MotorCommand
from world_models.entries.door_state import DoorState
from world_models.entries.location import Hypothesis
from world_models.entries.obstacle import Contact, Obstacle, Ranges
from world_models.entries.task import Leg, Outcome, PlanSketch, Subgoal
from world_models.entries.user_reports import Redirection, UserReport
from world_models.frames import Pose2, wrap_angle
from world_models.words import count, degrees, metres

QUESTIONS = ("what is in the way?", "why did you stop?", "why that detour?", "is the door shut?", "when was it lost?",
             "where did it touch anything?", "how far off was it?", "what was done to it?", "what went wrong?",
             "how did it end?")
MOST_STORIES = 6
"""So many things, stops or doors are told of, the newest."""
MOST_SIGHTS = 4
"""So many revisions of a thing are told of, the newest."""
CHANGED: tuple[type[Any], ...] = (Obstacle, LocaleFrame, DoorState, Contact, UserReport, Redirection)
"""What a plan may be withdrawn for, the most telling first."""
STOPS: tuple[type[Any], ...] = (Leg, MotorCommand, Contact, Outcome)
"""What tells of a stop."""
BEYOND = 3.0
"""An error of more standard deviations is told as that."""


def is_question(text: str) -> bool:
    """Whether a name is meant as a question: names of entries and of parts of a building have no blanks."""
    return " " in text.strip() or text.endswith("?")


@dataclass(frozen=True, slots=True)
class Asked:
    """A question about a run, as it was known in the cycle ``at``, or at its end."""

    run: RunDirectory | None
    history: Timeline
    question: str
    at: int | None

    def newest(self, stories: Sequence[Story], nothing: str) -> Iterator[Story]:
        """The newest of some stories; where there is none, what is then so."""
        if not stories:
            yield Story("", nothing if self.at is None else f"Up to cycle {self.at}: {nothing[0].lower()}{nothing[1:]}",
                        "", ())
        if len(stories) > MOST_STORIES:
            yield Story("", f"Of {len(stories)}, the last {MOST_STORIES} are told here.", "", ())
        yield from stories[-MOST_STORIES:]

    def by_entry(self, kind: type[Any]) -> list[list[EntryRecord[Any]]]:
        """The revisions of each entry of a kind until then."""
        number = {id: number for number, id in enumerate(self.history.ids_of(kind))}
        records = sorted(self.history.of_kind(kind, until=self.at), key=lambda record: number[record.id])
        return [list(revisions) for _, revisions in groupby(records, key=lambda record: record.id)]


def answers(
    history: Timeline, question: str, at: int | None = None, run: RunDirectory | None = None
) -> Iterator[Story]:
    """The answer's stories; with ``at`` as it was known in that cycle; ``run`` tells what only the simulator knows.

    Raises BadInput where it is none of the questions that are known, or what it takes is not recorded.
    """
    asked = set(re.findall(r"[^\W_](?:[\w'/.-]*\w)?", question.lower()))
    for words, answer in ANSWERS.items():
        if asked & words and not (foreign := _find_foreign(history, asked)):
            return answer(Asked(run, history, question, at))
    heard = f"; {', '.join(map(repr, foreign[:3]))} said nothing" if (foreign := _find_foreign(history, asked)) else ""
    near = sorted(QUESTIONS, key=lambda one: -_likeness(asked, question, one))[:NEAREST]
    raise BadInput(f"expected a question as {', '.join(map(repr, near))}, got {question!r}{heard}")


def _find_foreign(history: Timeline, asked: set[str]) -> list[str]:
    """The words of a question that are neither of those that are understood nor names of the building."""
    left = sorted(asked - KEYWORDS - FILLERS)
    if not left:
        return []
    names = {record.value.locale for record in history.frames()}
    names |= {record.value.door for record in history.of_kind(DoorState)}
    names |= {record.value.name for record in history.of_kind(Obstacle)} | _find_passages(history)
    known = names | {part for name in names for part in re.split(r"[-/]", name)}
    return [word for word in left if word not in known and not word.isdigit()]


def _find_passages(history: Timeline) -> set[str]:
    """The doors and rides through which any plan led."""
    return {part.passage for record in history.of_kind(PlanSketch) for part in record.value.subgoals} - {""}


def _likeness(asked: set[str], question: str, known: str) -> float:
    """How near a question is to one that is known: by the words that decide, then by its letters."""
    words = set(re.findall(r"[a-z]+", known))
    group = next((group for group in ANSWERS if words & group), frozenset[str]())
    return len(asked & group) + SequenceMatcher(None, question.lower(), known).ratio()


def _tell_way(asked: Asked) -> Iterator[Story]:
    """Each thing in the way, as it was known last, and how it came to be known."""
    history = asked.history
    stories = [story_of(history, last := revisions[-1], headline(last), (
        *_tell_sights(history, revisions), *_tell_consequences(history, last.value.name, asked.at)))
        for revisions in asked.by_entry(Obstacle)]
    yield from asked.newest(stories, "Nothing that the model lacks was found in the way.")


def _tell_sights(history: Timeline, revisions: list[EntryRecord[Any]]) -> Iterator[Step]:
    """When it was seen, and by which pixels; of equal evidence the first."""
    told: dict[tuple[str, str], EntryRecord[Any]] = {}
    for record in revisions:
        told.setdefault((record.value.status, record.value.evidence), record)
    for (status, evidence), record in [*told.items()][-MOST_SIGHTS:]:
        by = history.nearest(record, CameraPicture, Ranges, Contact)
        text = (f"In cycle {record.cycle} it was {status}, certainty {record.value.certainty:.2f}"
                f"{': ' * bool(evidence)}{evidence}.")
        yield Step("evidence", text, (record.ref, *record.because, *((by.ref,) if by is not None else ())))


def _tell_consequences(history: Timeline, name: str, at: int | None) -> Iterator[Step]:
    """Since when the frame of its locale had it, and whether a plan was withdrawn for that."""
    has_it = False
    for record in history.frames(until=at):
        had, has_it = has_it, has_it or any(change.name == name for change in record.value.changes)
        if has_it and not had:
            text = f"What is known of {record.value.locale} had it from cycle {record.cycle} on."
            yield step("known", text, record)
            for sketch in history.of_kind(PlanSketch, until=at):
                if record.ref in sketch.because and sketch.field("status") == "superseded":
                    yield step("plan", f"For that a plan was withdrawn in cycle {sketch.cycle}.", sketch)


def _tell_stops(asked: Asked) -> Iterator[Story]:
    """Each time that a leg was broken off, that the robot crept, or turned to see floor; with ``at`` the last."""
    history = asked.history
    stops = [record for kind in STOPS for record in history.of_kind(kind, until=asked.at) if _is_stop(record)]
    stops.sort(key=lambda record: record.cycle)
    stories = [story_of(history, record, f"In cycle {record.cycle}{_describe_stop(record)}.",
                        _tell_reasons(history, record)) for record in (stops if asked.at is None else stops[-1:])]
    yield from asked.newest(stories, "It did not stop on a leg, and crept nowhere.")


def _is_stop(record: EntryRecord[Any]) -> bool:
    if is_a(record, Leg):
        return record.value.status == "halted" or record.value.looking_rad is not None
    if is_a(record, MotorCommand):
        return record.value.is_creeping
    return record.kind is Contact or record.value.kind != "reached"


def _describe_stop(record: EntryRecord[Any]) -> str:
    if is_a(record, Leg) and record.value.status == "halted":
        return " a leg was broken off"
    how = {Leg: " it stopped to look at floor that it had not seen yet",
           MotorCommand: " it crept, as it could not see the floor before it"}.get(record.kind, "")
    return f"{how}: {sentence(record)}"


def _tell_reasons(history: Timeline, record: EntryRecord[Any]) -> Iterator[Step]:
    """What it rests on; then the nearest thing, door or contact below, and the picture that told of it."""
    for ref in record.because:
        below = history.entry(ref)
        if below is not None and below.kind is not record.kind:
            yield step(label_of(below), plainly(below), below)
    for kind in CHANGED:
        found = history.nearest(record, kind)
        if found is None or found is record or found.ref in record.because:
            continue
        if not is_a(found, LocaleFrame) or found.value.changes:
            picture = history.nearest(found, CameraPicture, Ranges) if kind in (Obstacle, DoorState) else None
            yield step(label_of(found), plainly(found), found, picture)


def _tell_detours(asked: Asked) -> Iterator[Story]:
    """Each plan that was withdrawn because the building is otherwise: before, what lay between, and after."""
    history, heads = asked.history, tuple(f"{kind.__name__}-" for kind in CHANGED)
    sketches, withdrawn = list(history.of_kind(PlanSketch, until=asked.at)), dict[int, EntryRecord[PlanSketch]]()
    for one in sketches:
        if one.field("status") == "superseded" and any(ref.startswith(heads) for ref in one.because):
            known = withdrawn.get(one.cycle)
            if known is None or len(one.value.path) > len(known.value.path):
                withdrawn[one.cycle] = one  # the most detailed of those that were withdrawn together
    stories = [story_of(history, one, f"In cycle {cycle} it planned another way {one.value.where()}.",
                        _compare_plans(history, one, sketches)) for cycle, one in withdrawn.items()]
    yield from asked.newest(stories, "It took no detour: no plan was withdrawn for anything in the way.")


def _compare_plans(
    history: Timeline, old: EntryRecord[PlanSketch], sketches: Sequence[EntryRecord[PlanSketch]]
) -> Iterator[Step]:
    ahead = old.value.subgoals[old.value.at:]
    yield step("before", f"It was to go to {phrases.steps(ahead) or 'where it stood'}.", old)
    for one in _tell_reasons(history, old):
        found = next((record for ref in one.refs if is_a(record := history.entry(ref), Obstacle)), None)
        beside = "" if found is None else _beside(ahead, found.value)
        yield Step("between", f"{one.text.rstrip('.')}{beside}.", one.refs)
    later = [s for s in sketches if s.cycle > old.cycle and s.is_new]
    new = next((s for s in later if s.value.locale == old.value.locale), next(iter(later), None))
    if new is None:
        yield Step("after", "No other way was planned.", ())
    else:
        yield step("after", f"In cycle {new.cycle} it was to go to {phrases.steps(new.value.subgoals)}.", new)


def _beside(ahead: Sequence[Subgoal], thing: Obstacle) -> str:
    """How far from the line of a plan the middle of a thing is; "" where none of it is in its locale."""
    lines = [(one.origin, one.destination) for one in ahead
             if one.origin.locale == one.destination.locale == thing.locale]
    if not lines:
        return ""
    off_m, (a, b) = min(((_distance_m(a.x_m, a.y_m, b.x_m, b.y_m, thing), (a, b)) for a, b in lines),
                        key=lambda pair: pair[0])
    return f"; its middle is {metres(off_m)} from the line of that plan, from {a.words()} to {b.words()}"


def _distance_m(x0: float, y0: float, x1: float, y1: float, thing: Obstacle) -> float:
    dx, dy = x1 - x0, y1 - y0
    long2 = dx * dx + dy * dy
    part = 0.0 if long2 == 0.0 else min(max(((thing.x_m - x0) * dx + (thing.y_m - y0) * dy) / long2, 0.0), 1.0)
    return math.hypot(thing.x_m - x0 - part * dx, thing.y_m - y0 - part * dy)


def _tell_doors(asked: Asked) -> Iterator[Story]:
    """Each door that pictures were asked about, or those that the question names."""
    history, doors = asked.history, asked.by_entry(DoorState)
    named = [revisions for revisions in doors if revisions[-1].value.door in asked.question.lower()]
    stories = [story_of(history, revisions[-1], headline(revisions[-1]), map(_tell_door, revisions[-MOST_SIGHTS:]))
               for revisions in named or doors]
    others = [name for name in sorted(_find_passages(history)) if name in asked.question.lower()]
    if others and not named:
        yield Story("", f"No picture was judged to tell whether {others[0]} is shut.", "", ())
        return
    told = [] if doors else [record for record in history.frames(until=asked.at)
                             if any(change.what == "shut" for change in record.value.changes)]
    stories += [story_of(history, record, headline(record)) for record in told[-1:]]
    yield from asked.newest(stories, "No picture was judged to tell whether a door is shut.")


def _tell_door(record: EntryRecord[DoorState]) -> Step:
    state = record.value
    left, top, right, bottom = state.last.box_px
    box = f"pixels ({left:.0f}, {top:.0f}) to ({right:.0f}, {bottom:.0f})"
    text = (f"In cycle {record.cycle} {state.last.frame}, {box}, showed {state.last.shows}: {state.state}, certainty"
            f" {state.certainty:.3f} by {count(state.pictures, 'picture')}.")
    return Step("evidence", text, (record.ref, *record.because))


def _tell_touched(asked: Asked) -> Iterator[Story]:
    result = {} if asked.run is None else asked.run.read_result()
    section = tell_contacts(asked.history, tuple(read_turning_points(asked.history)), result)
    yield from _stories(section, asked.at, "Up to then it touched nothing.")


def _tell_happenings(asked: Asked) -> Iterator[Story]:
    result = {} if asked.run is None else asked.run.read_result()
    return _stories(tell_happenings(asked.history, result), asked.at, "Up to then the simulator did nothing to it.")


def _tell_trouble(asked: Asked) -> Iterator[Story]:
    """What a short account of the run does not leave out."""
    result = {} if asked.run is None else asked.run.read_result()
    points = [*read_happenings(asked.history, result), *read_turning_points(asked.history, told=True)]
    told = [Sentence(f"{point.kind}: {point.text}.", point.cycle, point.time_s)
            for point in sorted(points, key=lambda point: point.cycle)]
    is_whole = any(True for _ in asked.history.of_kind(Outcome))
    nothing = "Nothing went wrong." if is_whole else "Nothing had gone wrong when the run was cut off."
    return _stories(Section("", tuple(told)), asked.at, nothing)


def _tell_end(asked: Asked) -> Iterator[Story]:
    result = {} if asked.run is None else asked.run.read_result()
    return _stories(tell_end(asked.history, result), asked.at, "Up to then it had not ended.")


def _stories(section: Section, at: int | None, nothing: str) -> Iterator[Story]:
    told = [one for one in section.sentences if at is None or (one.cycle is not None and one.cycle <= at)]
    for one in told:
        when = "" if one.cycle is None else f"In cycle {one.cycle}" + (
            ": " if one.time_s is None else f", {one.time_s:.1f} s into the run: ")
        yield Story(one.refs[0] if one.refs else "", f"{when}{one.text}", "", ())
    if not told:
        yield Story("", nothing, "", ())


def _tell_error(asked: Asked) -> Iterator[Story]:
    """In a cycle; else at the end, at its worst, and when it was first further off than it was sure."""
    source, run, history = "As only the simulator knows, by the run's recording.", asked.run, asked.history
    if run is None:
        raise BadInput("expected a run with its recording, which alone has the truth, got only its journal")
    if asked.at is not None:
        history.decision(asked.at)
        error = error_at(run, history, asked.at)
        text = "it had no belief, or had not moved yet" if error is None else f"it stood {error.words()}"
        yield Story("" if error is None else error.ref, f"In cycle {asked.at} {text}.", source, ())
        return
    errors = read_errors(run, history)
    if not errors:
        yield Story("", "It had no belief that could be held against the truth.", source, ())
        return
    worst, last = max(errors, key=lambda error: error.off_m), errors[-1]
    steps = [Step("worst", f"In cycle {worst.cycle} it stood {worst.words()}.", (worst.ref,))]
    if beyond := [one for one in errors if one.sigmas > BEYOND]:
        steps.append(Step("beyond", f"In {len(beyond)} of {len(errors)} beliefs it was off by more than {BEYOND:.0f}"
                                    f" sigma, first in cycle {beyond[0].cycle}: {beyond[0].words()}.",
                          (beyond[0].ref,)))
    yield Story(last.ref, f"At the end, in cycle {last.cycle}, it stood {last.words()}.", source, tuple(steps))


ANSWERS: Mapping[frozenset[str], Callable[[Asked], Iterator[Story]]] = {
    frozenset({"wrong", "trouble", "happened"}): _tell_trouble,
    frozenset({"done", "simulator", "bumped", "carried"}): _tell_happenings,
    frozenset({"end", "ended", "ends", "outcome", "finish", "finished"}): _tell_end,
    frozenset({"lost"}): lambda asked: _stories(tell_lost(asked.history), asked.at, "Up to then it was not lost."),
    frozenset({"touch", "touched", "contact", "contacts", "collide", "collided", "collision", "collisions", "hit"}):
        _tell_touched,
    frozenset({"far", "off", "truth", "truly", "error"}): _tell_error,
    frozenset({"detour", "detours", "round", "around", "another", "other", "else", "withdrawn", "replan", "replanned",
               "instead"}): _tell_detours,
    frozenset({"stop", "stopped", "stops", "creep", "slow", "wait"}): _tell_stops,
    frozenset({"door", "doors", "shut", "open", "closed", "ajar"}): _tell_doors,
    frozenset({"way", "obstacle", "obstacles", "there"}): _tell_way,
}
"""By words of the question; the first that fits."""
KEYWORDS = frozenset[str]().union(*ANSWERS)
FILLERS = frozenset(re.findall("[a-z]+", (
    "a all along always and any anything anywhere are at be been before believe believed by can cannot cycle did "
    "do does drive driven drove ever find first for found from get go goes going gone got had halt halted has "
    "have held her his how i in into is it its keep kept know known last leave left let long many me mission "
    "model much my never new no not now of often old on once one only or out over plan planned plans position "
    "pose really robot room run say see seen so some somebody something stand standing still such take taken tell "
    "than that the their them then thing things think thought they this time times to took true turn turned twice "
    "up us very was way we went were what when where whether which who why will with would you your "
)))
"""Words that decide nothing."""
NEAREST = 4
"""So many questions are named to who asked another one."""


@dataclass(frozen=True, slots=True)
class TrueError:
    """The belief that was held in a cycle against the truth.

    Attributes:
        off_m, off_rad: distance and turn from the true pose to the believed one.
        sigma_m, sigma_rad: how sure the belief was; of the place the largest standard deviation.
        ref: the belief.
    """

    cycle: int
    off_m: float
    off_rad: float
    sigma_m: float
    sigma_rad: float
    ref: str

    @property
    def sigmas(self) -> float:
        """The error of the place in standard deviations."""
        return self.off_m / self.sigma_m if self.sigma_m > 0.0 else math.inf

    def words(self) -> str:
        """``63 mm and 0.1 degrees from where it believed to be (by its own reckoning within 10 mm ...)``."""
        sure = f"by its own reckoning within {metres(self.sigma_m)} and {degrees(self.sigma_rad)}, one sigma"
        return f"{metres(self.off_m)} and {degrees(abs(self.off_rad))} from where it believed to be ({sure})"


def read_errors(run: RunDirectory, history: Timeline) -> tuple[TrueError, ...]:
    """The error of each belief that was held, in the order of time, against the truth in the cycle in which it came.

    Raises BadInput where it is not a run of the simulator, or it has no recording, or its world's file has changed.
    """
    return tuple(_errors(run, history))


def error_at(run: RunDirectory, history: Timeline, cycle: int) -> TrueError | None:
    """The error in a cycle, also where the belief is older; None before the first. Raises BadInput as above."""
    return next(iter([*_errors(run, history, cycle)][-1:]), None)


def _errors(run: RunDirectory, history: Timeline, at: int | None = None) -> Iterator[TrueError]:
    from logs.reader import read_true_track  # an explanation starts fast only where no world is imported
    from logs.run_head import SIMULATOR, RunHead

    head = RunHead.read(run.path)
    if head.kind != SIMULATOR:
        raise BadInput(f"{run.path}: expected a run of the simulator, which alone knows the truth, got one on hardware")
    if not run.recording.is_file():
        raise BadInput(f"{run.path}: expected its recording, where the truth is, got none (harvey repair {run.path}"
                       " draws it)")
    world, track = head.load_world(), read_true_track(run.recording)
    records = [one for one in history.of_kind(Hypothesis, until=at) if not one.is_gone and one.value.is_held]
    for record in records[-1:] if at is not None else records:
        value, cycle = record.value, record.cycle if at is None else at
        before = bisect_right(track, cycle, key=lambda moment: moment[0])  # it is recorded whenever it has moved
        if before:
            believed, true = value.world_from_robot(world), Pose2(*track[before - 1][1:])
            yield TrueError(cycle, believed.distance_to(true), wrap_angle(believed.heading_rad - true.heading_rad),
                            value.sigma_m, value.sigma_rad, record.ref)
