"""From which file and line of the world a locale, door, thing, landmark or face comes."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from harvey.errors import BadInput
from harvey.run_files.run_directory import RunDirectory

if TYPE_CHECKING:  # a world is loaded only for an answer that needs it, and so is what loads it
    from world_models.building.locale_frame import LocaleFrame
    from world_models.frame_store import FrameStore

MAX_NEAR, MIN_SIMILARITY = 4, 0.5


@dataclass(frozen=True, slots=True)
class Element:
    """A part of the building's description.

    Attributes:
        name: unique in the world.
        kind: in a word: ``desk``, ``open door``, ``wall``.
        locales: whose frames hold it.
        source: file:line of its description; the file relative to the project where it comes with it.
    """

    name: str
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

    def element(self, name: str) -> Element | None:
        """What a name means; None where the world has nothing of that name, or cannot be asked."""
        if isinstance(self._store, str):
            return None
        world = self._store.world
        if name in world.frames:
            locale = world.locale(name)
            return Element(name, locale.kind, (name,), _brief(locale.source))
        if (passage := world.find_passage(name)) is not None:
            kind = getattr(passage, "kind", "open door")
            return Element(name, kind, tuple(passage.between), _brief(passage.source))
        frame = self._frame(name)
        return None if frame is None else _find_in(frame, name)

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
        from harvey.run_files.run_head import RunHead
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
    if element is None:
        return f"The world's file has nothing of the name {name}."
    return f"{name} is described in {element.source} ({element.kind})."


def _find_in(frame: LocaleFrame, name: str) -> Element | None:
    thing = next((thing for thing in frame.things if thing.name == name), None)
    if thing is not None:
        return Element(name, thing.kind, (frame.name,), _brief(thing.source))
    for part in frame.parts:
        locales = (part.locale, *((part.neighbour,) if part.neighbour else ()))
        mark = next((mark for _, mark in part.landmarks if mark.name == name), None)
        if mark is not None:
            return Element(name, mark.kind, locales, _brief(mark.source))
        if any(face.name == name for _, face in part.faces):
            return Element(name, "face", locales, _brief(frame.locale.source))
    return None


def _brief(source: str) -> str:
    """A file of the project by its path within it."""
    from world_models.files.toml.mission import ROOT

    path, colon, line = source.rpartition(":")
    there = Path(path)
    return f"{there.relative_to(ROOT)}{colon}{line}" if there.is_relative_to(ROOT) else source
