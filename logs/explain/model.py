"""The model in explanations: by which locale frames an act went, what they hold otherwise than the world's file, and
from which file and line of it a locale, door, thing, landmark or face comes."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from logs.explain.phrases import Sentence, by_landmark, said
from logs.records import EntryRecord
from logs.run_directory import RunDirectory
from logs.run_errors import BadInput
from logs.timeline import Timeline
from world_models.building.locale_frame import FrameReference
from world_models.entries import LineMatch, Milestone
from world_models.words import landmark, listed

if TYPE_CHECKING:  # a world is loaded only for an answer that needs it, and so is what loads it
    from world_models.building.locale_frame import LocaleFrame
    from world_models.building.world import World
    from world_models.frame_store import FrameStore

FRAME = "LocaleFrame-"
MAX_LISTED = 4
"""So many frames or landmarks are named."""
MAX_NEAR, MIN_SIMILARITY = 4, 0.5
NOT_THERE = "not in the world's file"


def find_frames(history: Timeline, refs: Iterable[str]) -> dict[str, EntryRecord[FrameReference]]:
    """The locale frames among some entries, by locale; of several revisions the first that is named."""
    found: dict[str, EntryRecord[FrameReference]] = {}
    for ref in refs:
        record = history.entry(ref) if ref.startswith(FRAME) else None
        if record is not None:
            found.setdefault(record.value.locale, record)
    return found


def tell_used(history: Timeline, record: EntryRecord[Any]) -> Iterator[Sentence]:
    """By which frames an act went; of the robot itself only what was revised since the start is named."""
    used = () if record.observed else history.decision(record.cycle).used
    frames = find_frames(history, used)
    revised = [ref for ref in used if not ref.startswith(FRAME) and not ref.endswith(".0")]
    changed = [name for name, frame in frames.items() if frame.value.changes]
    named = list(dict.fromkeys((*changed, *frames)))[: max(MAX_LISTED, len(changed))]
    parts = [f"what was known of {listed([*named, *list(frames)[len(named):]], len(named))}"] * bool(named)
    parts += [f"the revised model of the robot itself ({', '.join(revised)})"] * bool(revised)
    if parts:
        changes = "".join(f"; {text}" for text in _changes(frames[name] for name in changed))
        refs = (*(frames[name].ref for name in named), *revised)
        yield Sentence(f"The act went by {' and by '.join(parts)}{changes}.", refs, label="known")


def tell_changes(history: Timeline, record: EntryRecord[Any]) -> Iterator[Sentence]:
    """What the frames that an entry rests on hold otherwise than the world's file; of equal ones the first."""
    texts = [(listed(_changes([frame]), MAX_LISTED), frame) for frame in find_frames(history, record.because).values()]
    for number, (text, frame) in enumerate(texts):
        if text and text not in (before for before, _ in texts[:number]):
            yield said(f"It was known differently than in the world's file: {text}.", frame, label="changed")


def _changes(frames: Iterable[EntryRecord[FrameReference]]) -> list[str]:
    """What is said otherwise, each once."""
    return list(dict.fromkeys(change.sentence() for frame in frames for change in frame.value.changes))


def tell_model_lines(history: Timeline, fix: EntryRecord[Any], world: WorldFile | None) -> Iterator[Sentence]:
    """From which frames the model lines come that a pose was solved from, and from which file and line of the world.

    Args:
        world: None where files and lines are not asked for.
    """
    match, expected = history.chain(fix, LineMatch, Milestone)
    if match is None or expected is None:
        return
    used = (*history.decision(expected.cycle).used, *history.decision(match.cycle).used)
    frames = find_frames(history, (*expected.because, *used))
    names = [name for name, _ in by_landmark(history, fix.value, match)]
    locales = [locale for locale in dict.fromkeys(_find_holder(name, frames, world) for name in names) if locale]
    if not locales:
        return
    known = [] if world is None or world.missing else [(name, world.element(name)) for name in names]
    where = [f"{landmark(name)} ({one.source if one else NOT_THERE})" for name, one in known]
    text = f"The model lines come from what is known of {listed(locales, MAX_LISTED)}"
    text += f": {listed(where, MAX_LISTED)}" if where else ""
    lost = f" From which lines of the world's file cannot be told: {world.missing}." if world and world.missing else ""
    yield Sentence(f"{text}.{lost}", tuple(frames[locale].ref for locale in locales[:MAX_LISTED]), label="model")


def _find_holder(name: str, frames: Mapping[str, EntryRecord[Any]], world: WorldFile | None) -> str:
    """The locale whose frame holds a landmark; that of an open door's casing is not in its name."""
    locale, slash, _ = name.partition("/")
    element = None if slash or world is None else world.element(name)
    locales = (locale,) if slash else element.locales if element is not None else ()
    return next((locale for locale in locales if locale in frames), "")


class Element(NamedTuple):
    """A part of the building's description: its kind in a word (``desk``, ``open door``, ``wall``), whose frames hold
    it, and file:line of its description; the file relative to the project where it comes with it.
    """

    kind: str
    locales: tuple[str, ...]
    source: str


class WorldFile:
    """The world file of a run, loaded when it is first asked."""

    def __init__(self, run: RunDirectory) -> None:
        self._run = run

    @property
    def missing(self) -> str:
        """Why it cannot be asked; "" where it can."""
        return self._store if isinstance(self._store, str) else ""

    @property
    def world(self) -> World | None:
        """The world; None where it cannot be asked."""
        return None if isinstance(self._store, str) else self._store.world

    def element(self, name: str) -> Element | None:
        """What a name means; None where the world has nothing of that name, or cannot be asked."""
        if isinstance(self._store, str):
            return None
        world = self._store.world
        if name in world.frames:
            locale = world.locale(name)
            return Element(locale.kind, (name,), _brief(locale.source))
        if (passage := world.find_passage(name)) is not None:
            return Element(getattr(passage, "kind", "open door"), tuple(passage.between), _brief(passage.source))
        elements = () if (frame := self._frame(name)) is None else _elements(frame)
        return next((element for called, element in elements if called == name), None)

    def near(self, name: str) -> list[str]:
        """Names in the world that a user may have meant."""
        if isinstance(self._store, str):
            return []
        from world_models.frame_store import elements_of

        frame = self._frame(name)
        known = sorted(elements_of(frame)) if frame is not None else list(self._store.world.frames)
        return difflib.get_close_matches(name, known, MAX_NEAR, MIN_SIMILARITY)

    def _frame(self, name: str) -> LocaleFrame | None:
        """Of the locale that an element's name begins with."""
        locale, slash, _ = name.partition("/")
        if isinstance(self._store, str) or not slash or locale not in self._store.world.frames:
            return None
        return self._store.frame(locale)

    @cached_property
    def _store(self) -> FrameStore | str:
        if not (self._run.path / "run.json").is_file():
            return f"{self._run.path} has no run.json, which would name the world's file"
        from logs.run_head import RunHead
        from world_models.frame_store import FrameStore

        try:
            head = RunHead.read(self._run.path)
            return FrameStore(head.load_world(), head.world_sha256)
        except BadInput as error:
            return str(error)


def tell_source(world: WorldFile, name: str) -> str:
    """From which file and line an element comes, in a sentence."""
    if world.missing:
        return f"From which line of the world's file {name} comes cannot be told: {world.missing}."
    element = world.element(name)
    return f"The world's file has nothing of the name {name}." if element is None else (
        f"{name} is described in {element.source} ({element.kind}).")


def _elements(frame: LocaleFrame) -> Iterator[tuple[str, Element]]:
    """The things, landmarks and faces of a frame by their names."""
    yield from ((thing.name, Element(thing.kind, (frame.name,), _brief(thing.source))) for thing in frame.things)
    for part in frame.parts:
        locales = (part.locale, *((part.neighbour,) if part.neighbour else ()))
        yield from ((mark.name, Element(mark.kind, locales, _brief(mark.source))) for _, mark in part.landmarks)
        yield from ((face.name, Element("face", locales, _brief(frame.locale.source))) for _, face in part.faces)


def _brief(source: str) -> str:
    """A file of the project by its path within it."""
    from world_models.files.toml.mission import ROOT

    path, colon, line = source.rpartition(":")
    there = Path(path)
    return f"{there.relative_to(ROOT)}{colon}{line}" if there.is_relative_to(ROOT) else source
