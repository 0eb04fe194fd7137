"""What explanations say of locale frames: by which an act went, what they hold otherwise than the file, and from which
frame, file and line the matched model lines come."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from harvey.run_files.records import EntryRecord
from harvey.why import facts
from harvey.why.history import History
from harvey.why.links import reason
from harvey.why.model.world_file import WorldFile
from harvey.why.sentences import value_of
from world_models.building.locale_frame import FrameReference
from world_models.entries.percepts import PoseFix
from world_models.words import landmark, listed

FRAME = "LocaleFrame-"
MAX_LISTED = 4
"""So many frames or landmarks are named."""
Sentence = tuple[str, tuple[str, ...]]
"""A sentence, and the entries that say so."""


def find_frames(history: History, refs: Iterable[str]) -> dict[str, EntryRecord]:
    """The locale frames among some entries, by locale; of several revisions the first that is named."""
    found: dict[str, EntryRecord] = {}
    for ref in refs:
        record = history.entry(ref) if ref.startswith(FRAME) else None
        if record is not None:
            found.setdefault(reference_of(record).locale, record)
    return found


def reference_of(record: EntryRecord) -> FrameReference:
    """What the journal keeps of a locale frame. Raises BadInput."""
    return value_of(record, FrameReference)


def tell_used(history: History, record: EntryRecord) -> Iterator[Sentence]:
    """By which frames an act went; of the robot itself only what was revised since the start is named."""
    used = () if record.observed else history.decision(record.cycle).used
    frames = find_frames(history, used)
    revised = [ref for ref in used if not ref.startswith(FRAME) and not ref.endswith(".0")]
    changed = [name for name, frame in frames.items() if reference_of(frame).changes]
    named = list(dict.fromkeys((*changed, *frames)))[: max(MAX_LISTED, len(changed))]
    parts = [f"what was known of {listed([*named, *list(frames)[len(named):]], len(named))}"] * bool(named)
    parts += [f"the revised model of the robot itself ({', '.join(revised)})"] * bool(revised)
    if not parts:
        return
    said = "".join(f"; {text}" for text in _changes(frames[name] for name in changed))
    yield f"The act went by {' and by '.join(parts)}{said}.", (*(frames[name].ref for name in named), *revised)


def tell_changes(history: History, record: EntryRecord) -> Iterator[tuple[str, EntryRecord]]:
    """What the frames that an entry rests on hold otherwise than the world's file; of equal ones the first."""
    told: set[str] = set()
    for frame in find_frames(history, record.because).values():
        text = listed(_changes([frame]), MAX_LISTED)
        if text and text not in told:
            told.add(text)
            yield f"It was known otherwise than in the world's file: {text}.", frame


def _changes(frames: Iterable[EntryRecord]) -> list[str]:
    """What is said otherwise, each once."""
    changes = (change for frame in frames for change in reference_of(frame).changes)
    return list(dict.fromkeys(change.sentence() for change in changes))


def tell_model_lines(history: History, fix: EntryRecord, world: WorldFile | None) -> Iterator[Sentence]:
    """From which frames the model lines come that a pose was solved from, and from which file and line of the world.

    Args:
        world: None where files and lines are not asked for.
    """
    match = reason(history, fix, "LineMatch")
    expected = None if match is None else reason(history, match, "Milestone")
    if match is None or expected is None:
        return
    used = (*history.decision(expected.cycle).used, *history.decision(match.cycle).used)
    frames = find_frames(history, (*expected.because, *used))
    names = [name for name, _ in facts.by_landmark(history, value_of(fix, PoseFix), match)]
    held = {name: _find_holder(name, frames, world) for name in names}
    locales = list(dict.fromkeys(locale for locale in held.values() if locale))
    if not locales:
        return
    where = [f"{landmark(name)} ({_find_line(name, world)})" for name in names if world and not world.missing]
    text = f"The model lines come from what is known of {listed(locales, MAX_LISTED)}"
    text += f": {listed(where, MAX_LISTED)}" if where else ""
    lost = f" From which lines of the world's file cannot be told: {world.missing}." if world and world.missing else ""
    yield f"{text}.{lost}", tuple(frames[locale].ref for locale in locales[:MAX_LISTED])


def _find_holder(name: str, frames: dict[str, EntryRecord], world: WorldFile | None) -> str:
    """The locale whose frame holds a landmark; that of an open door's casing is not in its name."""
    locale, slash, _ = name.partition("/")
    if slash:
        return locale if locale in frames else ""
    element = None if world is None else world.element(name)
    return "" if element is None else next((locale for locale in element.locales if locale in frames), "")


def _find_line(name: str, world: WorldFile | None) -> str:
    element = None if world is None else world.element(name)
    return element.source if element is not None else "not in the world's file"
