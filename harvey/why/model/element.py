"""The story of a landmark, a door, a thing or a room: whence it comes, which frames held it, which milestones expected
it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from harvey.errors import BadInput
from harvey.run_files.records import WHAT_IF, EntryRecord
from harvey.why import facts
from harvey.why.history import History
from harvey.why.links import words
from harvey.why.model.frames import FRAME, MAX_LISTED, reference_of
from harvey.why.model.world_file import WorldFile, tell_source
from harvey.why.sentences import sentence, value_of
from harvey.why.story import Step, Story, tell_stories
from harvey.why.walk import find_refs
from world_models.entries.task import Milestone
from world_models.words import count, landmark, listed

ENTRY = re.compile(r"[A-Z]\w*-\d+(\.\d+)?")
"""What names of entries look like."""
MAX_MILESTONES = 8
"""So many milestones are told one by one."""


def is_element(history: History, text: str) -> bool:
    """Whether a name is meant for a part of the building and not for an entry of the run."""
    return history.find(text) is None and ENTRY.fullmatch(text) is None


def stories_of(history: History, what: str | int | None, world: WorldFile) -> Iterator[Story]:
    """The story of an entry or a part of the building (by name), of a cycle (by number), or of the outcome (None).

    The outcome's is to come fast: it does not ask the world from which lines model lines come.

    Raises:
        BadInput: the run has none of that name; near ones are listed.
    """
    if isinstance(what, str) and is_element(history, what):
        yield element_story(history, what, world)
    else:
        yield from tell_stories(history, find_refs(history, what), None if what is None else world)


def element_story(history: History, name: str, world: WorldFile) -> Story:
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


def _frames(history: History) -> Iterator[EntryRecord]:
    found = (history.entry(ref) for ref in history.refs if ref.startswith(FRAME))
    return (record for record in found if record is not None)


def _tell_frames(history: History, held: Iterable[EntryRecord], name: str) -> Iterator[Step]:
    """When the frames came that hold it, who had asked for them, and who said otherwise of it."""
    for record in held:
        reference = reference_of(record)
        request = next((history.entry(ref) for ref in record.because if ref.startswith("FrameRequest-")), None)
        if record.change == "Posted":
            asked = f", as the {words(request.author)} had asked for it" if request is not None else ""
            text = f"What is known of {reference.locale} came to the board in cycle {record.cycle}{asked}."
            yield Step("known", text, (record.ref, *((request.ref,) if request is not None else ())))
        said = [change.sentence() for change in reference.changes if name in (change.name, reference.locale)]
        if said:
            who = "the question what if" if record.author == WHAT_IF else f"the {words(record.author)}"
            text = f"In cycle {record.cycle} {who} wrote: {listed(said, MAX_LISTED)}."
            yield Step("changed", text, (record.ref, *record.because))


def _expecting(history: History, name: str) -> Iterator[EntryRecord]:
    """The last revision of each milestone that expected it, or, of a room, anything in it."""
    for id, ref in history.newest.items():
        record = history.entry(ref) if id.startswith("Milestone-") else None
        value = record.value if record is not None and isinstance(record.value, dict) else {}
        if record is not None and any(_is_part(mark, name) for mark in value.get("landmarks", ())):
            yield record


def _is_part(mark: str, name: str) -> bool:
    return mark == name or mark.startswith(f"{name}/")


def _tell_milestones(milestones: list[EntryRecord], name: str) -> Iterator[Step]:
    for record in milestones[:MAX_MILESTONES]:
        milestone = value_of(record, Milestone)
        of_it = [_is_part(mark, name) for mark in milestone.landmarks]
        lines = sum(of_it[mark] for mark in milestone.landmark_of)
        expected = count(len(milestone.expected), "model line")
        title = facts.milestone_name(milestone)
        text = f"{title[0].upper()}{title[1:]} ({milestone.status}) expected {lines} of its {expected} there."
        yield Step("expected", text, (record.ref,))
    if len(milestones) > MAX_MILESTONES:
        rest = milestones[MAX_MILESTONES:]
        text = f"{count(len(rest), 'more milestone')} expected lines of it."
        yield Step("expected", text, (rest[0].ref, rest[-1].ref))
    if not milestones:
        yield Step("expected", "No milestone expected to see anything of it.", ())


def _tell_plans(history: History, name: str) -> Iterator[Step]:
    """The plan sketches that lead through it."""
    for id in (id for id in history.newest if id.startswith("PlanSketch-")):
        first = history.entry(f"{id}.0")
        subgoals = first.value.get("subgoals", ()) if first is not None and isinstance(first.value, dict) else ()
        if first is not None and any(name in (s.get("passage"), s["destination"]["locale"]) for s in subgoals):
            yield Step("planned", f"{sentence(first)[0].upper()}{sentence(first)[1:]}.", (first.ref,))
