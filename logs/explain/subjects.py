"""The story of a milestone, and of a part of the building: a landmark, a door, a thing or a room."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator
from typing import Any

from blackboard.servoing import Discrepancy
from logs.errors import BadInput
from logs.explain import phrases
from logs.explain.model import MAX_LISTED, WorldFile, reference_of, tell_changes, tell_model_lines, tell_source
from logs.explain.phrases import STRANGE, describe_decision, sentence
from logs.explain.web import find_refs
from logs.explain.why import Step, Story, tell_stories
from logs.records import WHAT_IF, EntryRecord
from logs.timeline import Timeline
from world_models import words
from world_models.building.locale_frame import FrameRequest, LocaleFrame
from world_models.entries.body import Frame
from world_models.entries.location import Hypothesis
from world_models.entries.percepts import LineMatch, PoseFix, Segments
from world_models.entries.task import Certificate, Milestone, PlanSketch
from world_models.words import count, landmark, listed

FOLLOWED = (Certificate, Milestone, Discrepancy)
"""The entries of a verdict; what they wake is what follows."""

REVISIONS = 8
"""So many revisions of a milestone are looked at for its verdict."""
MOST_NAMED = 12
"""So many milestones are named where none is similar."""


def milestones(history: Timeline, name: str) -> tuple[str, ...]:
    """Ids of the milestones that a user means: ``Milestone-10``, ``M1 of hallway``, ``M1``, ``check``.

    Raises:
        BadInput: there is none of that name; near ones are listed.
    """
    ids = history.ids_of(Milestone)
    low = name.lower()
    if exact := [id for id in ids if low in (id.lower(), history.newest[id].lower(), id.rpartition("-")[2])]:
        return tuple(exact)
    called = {id: _name_of(history, id) for id in ids}
    found = tuple(id for id, what in called.items() if _means(low, what.lower()))
    if not found:
        history.verify()
        there = list(dict.fromkeys(what.partition(", because")[0] for what in called.values()))
        near = difflib.get_close_matches(name, there, n=4, cutoff=0.4) or there[:MOST_NAMED]
        more = f" ... ({len(there)} in all)" if len(near) == MOST_NAMED < len(there) else ""
        known = f"{', '.join(near)}{more}" if near else "of which there are none"
        raise BadInput(f"--milestone: expected a milestone of the run, {known}, got {name!r}")
    return found


def _name_of(history: Timeline, id: str) -> str:
    value = _last(history, id).fields
    return str(value.get("what", "")) if isinstance(value, dict) else ""


def _means(low: str, what: str) -> bool:
    return what == low or what.startswith((low + " ", low + ",")) or (" " in low and low in what)


def _last(history: Timeline, id: str) -> EntryRecord[Any]:
    found = history.entry(history.newest[id])
    if found is None:
        raise BadInput(f"{id}: expected it in the journal, which says nothing of it")
    return found


def milestone_story(history: Timeline, id: str, world: WorldFile | None = None) -> Story:
    """Everything about one milestone, in the order in which it happened.

    Args:
        world: tells from which file and line model lines come; None where that is not asked for.

    Raises:
        BadInput: its entries have other fields than those known here.
    """
    last = _last(history, id)
    try:
        return _story(history, id, last, world)
    except STRANGE as error:
        what = "expected a milestone and its evidence as this version writes them, got others"
        raise BadInput(f"{id}: {what} ({error!r})") from None


def _story(history: Timeline, id: str, last: EntryRecord[Any], world: WorldFile | None) -> Story:
    revisions = [record for number in range(REVISIONS) if (record := history.entry(f"{id}.{number}")) is not None]
    first = revisions[0] if revisions else last
    verdicts = (history.reason(record, Certificate) for record in reversed(revisions))
    certificate = next((found for found in verdicts if found is not None), None)
    steps = [*_tell_origin(history, first), *_tell_expectation(history, last, certificate)]
    if certificate is not None:
        steps += _tell_verdict(history, certificate, world)
        steps += _tell_consequences(history, certificate)
    elif last.fields["status"] != "withdrawn":
        steps.append(Step("judged", f"It was never judged: when the run ended it was {last.fields['status']}.",
                          (last.ref,)))
    if last.fields["status"] == "withdrawn":
        steps += _tell_withdrawal(history, last)
    name = phrases.milestone_name(last.value)
    head = f"{name[0].upper()}{name[1:]}: {last.fields['status']}."
    return Story(last.ref, head, describe_decision(history, first), tuple(steps))


def _tell_withdrawal(history: Timeline, last: EntryRecord[Any]) -> Iterator[Step]:
    yield Step("withdrawn", f"The {words.source(last.author)} withdrew it in cycle {last.cycle}.", (last.ref,))
    yield from (Step("changed", text, (frame.ref,)) for text, frame in tell_changes(history, last))


def _tell_origin(history: Timeline, first: EntryRecord[Any]) -> Iterator[Step]:
    doubt, sketch = history.reason(first, Discrepancy), history.reason(first, PlanSketch)
    if doubt is not None:
        yield Step("wanted", phrases.doubt(doubt.value), (doubt.ref,))
    if sketch is not None:
        yield Step("wanted", phrases.plan(sketch.value), (sketch.ref,))


def _tell_expectation(
    history: Timeline, last: EntryRecord[Any], certificate: EntryRecord[Any] | None
) -> Iterator[Step]:
    judged = None if certificate is None else history.reason(certificate, Milestone)
    looked = judged or last
    belief = history.reason(looked, Hypothesis)
    if belief is not None:
        pose = phrases.pose(belief.value)
        yield Step("believed", f"It believed that it stood at {pose}.", (belief.ref,))
    yield Step("expected", phrases.expectation(looked.value), (looked.ref,))


def _tell_verdict(history: Timeline, certificate: EntryRecord[Any], world: WorldFile | None) -> Iterator[Step]:
    fix, milestone = history.reason(certificate, PoseFix), history.reason(certificate, Milestone)
    match = None if fix is None else history.reason(fix, LineMatch)
    segments = None if match is None else history.reason(match, Segments)
    frame = None if segments is None else history.reason(segments, Frame)
    if fix is not None:
        refs = tuple(r.ref for r in (fix, match, segments, frame) if r is not None)
        yield Step("seen", phrases.describe_line_match(history, fix), refs)
        yield from (Step("model", *told) for told in tell_model_lines(history, fix, world))
    judged = None if milestone is None else milestone.value
    said = phrases.verdict(certificate.value, judged)
    yield Step("judged", said[0].upper() + said[1:], (certificate.ref,))


def _tell_consequences(history: Timeline, certificate: EntryRecord[Any]) -> Iterator[Step]:
    """What those did whom the verdict woke."""
    for record in history.written_by(certificate.cycle):
        if record.kind not in FOLLOWED:
            continue
        for decision in history.naming(record.ref):
            if decision.chosen is None or decision.chosen.trigger != record.ref:
                continue
            said = "; ".join(f"{r.ref}: {sentence(r)}" for r in decision.made if r.kind is not Discrepancy)
            text = said or "; ".join(sentence(r) for r in decision.made) or decision.refused or "nothing came of it"
            who = words.source(decision.chosen.source)
            yield Step("followed", f"In cycle {decision.cycle} the {who} acted: {text}.", (record.ref,))


ENTRY = re.compile(r"[A-Z]\w*-\d+(\.\d+)?")
"""What names of entries look like."""
MAX_MILESTONES = 8
"""So many milestones are told one by one."""


def is_element(history: Timeline, text: str) -> bool:
    """Whether a name is meant for a part of the building and not for an entry of the run."""
    return history.find(text) is None and ENTRY.fullmatch(text) is None


def stories_of(history: Timeline, what: str | int | None, world: WorldFile) -> Iterator[Story]:
    """The story of an entry or a part of the building (by name), of a cycle (by number), or of the outcome (None).

    The outcome's is to come fast: it does not ask the world from which lines model lines come.

    Raises:
        BadInput: the run has none of that name; near ones are listed.
    """
    if isinstance(what, str) and is_element(history, what):
        yield element_story(history, what, world)
    else:
        yield from tell_stories(history, find_refs(history, what), None if what is None else world)


def element_story(history: Timeline, name: str, world: WorldFile) -> Story:
    """Everything about a part of the building's description, by name: ``allens-office/desk``, ``allens-door``.

    Raises:
        BadInput: neither the world nor the run has anything of that name; near names are listed.
    """
    element = world.element(name)
    locales = element.locales if element is not None else (name.partition("/")[0],)
    held = [record for record in _frames(history) if reference_of(record).locale in locales]
    milestones = list(_expecting(history, name))
    if element is None and not milestones and not (world.missing and held):
        history.verify()
        near = ", ".join(world.near(name) or history.near(name)) or "none"
        raise BadInput(f"expected an entry of the run, or a landmark, thing, door or room of its world, as {near}, got"
                       f" {name!r}")
    steps = [Step("described", tell_source(world, name), ())]
    steps += [*_tell_frames(history, held, name), *_tell_milestones(milestones, name), *_tell_plans(history, name)]
    return Story(name, f"What the run knew of {landmark(name)}.", "", tuple(steps))


def _frames(history: Timeline) -> Iterator[EntryRecord[Any]]:
    return history.of_kind(LocaleFrame)


def _tell_frames(history: Timeline, held: Iterable[EntryRecord[Any]], name: str) -> Iterator[Step]:
    """When the frames came that hold it, who had asked for them, and who said otherwise of it."""
    for record in held:
        reference = reference_of(record)
        request = history.reason(record, FrameRequest)
        if record.is_new:
            asked = f", as the {words.source(request.author)} had asked for it" if request is not None else ""
            text = f"What is known of {reference.locale} came to the board in cycle {record.cycle}{asked}."
            yield Step("known", text, (record.ref, *((request.ref,) if request is not None else ())))
        said = [change.sentence() for change in reference.changes if name in (change.name, reference.locale)]
        if said:
            who = "the question what if" if record.author == WHAT_IF else f"the {words.source(record.author)}"
            text = f"In cycle {record.cycle} {who} wrote: {listed(said, MAX_LISTED)}."
            yield Step("changed", text, (record.ref, *record.because))


def _expecting(history: Timeline, name: str) -> Iterator[EntryRecord[Any]]:
    """The last revision of each milestone that expected it, or, of a room, anything in it."""
    for id, ref in history.newest.items():
        record = history.entry(ref) if id.startswith("Milestone-") else None
        value = record.fields if record is not None and isinstance(record.fields, dict) else {}
        if record is not None and any(_is_part(mark, name) for mark in value.get("landmarks", ())):
            yield record


def _is_part(mark: str, name: str) -> bool:
    return mark == name or mark.startswith(f"{name}/")


def _tell_milestones(milestones: list[EntryRecord[Any]], name: str) -> Iterator[Step]:
    for record in milestones[:MAX_MILESTONES]:
        milestone = record.value
        of_it = [_is_part(mark, name) for mark in milestone.landmarks]
        lines = sum(of_it[mark] for mark in milestone.landmark_of)
        expected = count(len(milestone.expected), "model line")
        title = phrases.milestone_name(milestone)
        text = f"{title[0].upper()}{title[1:]} ({milestone.status}) expected {lines} of its {expected} there."
        yield Step("expected", text, (record.ref,))
    if len(milestones) > MAX_MILESTONES:
        rest = milestones[MAX_MILESTONES:]
        text = f"{count(len(rest), 'more milestone')} expected lines of it."
        yield Step("expected", text, (rest[0].ref, rest[-1].ref))
    if not milestones:
        yield Step("expected", "No milestone expected to see anything of it.", ())


def _tell_plans(history: Timeline, name: str) -> Iterator[Step]:
    """The plan sketches that lead through it."""
    for id in history.ids_of(PlanSketch):
        first = history.entry(f"{id}.0")
        subgoals = first.fields.get("subgoals", ()) if first is not None and isinstance(first.fields, dict) else ()
        if first is not None and any(name in (s.get("passage"), s["destination"]["locale"]) for s in subgoals):
            yield Step("planned", f"{sentence(first)[0].upper()}{sentence(first)[1:]}.", (first.ref,))
