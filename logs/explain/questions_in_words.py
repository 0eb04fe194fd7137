"""Questions in words: of what was in the way, why it stopped or took a detour, whether a door is shut, what it thought
and how surely; and of the whole run: when was it lost, where did it touch anything, how far off was it in truth.

A question is known by a word of it. It asks for entries of some kinds, each explained down to the pixels, or for
a part of the run's story.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from difflib import SequenceMatcher
from itertools import groupby
from typing import Any, NamedTuple

from logs.explain import phrases
from logs.explain.in_short import tell_end, tell_round, tell_sureness, tell_thoughts
from logs.explain.phrases import Sentence, Story, describe_decision, headline, plainly, said, sentence
from logs.explain.story import ENDED, HAPPENED, LOST, TOUCHED, TROUBLE, tell_part
from logs.explain.true_errors import read_errors
from logs.explain.why import label_of
from logs.records import EntryRecord, is_a
from logs.run_directory import RunDirectory
from logs.run_errors import BadInput
from logs.timeline import Timeline
from world_models.building.locale_frame import LocaleFrame
from world_models.entries import (
    CameraPicture,
    Command,
    Contact,
    Difference,
    DoorState,
    Leg,
    MotorCommand,
    Obstacle,
    Outcome,
    PlanSketch,
    Ranges,
    Redirection,
    Subgoal,
    UserReport,
)
from world_models.plugins import QUESTIONS_GROUP, load_plugins
from world_models.words import count, metres

MOST_STORIES = 6
"""Most obstacles, stops or doors that are named, the newest."""
MOST_SIGHTS = 4
"""Most revisions of an obstacle that are named, the newest."""
CHANGED: tuple[type[Any], ...] = (Obstacle, LocaleFrame, DoorState, Contact, UserReport, Redirection)
"""What a plan may be withdrawn for, the most telling first."""
BEYOND = 3.0
"""An error of more standard deviations is given in them."""
Record = EntryRecord[Any]


class Asked(NamedTuple):
    """A question about a run, as it was known in the cycle ``at``, or at its end where that is None."""

    history: Timeline
    question: str
    at: int | None
    run: RunDirectory | None


Answer = Callable[[Asked], Iterator[Story]]
Known = tuple[frozenset[str], Answer]
"""Which words in a question mean it, and what answers."""


def is_question(text: str) -> bool:
    """Whether a name is meant as a question: names of entries and of parts of a building have no blanks."""
    return " " in text.strip() or text.endswith("?")


def answers(
    history: Timeline, question: str, at: int | None = None, run: RunDirectory | None = None
) -> Iterator[Story]:
    """The answer's stories; with ``at`` as it was known in that cycle; ``run`` tells what only the simulator knows.

    Raises BadInput where it is none of the questions that are known, or what it takes is not recorded.
    """
    asked = set(re.findall(r"[^\W_](?:[\w'/.-]*\w)?", question.lower()))
    asked |= {"gap"} if "not" in asked and asked & ROUND else set()  # why not round it: there was no room
    known = {**_find_more(history), **KNOWN}
    meant = next((answer for words, answer in known.values() if words & asked), None)
    foreign = _find_foreign(history, asked.difference(*(words for words, _ in known.values())))
    if meant is None or foreign:
        heard = f"; {', '.join(map(repr, foreign[:3]))} said nothing" if foreign else ""
        near = sorted(known, key=lambda one: -_likeness(asked & known[one][0], question, one))[:NEAREST]
        raise BadInput(f"expected a question as {', '.join(map(repr, near))}, got {question!r}{heard}")
    return meant(Asked(history, question.lower(), at, run))


def _find_more(history: Timeline) -> Mapping[str, Known]:
    """The questions that other packages answer of this run."""
    return {name: known for find in load_plugins(QUESTIONS_GROUP, Callable).values()  # type: ignore[arg-type]
            for name, known in find(history).items()}


def _find_foreign(history: Timeline, asked: set[str]) -> list[str]:
    """Of words of a question that nobody understands those that are no names of the building."""
    left = sorted(asked.difference(FILLERS))
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


def _likeness(decide: Set[str], question: str, known: str) -> float:
    """How near a question is to one that is known: by the words that decide, then by its letters."""
    return len(decide) + SequenceMatcher(None, question.lower(), known).ratio()


def _entries(
    tell: Callable[[Asked, list[Record]], Iterator[Story]], nothing: str, *kinds: type[Any],
    where: Callable[[Record], bool] = lambda _: True,
) -> Answer:
    """A question for entries of some kinds: the newest of their stories; where there is none, what is then so."""
    def answer(asked: Asked) -> Iterator[Story]:
        records = [one for kind in kinds for one in asked.history.of_kind(kind, until=asked.at) if where(one)]
        stories = list(tell(asked, records))
        if not stories:
            yield Story(nothing if asked.at is None else f"Up to cycle {asked.at}: {nothing[0].lower()}{nothing[1:]}")
        if len(stories) > MOST_STORIES:
            yield Story(f"Of {len(stories)}, the last {MOST_STORIES} are told here.")
        yield from stories[-MOST_STORIES:]
    return answer


def _part(title: str, nothing: str) -> Answer:
    """A question for a part of the run's story; ``nothing`` is so where it has nothing up to a cycle."""
    def answer(asked: Asked) -> Iterator[Story]:
        part = tell_part(asked.history, title, {} if asked.run is None else asked.run.read_result())
        kept = [one for one in part.steps if asked.at is None or (one.cycle is not None and one.cycle <= asked.at)]
        for one in kept:
            when = "" if one.cycle is None else f"In {phrases.moment(asked.history, one.cycle)}: "
            yield Story(f"{when}{one.text}", ref=one.refs[0] if one.refs else "")
        if not kept:
            yield Story(nothing)
    return answer


def _tell_error(asked: Asked) -> Iterator[Story]:
    """In a cycle; else at the end, at its worst, and when it was first further off than it was sure."""
    source = "As only the simulator knows, by the run's recording."
    if asked.run is None:
        raise BadInput("expected a run with its recording, which alone has the truth, got only its journal")
    if asked.at is not None:
        asked.history.decision(asked.at)
    errors = read_errors(asked.run, asked.history, asked.at)
    if not errors:
        text = "It had no belief that could be compared with the truth." if asked.at is None else (
            f"In cycle {asked.at} it had no belief, or had not moved yet.")
        yield Story(text, decided=source)
        return
    last, worst = errors[-1], max(errors, key=lambda error: error.off_m)
    if asked.at is not None:
        yield Story(f"In cycle {asked.at} it stood {last.words()}.", (), last.ref, source)
        return
    steps = [Sentence(f"In cycle {worst.cycle} it stood {worst.words()}.", (worst.ref,), label="worst")]
    if beyond := [one for one in errors if one.sigmas > BEYOND]:
        text = (f"In {len(beyond)} of {len(errors)} beliefs it was off by more than {BEYOND:.0f} sigma, first in cycle"
                f" {beyond[0].cycle}: {beyond[0].words()}.")
        steps.append(Sentence(text, (beyond[0].ref,), label="beyond"))
    yield Story(f"At the end, in cycle {last.cycle}, it stood {last.words()}.", tuple(steps), last.ref, source)


def _story(asked: Asked, record: Record, head: str, steps: Iterable[Sentence] = ()) -> Story:
    return Story(head, tuple(steps), record.ref, describe_decision(asked.history, record))


def _by_entry(records: list[Record]) -> list[list[Record]]:
    """The revisions of each entry, in the order in which the entries came about."""
    found = dict[str, list[Record]]()
    for record in records:
        found.setdefault(record.id, []).append(record)
    return list(found.values())


def _tell_things(asked: Asked, records: list[Record]) -> Iterator[Story]:
    """Each thing in the way, as it was known last, and how it came to be known."""
    for revisions in _by_entry(records):
        last = revisions[-1]
        about = [one for one in asked.history.of_kind(Difference, until=asked.at) if one.value.about == last.value.name]
        rivals = [said(plainly(one), one, label="rivals") for one in about[-1:]]
        steps = (*_tell_sights(asked.history, revisions), *rivals, *_tell_consequences(asked, last.value.name))
        yield _story(asked, last, headline(last), steps)


def _tell_differences(asked: Asked, records: list[Record]) -> Iterator[Story]:
    """What differs, its rivals with their odds, and by what evidence these came about."""
    for revisions in _by_entry(records):
        shown = [said(f"In cycle {one.cycle}: {one.value.counted[-1].shows}; {one.value.odds_in_words()}.", one,
                      label="evidence") for one in revisions[-MOST_SIGHTS:]]
        yield _story(asked, revisions[-1], headline(revisions[-1]), shown)


def _tell_sights(history: Timeline, revisions: list[Record]) -> Iterator[Sentence]:
    """When it was seen, and by which pixels; of equal evidence the first."""
    kept: dict[tuple[str, str], Record] = {}
    for record in revisions:
        kept.setdefault((record.value.status, record.value.evidence), record)
    for (status, evidence), record in [*kept.items()][-MOST_SIGHTS:]:
        by = history.nearest(record, CameraPicture, Ranges, Contact)
        text = (f"In cycle {record.cycle} it was {status}, certainty {record.value.certainty:.2f}"
                f"{': ' * bool(evidence)}{evidence}.")
        yield Sentence(text, (record.ref, *record.because, *((by.ref,) if by is not None else ())), label="evidence")


def _tell_consequences(asked: Asked, name: str) -> Iterator[Sentence]:
    """Since when the frame of its locale had it, and whether a plan was withdrawn for that."""
    has_it = False
    for record in asked.history.frames(until=asked.at):
        had, has_it = has_it, has_it or any(change.name == name for change in record.value.changes)
        if has_it and not had:
            yield said(f"What is known of {record.value.locale} had it from cycle {record.cycle} on.", record,
                       label="known")
            for sketch in asked.history.of_kind(PlanSketch, until=asked.at):
                if record.ref in sketch.because and sketch.field("status") == "superseded":
                    yield said(f"For that a plan was withdrawn in cycle {sketch.cycle}.", sketch, label="plan")


def _is_stop(record: Record) -> bool:
    """Whether a leg was broken off, the robot crept, or turned to see floor."""
    if is_a(record, Leg):
        return record.value.status == "halted" or record.value.looking_rad is not None
    if is_a(record, MotorCommand):
        return record.value.is_creeping
    return record.kind is Contact or record.value.kind != "reached"


def _tell_stops(asked: Asked, records: list[Record]) -> Iterator[Story]:
    """With ``at`` the last stop and its reasons; else how the run ended, if not at its goal, and the last stops."""
    stops = sorted(records, key=lambda record: record.cycle)
    if asked.run is not None and asked.at is None and stops and stops[-1].kind is Outcome:
        yield tell_end(asked.run, asked.history)
        del stops[:-2], stops[-1]
    elif len(stops) > 1 and asked.at is None:
        yield Story(f"It stopped or crept {count(len(stops), 'time')}; of one more is told by --at CYCLE.", tuple(
            Sentence(_say_stop(record), (record.ref,), record.cycle) for record in stops[-MOST_STORIES:]))
        return
    for record in stops[-1:]:
        steps = () if asked.run is not None and asked.at is None else _tell_reasons(asked.history, record)
        yield _story(asked, record, _say_stop(record), steps)


def _say_stop(record: Record) -> str:
    how = {Leg: " it stopped to look at floor that it had not seen yet",
           MotorCommand: " it crept, as not all of the floor that it was to drive over was seen to be free"}
    if record.field("status") == "halted" and is_a(record, Leg):
        return f"In cycle {record.cycle} a leg was broken off."
    return f"In cycle {record.cycle}{how.get(record.kind, '')}: {sentence(record)}."


def _tell_reasons(history: Timeline, record: Record) -> Iterator[Sentence]:
    """What it rests on; then the nearest obstacle, door or contact below, and the picture that showed it."""
    for ref in record.because:
        below = history.entry(ref)
        if below is not None and below.kind is not record.kind:
            yield said(plainly(below), below, label=label_of(below))
    for kind in CHANGED:
        found = history.nearest(record, kind)
        if found is None or found is record or found.ref in record.because:
            continue
        if not is_a(found, LocaleFrame) or found.value.changes:
            picture = history.nearest(found, CameraPicture, Ranges) if kind in (Obstacle, DoorState) else None
            yield said(plainly(found), found, picture, label=label_of(found))


def _tell_doors_or_what_for(asked: Asked, records: list[Record]) -> Iterator[Story]:
    """Whether doors are shut; asked why a door is taken, first what for, then the plan that leads through it."""
    plans = [one for one in asked.history.of_kind(PlanSketch, until=asked.at)
             if not one.value.path and any(part.passage for part in one.value.subgoals[one.value.at:])]
    if "why" not in asked.question or "shut" in asked.question or not plans:
        yield from _tell_doors(asked, records)
        return
    last, ahead = plans[-1], plans[-1].value.subgoals[plans[-1].value.at:]
    what_for: Record | None = asked.history.nearest(last, Redirection) or asked.history.nearest(last, Command)
    text = f"So it is to go to {phrases.steps(ahead)}."
    yield _story(asked, last, plainly(what_for or last), (said(text, last, what_for, label="plan"),))


def _is_changed_plan(record: Record) -> bool:
    """Whether a plan was withdrawn because the building differs."""
    heads = tuple(f"{kind.__name__}-" for kind in CHANGED)
    return record.field("status") == "superseded" and any(ref.startswith(heads) for ref in record.because)


def _tell_detours(asked: Asked, records: list[Record]) -> Iterator[Story]:
    """Each plan that was withdrawn; of those that were withdrawn together the most detailed."""
    for cycle, together in groupby(records, key=lambda record: record.cycle):
        old = max(together, key=lambda record: len(record.value.path))
        head = f"In cycle {cycle} it planned another way {old.value.where()}."
        yield _story(asked, old, head, _compare_plans(asked, old))


def _compare_plans(asked: Asked, old: EntryRecord[PlanSketch]) -> Iterator[Sentence]:
    """The plan before, what lay between, and the plan after."""
    history, ahead = asked.history, old.value.subgoals[old.value.at:]
    yield said(f"It was to go to {phrases.steps(ahead) or 'where it stood'}.", old, label="before")
    for one in _tell_reasons(history, old):
        found = next((record for ref in one.refs if is_a(record := history.entry(ref), Obstacle)), None)
        beside = "" if found is None else _beside(ahead, found.value)
        yield Sentence(f"{one.text.rstrip('.')}{beside}.", one.refs, label="between")
    later = [one for one in history.of_kind(PlanSketch, until=asked.at) if one.cycle > old.cycle and one.is_new]
    new = next((one for one in later if one.value.locale == old.value.locale), next(iter(later), None))
    yield said("No other way was planned." if new is None else
               f"In cycle {new.cycle} it was to go to {phrases.steps(new.value.subgoals)}.", new, label="after")


def _beside(ahead: Sequence[Subgoal], thing: Obstacle) -> str:
    """How far from the line of a plan the middle of a thing is; "" where none of it is in its locale."""
    from shapely import LineString, Point

    middle = Point(thing.x_m, thing.y_m)
    lines = [(LineString([(one.origin.x_m, one.origin.y_m), (one.destination.x_m, one.destination.y_m)]), one)
             for one in ahead if one.origin.locale == one.destination.locale == thing.locale]
    if not lines:
        return ""
    off_m, one = min(((line.distance(middle), one) for line, one in lines), key=lambda pair: pair[0])
    return (f"; its middle is {metres(off_m)} from the line of that plan, from {one.origin.words()} to"
            f" {one.destination.words()}")


def _tell_doors(asked: Asked, records: list[Record]) -> Iterator[Story]:
    """Each door that pictures were asked about, or those that the question names."""
    doors = _by_entry(records)
    named = [revisions for revisions in doors if revisions[-1].value.door in asked.question]
    others = [name for name in sorted(_find_passages(asked.history)) if name in asked.question]
    if others and not named:
        yield Story(f"No picture was judged to tell whether {others[0]} is shut.")
        return
    for revisions in named or doors:
        last = revisions[-1]
        yield _story(asked, last, headline(last), map(_tell_door, revisions[-MOST_SIGHTS:]))
    kept = [] if doors else [record for record in asked.history.frames(until=asked.at)
                             if any(change.what == "shut" for change in record.value.changes)]
    yield from (_story(asked, record, headline(record)) for record in kept[-1:])


def _tell_door(record: EntryRecord[DoorState]) -> Sentence:
    state = record.value
    left, top, right, bottom = state.last.box_px
    box = f"pixels ({left:.0f}, {top:.0f}) to ({right:.0f}, {bottom:.0f})"
    is_shut = f"{state.certainty:.1%} sure that it is {'shut' if state.log_odds > 0.0 else 'open'}"
    text = (f"In cycle {record.cycle} {state.last.frame}, {box}, showed {state.last.shows}: {is_shut}, by"
            f" {count(state.pictures, 'picture')}.")
    return Sentence(text, (record.ref, *record.because), label="evidence")


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


ROUND, ROUND_GAP = _words("round around past by through between"), _words("gap fit squeeze")
KNOWN: Mapping[str, Known] = {
    "what went wrong?": (_words("wrong trouble happened"), _part(TROUBLE, "Up to then nothing had gone wrong.")),
    "what was done to it?": (_words("done simulator bumped carried"),
                             _part(HAPPENED, "Up to then the simulator did nothing to it.")),
    "how did it end?": (
        _words("end ended ends outcome finish finished"), _part(ENDED, "Up to then it had not ended.")),
    "when was it lost?": (_words("lost"), _part(LOST, "Up to then it was not lost.")),
    "where did it touch anything?": (
        _words("touch touched contact contacts collide collided collision collisions hit"),
        _part(TOUCHED, "Up to then it touched nothing.")),
    "how far off was it?": (_words("far off truth truly error"), _tell_error),
    "does a sense lie?": (
        _words("sense senses lie lies differs differ difference differences rival rivals odds"),
        _entries(_tell_differences, "Nothing was found to differ from model, belief or senses.", Difference)),
    "why not round it?": (ROUND_GAP, lambda asked: tell_round(asked.run, asked.history, asked.at)),
    "why that detour?": (
        _words("detour detours round around another other else withdrawn replan replanned instead"),
        _entries(_tell_detours, "It took no detour: no plan was withdrawn for anything in the way.", PlanSketch,
                 where=_is_changed_plan)),
    "why did you stop?": (
        _words("stop stopped stops creep slow wait"),
        _entries(_tell_stops, "It did not stop on a leg, and crept nowhere.", Leg, MotorCommand, Contact, Outcome,
                 where=_is_stop)),
    "is the door shut?": (
        _words("door doors shut open closed ajar"),
        _entries(_tell_doors_or_what_for, "No picture was judged to tell whether a door is shut.", DoorState)),
    "what is in the way?": (
        _words("way obstacle obstacles there"),
        _entries(_tell_things, "Nothing that the model lacks was found in the way.", Obstacle)),
    "how sure was it?": (
        _words("sure surely certain confident sigma"), lambda asked: tell_sureness(asked.run, asked.history, asked.at)),
    "what did it think?": (
        _words("think thought believe believed know known"),
        lambda asked: tell_thoughts(asked.run, asked.history, asked.at)),
}
"""A question as somebody may ask it; of several that are meant, the first."""
QUESTIONS = tuple(KNOWN)
FILLERS = _words(
    "a all along always and any anything anywhere are at be been before by can cannot cycle did "
    "do does drive driven drove ever find first for found from get go goes going gone got had halt halted has "
    "have held her his how i in into is it its keep kept last leave left let long many me mission "
    "model much my never new no not now of often old on once one only or out over plan planned plans position "
    "pose really robot room run say see seen so some somebody something stand standing still such take taken tell "
    "than that the their them then thing things they this time times to took true turn turned twice "
    "up us very was way we went were what when where whether which who why will with would you your"
)
"""Words that decide nothing."""
NEAREST = 4
"""So many questions are named to who asked another one."""
