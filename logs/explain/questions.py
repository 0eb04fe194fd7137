"""Questions in words: of what was in the way, why it stopped or took a detour, whether a door is shut; and of the whole
run: when was it lost, where did it touch anything, how far off was it in truth.

A question is known by a word of it. Its answer is a story for each thing, stop, detour or door, down to the pixels.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from logs.errors import BadInput
from logs.explain.model import reference_of
from logs.explain.phrases import capital, describe_decision, sentence
from logs.explain.story import Section, tell_contacts, tell_lost
from logs.explain.turning_points import read_turning_points
from logs.explain.why import LABELS, Step, Story, headline
from logs.records import EntryRecord
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from world_models.building.locale_frame import LocaleFrame
from world_models.entries.body import Frame, MotorCommand
from world_models.entries.door_state import DoorState
from world_models.entries.location import Hypothesis
from world_models.entries.obstacle import Contact, Obstacle, Ranges
from world_models.entries.task import Leg, Outcome, PlanSketch
from world_models.entries.told import Redirection, Told
from world_models.frames import Pose2, wrap_angle
from world_models.words import count, degrees, metres

OF_THE_RUN = ("when was it lost?", "where did it touch anything?", "how far off was it?")
"""Questions that :func:`answers_of_the_run` answers."""
QUESTIONS = ("what is in the way?", "why did you stop?", "why that detour?", "is the door shut?", *OF_THE_RUN)
MOST_STORIES = 6
"""So many things, stops or doors are told of, the newest."""
MOST_SIGHTS = 4
"""So many revisions of a thing are told of, the newest."""
CHANGED: tuple[type[Any], ...] = (Obstacle, LocaleFrame, DoorState, Contact, Told, Redirection)
"""What a plan may be withdrawn for, the most telling first."""


STOPS: tuple[type[Any], ...] = (Leg, MotorCommand, Contact, Outcome)
"""What tells of a stop."""


def is_question(text: str) -> bool:
    """Whether a name is meant as a question: names of entries and of parts of a building have no blanks."""
    return " " in text.strip() or text.endswith("?")


def answers(history: Timeline, question: str, at: int | None = None) -> Iterator[Story]:
    """The answer's stories; with ``at`` as it was known in that cycle.

    Raises:
        BadInput: it is none of the questions that are known.
    """
    asked = set(re.findall(r"[a-z]+", question.lower()))
    for words, answer in ANSWERS.items():
        if asked & words:
            found = list(answer(history, question, at))
            told = found[-MOST_STORIES:]
            if len(told) < len(found):
                yield Story("", f"Of {len(found)}, the last {len(told)} are told here.", "", ())
            yield from told
            return
    known = ", ".join(f"'{one}'" for one in QUESTIONS)
    raise BadInput(f"expected a question as {known}, got {question!r}")


def _by_id(records: Iterable[EntryRecord[Any]]) -> Mapping[str, list[EntryRecord[Any]]]:
    found: dict[str, list[EntryRecord[Any]]] = {}
    for record in records:
        found.setdefault(record.id, []).append(record)
    return found


def _tell_way(history: Timeline, question: str, at: int | None) -> Iterator[Story]:
    """Each thing in the way, as it was known last, and how it came to be known."""
    del question
    things = _by_id(history.of_kind(Obstacle, until=at))
    for revisions in things.values():
        last = revisions[-1]
        yield Story(last.ref, headline(last), describe_decision(history, last), (
            *_tell_sights(history, revisions), *_tell_consequences(history, last.value.name, at)))
    if not things:
        yield _nothing("Nothing that the model lacks was found in the way.", at)


def _tell_sights(history: Timeline, revisions: list[EntryRecord[Any]]) -> Iterator[Step]:
    """When it was seen, and by which pixels; of equal evidence the first."""
    told: dict[tuple[str, str], EntryRecord[Any]] = {}
    for record in revisions:
        thing = record.value
        told.setdefault((thing.status, thing.evidence), record)
    for (status, evidence), record in [*told.items()][-MOST_SIGHTS:]:
        by = history.nearest(record, Frame, Ranges, Contact)
        text = (f"In cycle {record.cycle} it was {status}, certainty {record.value.certainty:.2f}"
                f"{': ' * bool(evidence)}{evidence}.")
        yield Step("evidence", text, (record.ref, *record.because, *((by.ref,) if by is not None else ())))


def _tell_consequences(history: Timeline, name: str, at: int | None) -> Iterator[Step]:
    """Since when the frame of its locale had it, and whether a plan was withdrawn for that."""
    has_it = False
    for record in history.of_kind(LocaleFrame, until=at):
        reference = reference_of(record)
        now = any(change.name == name for change in reference.changes)
        if now and not has_it:
            text = f"What is known of {reference.locale} had it from cycle {record.cycle} on."
            yield Step("known", text, (record.ref,))
            for sketch in history.of_kind(PlanSketch, until=at):
                if record.ref in sketch.because and _is_superseded(sketch):
                    yield Step("plan", f"For that a plan was withdrawn in cycle {sketch.cycle}.", (sketch.ref,))
        has_it |= now


def _is_superseded(record: EntryRecord[Any]) -> bool:
    return isinstance(record.fields, dict) and record.fields.get("status") == "superseded"


def _tell_stops(history: Timeline, question: str, at: int | None) -> Iterator[Story]:
    """Each time that a leg was broken off, that the robot crept, or turned to see floor; with ``at`` the last."""
    del question
    stops = [record for kind in STOPS
             for record in history.of_kind(kind, until=at) if _is_stop(record)]
    stops.sort(key=lambda record: record.cycle)
    for record in stops if at is None else stops[-1:]:
        yield Story(record.ref, _describe_stop(record), describe_decision(history, record),
                    tuple(_tell_reasons(history, record)))
    if not stops:
        yield _nothing("It did not stop on a leg, and crept nowhere.", at)


def _is_stop(record: EntryRecord[Any]) -> bool:
    if record.kind is Leg:
        leg = record.value
        return leg.status == "halted" or leg.looking_rad is not None
    if record.kind is MotorCommand:
        return record.value.speed_m_per_s is not None
    return record.kind is Contact or record.value.kind != "reached"


def _describe_stop(record: EntryRecord[Any]) -> str:
    said = sentence(record)
    if record.kind is Leg:
        halted = record.value.status == "halted"
        return f"In cycle {record.cycle} a leg was broken off." if halted else (
            f"In cycle {record.cycle} it stopped to look at floor that it had not seen yet: {said}.")
    if record.kind is MotorCommand:
        return f"In cycle {record.cycle} it crept, as it could not see the floor before it: {said}."
    return f"In cycle {record.cycle}: {said}."


def _tell_reasons(history: Timeline, record: EntryRecord[Any]) -> Iterator[Step]:
    """What it rests on, and what was known of things and doors."""
    for ref in record.because:
        below = history.entry(ref)
        if below is not None and below.kind is not record.kind:
            yield Step(LABELS.get(below.kind, below.type), _said(below), (below.ref,))
    yield from _tell_pixels(history, record)


def _tell_pixels(history: Timeline, record: EntryRecord[Any]) -> Iterator[Step]:
    """The nearest thing, door or contact below, and the picture that told of it."""
    for kind in CHANGED:
        found = history.nearest(record, kind)
        if found is None or found is record or found.ref in record.because:
            continue
        if found.kind is LocaleFrame and not reference_of(found).changes:
            continue
        frame = history.nearest(found, Frame, Ranges)
        picture = () if frame is None or kind not in (Obstacle, DoorState) else (frame.ref,)
        yield Step(LABELS.get(kind, kind.__name__), _said(found), (found.ref, *picture))


def _tell_detours(history: Timeline, question: str, at: int | None) -> Iterator[Story]:
    """Each plan that was withdrawn because the building is otherwise, and what was planned instead."""
    del question
    sketches = list(history.of_kind(PlanSketch, until=at))
    detours = [one for one in sketches if _is_superseded(one) and any(
        ref.startswith(tuple(f"{kind.__name__}-" for kind in CHANGED)) for ref in one.because)]
    cycles: dict[int, EntryRecord[Any]] = {}
    for one in detours:
        cycles.setdefault(one.cycle, one)
    for cycle, one in cycles.items():
        new = next((s for s in sketches if s.cycle > cycle and s.ref.endswith(".0")), None)
        steps = [*_tell_reasons(history, one)]
        if new is not None:
            steps.append(Step("instead", _said(new), (new.ref,)))
        text = f"In cycle {cycle} its plan was withdrawn: {sentence(one)}."
        yield Story(one.ref, text, describe_decision(history, one), tuple(steps))
    if not detours:
        yield _nothing("It took no detour: no plan was withdrawn for anything in the way.", at)


def _tell_doors(history: Timeline, question: str, at: int | None) -> Iterator[Story]:
    """Each door that pictures were asked about, or those that the question names."""
    doors = _by_id(history.of_kind(DoorState, until=at))
    named = {id: revisions for id, revisions in doors.items()
             if revisions[-1].value.door in question.lower()}
    for revisions in (named or doors).values():
        last = revisions[-1]
        steps = []
        for record in revisions[-MOST_SIGHTS:]:
            state = record.value
            left, top, right, bottom = state.last.box_px
            box = f"pixels ({left:.0f}, {top:.0f}) to ({right:.0f}, {bottom:.0f})"
            text = (f"In cycle {record.cycle} {state.last.frame}, {box}, showed {state.last.shows}:"
                    f" {state.state}, certainty {state.certainty:.3f} by {count(state.pictures, 'picture')}.")
            steps.append(Step("evidence", text, (record.ref, *record.because)))
        yield Story(last.ref, headline(last), describe_decision(history, last), tuple(steps))
    told = [record for record in history.of_kind(LocaleFrame, until=at)
            if any(change.what == "shut" for change in reference_of(record).changes)]
    if not doors and told:
        yield Story(told[-1].ref, headline(told[-1]), describe_decision(history, told[-1]), ())
    elif not doors:
        yield _nothing("No picture was judged to tell whether a door is shut.", at)


def _said(record: EntryRecord[Any]) -> str:
    return f"{capital(sentence(record))}."


def _nothing(text: str, at: int | None) -> Story:
    return Story("", text if at is None else f"Up to cycle {at}: {text[0].lower()}{text[1:]}", "", ())


Answer = Callable[[Timeline, str, int | None], Iterator[Story]]
ANSWERS: Mapping[frozenset[str], Answer] = {
    frozenset({"detour", "detours", "round", "around"}): _tell_detours,
    frozenset({"stop", "stopped", "stops", "creep", "slow", "wait"}): _tell_stops,
    frozenset({"door", "doors", "shut", "open", "closed", "ajar"}): _tell_doors,
    frozenset({"way", "obstacle", "obstacles", "there"}): _tell_way,
}
"""By words of the question; the first that fits."""


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

    def words(self) -> str:
        """``63 mm and 0.1 degrees from where it believed to be (sure to 10 mm and 0.1 degrees)``."""
        sure = f"sure to {metres(self.sigma_m)} and {degrees(self.sigma_rad)}"
        return f"{metres(self.off_m)} and {degrees(abs(self.off_rad))} from where it believed to be ({sure})"


def read_errors(run: RunDirectory, history: Timeline) -> tuple[TrueError, ...]:
    """The error of each belief that was held, in the order of time, against the truth in the cycle in which it came.

    Raises:
        BadInput: it is not a run of the simulator, or it has no recording, or its world's file has changed.
    """
    return tuple(_errors(run, history))


def error_at(run: RunDirectory, history: Timeline, cycle: int) -> TrueError | None:
    """The error in a cycle, also where the belief is older; None before the first. Raises BadInput as above."""
    found = [*_errors(run, history, cycle)]
    return found[-1] if found else None


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
    records = [(record, value) for record in history.of_kind(Hypothesis, until=at)
               if not record.is_gone and (value := record.value).is_held]
    for record, value in records[-1:] if at is not None else records:
        cycle = record.cycle if at is None else at
        true = _pose_at(track, cycle)
        if true is not None:
            believed = value.world_from_robot(world)
            yield TrueError(cycle, believed.distance_to(true), wrap_angle(believed.heading_rad - true.heading_rad),
                            value.sigma_m, value.sigma_rad, record.ref)


def _pose_at(track: Sequence[tuple[int, float, float, float]], cycle: int) -> Pose2 | None:
    """Where the robot truly was in a cycle: it is recorded whenever it has moved."""
    before = bisect_right(track, cycle, key=lambda moment: moment[0])
    return Pose2(*track[before - 1][1:]) if before else None


def sigmas(error: TrueError) -> float:
    """The error of the place in standard deviations."""
    return error.off_m / error.sigma_m if error.sigma_m > 0.0 else math.inf


BEYOND = 3.0
"""An error of more standard deviations is told as that."""


def answers_of_the_run(
    run: RunDirectory, history: Timeline, question: str, at: int | None = None
) -> list[Story] | None:
    """The answer's stories, of ``how far off`` in the cycle ``at``, else up to then; None where it is another question.

    Raises:
        BadInput: what it takes is not recorded.
    """
    asked = set(re.findall(r"[a-z]+", question.lower()))
    answer = next((answer for words, answer in OF_WHOLE_RUN.items() if asked & words), None)
    return None if answer is None else list(answer(run, history, at))


def _tell_lost(run: RunDirectory, history: Timeline, at: int | None) -> Iterator[Story]:
    del run
    yield from _stories(tell_lost(history), at, "Up to then it was not lost.")


def _tell_touched(run: RunDirectory, history: Timeline, at: int | None) -> Iterator[Story]:
    section = tell_contacts(history, tuple(read_turning_points(history)), run.read_result())
    yield from _stories(section, at, "Up to then it touched nothing.")


def _stories(section: Section, at: int | None, nothing: str) -> Iterator[Story]:
    told = [one for one in section.sentences if at is None or (one.cycle is not None and one.cycle <= at)]
    for one in told:
        when = "" if one.cycle is None else f"In cycle {one.cycle}" + (
            ": " if one.time_s is None else f", {one.time_s:.1f} s into the run: ")
        yield Story(one.refs[0] if one.refs else "", f"{when}{one.text}", "", ())
    if not told:
        yield Story("", nothing, "", ())


def _tell_error(run: RunDirectory, history: Timeline, at: int | None) -> Iterator[Story]:
    """In a cycle; else at the end, at its worst, and when it was first further off than it was sure."""
    source = "As only the simulator knows, by the run's recording."
    if at is not None:
        history.decision(at)
        error = error_at(run, history, at)
        text = "it had no belief, or had not moved yet" if error is None else f"it stood {error.words()}"
        yield Story("" if error is None else error.ref, f"In cycle {at} {text}.", source, ())
        return
    errors = read_errors(run, history)
    if not errors:
        yield Story("", "It had no belief that could be held against the truth.", source, ())
        return
    worst, beyond = max(errors, key=lambda error: error.off_m), [one for one in errors if sigmas(one) > BEYOND]
    steps = [Step("worst", f"In cycle {worst.cycle} it stood {worst.words()}.", (worst.ref,))]
    if beyond:
        first = beyond[0]
        steps.append(Step("beyond", f"In {len(beyond)} of {len(errors)} beliefs it was off by more than {BEYOND:.0f}"
                                    f" sigma, first in cycle {first.cycle}: {first.words()}.", (first.ref,)))
    yield Story(errors[-1].ref, f"At the end, in cycle {errors[-1].cycle}, it stood {errors[-1].words()}.", source,
                tuple(steps))


RunAnswer = Callable[[RunDirectory, Timeline, int | None], Iterator[Story]]
OF_WHOLE_RUN: Mapping[frozenset[str], RunAnswer] = {
    frozenset({"lost"}): _tell_lost,
    frozenset({"touch", "touched", "contact", "contacts", "collide", "collided", "collision", "collisions", "hit"}):
        _tell_touched,
    frozenset({"far", "off", "truth", "truly", "error"}): _tell_error,
}
"""By words of the question; the first that fits."""
