"""Questions in words: what is in the way, why it stopped, why it took a detour, whether a door is shut.

A question is known by a word of it. Its answer is a story for each thing, stop, detour or door, down to the pixels.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping

from harvey.errors import BadInput
from harvey.run_files.records import EntryRecord
from harvey.why.decisions import describe_decision
from harvey.why.history import History
from harvey.why.links import nearest
from harvey.why.model.frames import reference_of
from harvey.why.sentences import sentence, value_of
from harvey.why.story import LABELS, Step, Story, headline
from world_models.entries.body import MotorCommand
from world_models.entries.door_state import DoorState
from world_models.entries.obstacle import Obstacle
from world_models.entries.task import Leg, Outcome
from world_models.words import count

OF_THE_RUN = ("when was it lost?", "where did it touch anything?", "how far off was it?")
"""Questions that :mod:`harvey.story.questions` answers."""
QUESTIONS = ("what is in the way?", "why did you stop?", "why that detour?", "is the door shut?", *OF_THE_RUN)
MOST_STORIES = 6
"""So many things, stops or doors are told of, the newest."""
MOST_SIGHTS = 4
"""So many revisions of a thing are told of, the newest."""
CHANGED = ("Obstacle", "LocaleFrame", "DoorState", "Contact", "Told", "Redirection")
"""What a plan may be withdrawn for, the most telling first."""


def is_question(text: str) -> bool:
    """Whether a name is meant as a question: names of entries and of parts of a building have no blanks."""
    return " " in text.strip() or text.endswith("?")


def answers(history: History, question: str, at: int | None = None) -> Iterator[Story]:
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


def _by_id(records: Iterable[EntryRecord]) -> Mapping[str, list[EntryRecord]]:
    found: dict[str, list[EntryRecord]] = {}
    for record in records:
        found.setdefault(record.id, []).append(record)
    return found


def _tell_way(history: History, question: str, at: int | None) -> Iterator[Story]:
    """Each thing in the way, as it was known last, and how it came to be known."""
    del question
    things = _by_id(history.of_kind("Obstacle", until=at))
    for revisions in things.values():
        last = revisions[-1]
        yield Story(last.ref, headline(last), describe_decision(history, last), (
            *_tell_sights(history, revisions), *_tell_consequences(history, value_of(last, Obstacle).name, at)))
    if not things:
        yield _nothing("Nothing that the model lacks was found in the way.", at)


def _tell_sights(history: History, revisions: list[EntryRecord]) -> Iterator[Step]:
    """When it was seen, and by which pixels; of equal evidence the first."""
    told: dict[tuple[str, str], EntryRecord] = {}
    for record in revisions:
        thing = value_of(record, Obstacle)
        told.setdefault((thing.status, thing.evidence), record)
    for (status, evidence), record in [*told.items()][-MOST_SIGHTS:]:
        by = nearest(history, record, ("Frame", "Ranges", "Contact"))
        text = (f"In cycle {record.cycle} it was {status}, certainty {value_of(record, Obstacle).certainty:.2f}"
                f"{': ' * bool(evidence)}{evidence}.")
        yield Step("evidence", text, (record.ref, *record.because, *((by.ref,) if by is not None else ())))


def _tell_consequences(history: History, name: str, at: int | None) -> Iterator[Step]:
    """Since when the frame of its locale had it, and whether a plan was withdrawn for that."""
    has_it = False
    for record in history.of_kind("LocaleFrame", until=at):
        reference = reference_of(record)
        now = any(change.name == name for change in reference.changes)
        if now and not has_it:
            text = f"What is known of {reference.locale} had it from cycle {record.cycle} on."
            yield Step("known", text, (record.ref,))
            for sketch in history.of_kind("PlanSketch", until=at):
                if record.ref in sketch.because and _is_superseded(sketch):
                    yield Step("plan", f"For that a plan was withdrawn in cycle {sketch.cycle}.", (sketch.ref,))
        has_it |= now


def _is_superseded(record: EntryRecord) -> bool:
    return isinstance(record.value, dict) and record.value.get("status") == "superseded"


def _tell_stops(history: History, question: str, at: int | None) -> Iterator[Story]:
    """Each time that a leg was broken off, that the robot crept, or turned to see floor; with ``at`` the last."""
    del question
    stops = [record for kind in ("Leg", "MotorCommand", "Contact", "Outcome")
             for record in history.of_kind(kind, until=at) if _is_stop(record)]
    stops.sort(key=lambda record: record.cycle)
    for record in stops if at is None else stops[-1:]:
        yield Story(record.ref, _describe_stop(record), describe_decision(history, record),
                    tuple(_tell_reasons(history, record)))
    if not stops:
        yield _nothing("It did not stop on a leg, and crept nowhere.", at)


def _is_stop(record: EntryRecord) -> bool:
    if record.type == "Leg":
        leg = value_of(record, Leg)
        return leg.status == "halted" or leg.looking_rad is not None
    if record.type == "MotorCommand":
        return value_of(record, MotorCommand).speed_m_per_s is not None
    return record.type == "Contact" or value_of(record, Outcome).kind != "reached"


def _describe_stop(record: EntryRecord) -> str:
    said = sentence(record)
    if record.type == "Leg":
        halted = value_of(record, Leg).status == "halted"
        return f"In cycle {record.cycle} a leg was broken off." if halted else (
            f"In cycle {record.cycle} it stopped to look at floor that it had not seen yet: {said}.")
    if record.type == "MotorCommand":
        return f"In cycle {record.cycle} it crept, as it could not see the floor before it: {said}."
    return f"In cycle {record.cycle}: {said}."


def _tell_reasons(history: History, record: EntryRecord) -> Iterator[Step]:
    """What it rests on, and what was known of things and doors."""
    for ref in record.because:
        below = history.entry(ref)
        if below is not None and below.type != record.type:
            yield Step(LABELS.get(below.type, below.type), _said(below), (below.ref,))
    yield from _tell_pixels(history, record)


def _tell_pixels(history: History, record: EntryRecord) -> Iterator[Step]:
    """The nearest thing, door or contact below, and the picture that told of it."""
    for kind in CHANGED:
        found = nearest(history, record, (kind,))
        if found is None or found is record or found.ref in record.because:
            continue
        if found.type == "LocaleFrame" and not reference_of(found).changes:
            continue
        frame = nearest(history, found, ("Frame", "Ranges"))
        picture = () if frame is None or kind not in ("Obstacle", "DoorState") else (frame.ref,)
        yield Step(LABELS.get(kind, kind), _said(found), (found.ref, *picture))


def _tell_detours(history: History, question: str, at: int | None) -> Iterator[Story]:
    """Each plan that was withdrawn because the building is otherwise, and what was planned instead."""
    del question
    sketches = list(history.of_kind("PlanSketch", until=at))
    detours = [one for one in sketches if _is_superseded(one) and any(
        ref.partition("-")[0] in CHANGED for ref in one.because)]
    cycles: dict[int, EntryRecord] = {}
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


def _tell_doors(history: History, question: str, at: int | None) -> Iterator[Story]:
    """Each door that pictures were asked about, or those that the question names."""
    doors = _by_id(history.of_kind("DoorState", until=at))
    named = {id: revisions for id, revisions in doors.items()
             if value_of(revisions[-1], DoorState).door in question.lower()}
    for revisions in (named or doors).values():
        last = revisions[-1]
        steps = []
        for record in revisions[-MOST_SIGHTS:]:
            state = value_of(record, DoorState)
            left, top, right, bottom = state.last.box_px
            box = f"pixels ({left:.0f}, {top:.0f}) to ({right:.0f}, {bottom:.0f})"
            text = (f"In cycle {record.cycle} {state.last.frame}, {box}, showed {state.last.shows}:"
                    f" {state.state}, certainty {state.certainty:.3f} by {count(state.pictures, 'picture')}.")
            steps.append(Step("evidence", text, (record.ref, *record.because)))
        yield Story(last.ref, headline(last), describe_decision(history, last), tuple(steps))
    told = [record for record in history.of_kind("LocaleFrame", until=at)
            if any(change.what == "shut" for change in reference_of(record).changes)]
    if not doors and told:
        yield Story(told[-1].ref, headline(told[-1]), describe_decision(history, told[-1]), ())
    elif not doors:
        yield _nothing("No picture was judged to tell whether a door is shut.", at)


def _said(record: EntryRecord) -> str:
    text = sentence(record)
    return f"{text[:1].upper()}{text[1:]}."


def _nothing(text: str, at: int | None) -> Story:
    return Story("", text if at is None else f"Up to cycle {at}: {text[0].lower()}{text[1:]}", "", ())


Answer = Callable[[History, str, int | None], Iterator[Story]]
ANSWERS: Mapping[frozenset[str], Answer] = {
    frozenset({"detour", "detours", "round", "around"}): _tell_detours,
    frozenset({"stop", "stopped", "stops", "creep", "slow", "wait"}): _tell_stops,
    frozenset({"door", "doors", "shut", "open", "closed", "ajar"}): _tell_doors,
    frozenset({"way", "obstacle", "obstacles", "there"}): _tell_way,
}
"""By words of the question; the first that fits."""
