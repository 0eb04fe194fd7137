"""The story of a milestone, and of a part of the building: a landmark, a door, a thing or a room."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Sequence
from typing import Any

from logs.explain import phrases
from logs.explain.model import MAX_LISTED, WorldFile, tell_changes, tell_model_lines, tell_source
from logs.explain.phrases import Sentence, Story, capital, describe_decision, said, sentence, tell
from logs.explain.web import find_refs
from logs.explain.why import tell_stories
from logs.records import WHAT_IF, EntryRecord
from logs.run_errors import BadInput, reading
from logs.timeline import Timeline
from world_models import words
from world_models.building.locale_frame import FrameReference, FrameRequest
from world_models.entries import (
    CameraPicture,
    Certificate,
    Discrepancy,
    Hypothesis,
    LineMatch,
    Milestone,
    Obstacle,
    PlanSketch,
    PoseFix,
    Segments,
)
from world_models.words import count, landmark, listed

FOLLOWED = (Certificate, Milestone, Discrepancy)
"""The entries of a verdict; what they wake is what follows."""
REVISIONS = 8
"""So many revisions of a milestone are looked at for its verdict."""
MOST_NAMED, MAX_MILESTONES = 12, 8
"""So many milestones are named where none is similar, and so many are listed one by one."""
ENTRY = re.compile(r"[A-Z]\w*-\d+(\.\d+)?")
"""What names of entries look like."""


def milestones(history: Timeline, name: str) -> tuple[str, ...]:
    """Ids of the milestones that a user means: ``Milestone-10``, ``M1 of hallway``, ``M1``, ``check``.

    Raises BadInput where there is none of that name; near ones are listed.
    """
    last, low = {record.id: record for record in history.last_of_kind(Milestone)}, name.lower()
    if exact := [id for id, one in last.items() if low in (id.lower(), one.ref.lower(), id.rpartition("-")[2])]:
        return tuple(exact)
    called = {id: str(one.field("what", "")) for id, one in last.items()}
    found = tuple(id for id, what in called.items() if f"{what.lower()},".startswith((f"{low} ", f"{low},"))
                  or (" " in low and low in what.lower()))
    if not found:
        history.verify()
        there = list(dict.fromkeys(what.partition(", because")[0] for what in called.values()))
        near = difflib.get_close_matches(name, there, n=4, cutoff=0.4) or there[:MOST_NAMED]
        more = f" ... ({len(there)} in all)" if len(near) == MOST_NAMED < len(there) else ""
        known = f"{', '.join(near)}{more}" if near else "of which there are none"
        raise BadInput(f"--milestone: expected a milestone of the run, {known}, got {name!r}")
    return found


def milestone_story(history: Timeline, id: str, world: WorldFile | None = None) -> Story:
    """Everything about one milestone, in the order in which it happened.

    Args:
        world: tells from which file and line model lines come; None where that is not asked for.

    Raises BadInput where its entries have other fields than those known here, or the journal says nothing of it.
    """
    last = history.entry(history.newest[id])
    if last is None:
        raise BadInput(f"{id}: expected it in the journal, which says nothing of it")
    with reading(id):
        revisions = [one for number in range(REVISIONS) if (one := history.entry(f"{id}.{number}")) is not None]
        head = f"{capital(phrases.milestone_name(last.value))}: {last.fields['status']}."
        first = revisions[0] if revisions else last
        return Story(head, tuple(_tell(history, revisions, last, world)), last.ref, describe_decision(history, first))


def _tell(
    history: Timeline, revisions: Sequence[EntryRecord[Any]], last: EntryRecord[Any], world: WorldFile | None
) -> Iterator[Sentence]:
    first = revisions[0] if revisions else last
    verdicts = (history.reason(record, Certificate) for record in reversed(revisions))
    certificate = next((found for found in verdicts if found is not None), None)
    looked = (None if certificate is None else history.reason(certificate, Milestone)) or last
    yield from tell(history, history.reason(first, Discrepancy), "wanted")
    yield from tell(history, history.reason(first, PlanSketch), "wanted")
    yield from tell(history, history.reason(looked, Hypothesis), "believed")
    yield from tell(history, looked, "expected")
    if certificate is not None:
        fix, *below = history.chain(certificate, PoseFix, LineMatch, Segments, CameraPicture)
        yield from tell(history, fix, "seen", *below)
        yield from () if fix is None else tell_model_lines(history, fix, world)
        yield from tell(history, certificate, "judged")
        yield from _tell_consequences(history, certificate)
    elif last.fields["status"] != "withdrawn":
        yield said(f"It was never judged: when the run ended it was {last.fields['status']}.", last, label="judged")
    if last.fields["status"] == "withdrawn":
        yield said(f"The {words.source(last.author)} withdrew it in cycle {last.cycle}.", last, label="withdrawn")
        yield from tell_changes(history, last)


def _tell_consequences(history: Timeline, certificate: EntryRecord[Any]) -> Iterator[Sentence]:
    """What those did whom the verdict woke."""
    for record in history.decision(certificate.cycle).made:
        for decision in history.naming(record.ref) if record.kind in FOLLOWED else ():
            if decision.chosen is not None and decision.chosen.trigger == record.ref:
                came = "; ".join(f"{r.ref}: {sentence(r)}" for r in decision.made if r.kind is not Discrepancy)
                came = came or "; ".join(map(sentence, decision.made)) or decision.refused or "it changed nothing"
                who = words.source(decision.chosen.source)
                yield said(f"In cycle {decision.cycle} the {who} acted: {came}.", record, label="followed")


def stories_of(history: Timeline, what: str | int | None, world: WorldFile) -> Iterator[Story]:
    """The story of an entry or a part of the building (by name), of a cycle (by number), or of the outcome (None).

    The outcome's is to come fast: it does not ask the world from which lines model lines come.

    Raises BadInput where the run has none of that name; near ones are listed.
    """
    if isinstance(what, str) and history.find(what) is None and ENTRY.fullmatch(what) is None:
        found = [one for one in history.last_of_kind(Obstacle) if one.field("name") == what]
        yield from tell_stories(history, [one.ref for one in found], world)
        if not found:
            yield element_story(history, what, world)
    else:
        yield from tell_stories(history, find_refs(history, what), None if what is None else world)


def element_story(history: Timeline, name: str, world: WorldFile) -> Story:
    """Everything about a part of the building's description, by name: ``allens-office/desk``, ``allens-door``.

    Raises BadInput where neither the world nor the run has anything of that name; near names are listed.
    """
    element = world.element(name)
    locales = element.locales if element is not None else (name.partition("/")[0],)
    held = [record for record in history.frames() if record.value.locale in locales]
    expecting = [record for record in history.last_of_kind(Milestone)
                 if any(_is_part(mark, name) for mark in record.field("landmarks", ()))]
    if element is None and not expecting and not (world.missing and held):
        history.verify()
        near = ", ".join(world.near(name) or history.near(name)) or "none"
        raise BadInput(f"expected an entry of the run, or a landmark, thing, door or room of its world, as {near}, got"
                       f" {name!r}")
    steps = (said(tell_source(world, name), label="described"), *_tell_frames(history, held, name),
             *_tell_milestones(expecting, name), *_tell_plans(history, name))
    return Story(f"What the run knew of {landmark(name)}.", steps, name)


def _tell_frames(history: Timeline, held: Sequence[EntryRecord[FrameReference]], name: str) -> Iterator[Sentence]:
    """When the frames came that hold it, who had asked for them, and who said otherwise of it."""
    for record in held:
        reference, request = record.value, history.reason(record, FrameRequest)
        if record.is_new:
            asked = f", as the {words.source(request.author)} had asked for it" if request is not None else ""
            text = f"What is known of {reference.locale} came to the board in cycle {record.cycle}{asked}."
            yield said(text, record, request, label="known")
        changes = [change.sentence() for change in reference.changes if name in (change.name, reference.locale)]
        if changes:
            who = "the question what if" if record.author == WHAT_IF else f"the {words.source(record.author)}"
            text = f"In cycle {record.cycle} {who} wrote: {listed(changes, MAX_LISTED)}."
            yield Sentence(text, (record.ref, *record.because), label="changed")


def _is_part(mark: str, name: str) -> bool:
    """Whether a landmark is it, or, of a room, anything in it."""
    return mark == name or mark.startswith(f"{name}/")


def _tell_milestones(expecting: Sequence[EntryRecord[Milestone]], name: str) -> Iterator[Sentence]:
    for record in expecting[:MAX_MILESTONES]:
        milestone = record.value
        of_it = [_is_part(mark, name) for mark in milestone.landmarks]
        lines, all_lines = sum(of_it[mark] for mark in milestone.landmark_of), len(milestone.expected)
        title = f"{capital(phrases.milestone_name(milestone))} ({milestone.status})"
        yield said(f"{title} expected {lines} of its {count(all_lines, 'model line')} there.", record, label="expected")
    if rest := expecting[MAX_MILESTONES:]:
        text = f"{count(len(rest), 'more milestone')} expected lines of it."
        yield said(text, rest[0], rest[-1], label="expected")
    if not expecting:
        yield said("No milestone expected to see anything of it.", label="expected")


def _tell_plans(history: Timeline, name: str) -> Iterator[Sentence]:
    """The plan sketches that pass through it."""
    for id in history.ids_of(PlanSketch):
        first = history.entry(f"{id}.0")
        subgoals = () if first is None else first.field("subgoals", ())
        if first is not None and any(name in (s.get("passage"), s["destination"]["locale"]) for s in subgoals):
            yield said(phrases.plainly(first), first, label="planned")
