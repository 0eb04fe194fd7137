"""The frame store: the long-term model of the building (§3.4), from which locale frames are instantiated on request."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from difflib import get_close_matches

from world_models.building.changes import element_names
from world_models.building.locale_frame import FrameAnswer, FrameReference, FrameRequest, LocaleFrame
from world_models.building.world import World
from world_models.commands import find_room

MAX_FRAMES = 4096
"""So many frames are kept as they are, so that results computed from them serve the next mission too."""
MAX_SUGGESTED = 6


class FrameStore:
    """Frames of the locales of a world.

    Attributes:
        world: from which they come.
        fingerprint: of the world's file.
    """

    def __init__(self, world: World, fingerprint: str = "") -> None:
        self.world, self.fingerprint = world, fingerprint

    def frame(self, name: str) -> LocaleFrame:
        """The frame of a locale as the file describes it; "" is the root. Raises ValueError where there is none."""
        name = name or self.world.root
        return self.world.cached("frames", MAX_FRAMES, (self.fingerprint, name), lambda: self._build(name))

    def _build(self, name: str) -> LocaleFrame:
        return replace(self.world.frame(name), world=self.fingerprint, memo={})

    def answer(self, request: FrameRequest) -> tuple[tuple[LocaleFrame, ...], FrameRequest]:
        """The frames that a request asks for, and the request with the answers to its other questions."""
        frames, answers = [], []
        for name in request.locales:
            try:
                frames.append(self.frame(name))
            except ValueError as error:
                answers.append(FrameAnswer(name, (), str(error)))
        answers += [self._find_called(phrase) for phrase in request.called]
        answers += [self._find_element(name) for name in request.elements]
        return tuple(frames), replace(request, status="answered", answers=tuple(answers))

    def _find_called(self, phrase: str) -> FrameAnswer:
        try:
            return FrameAnswer(phrase, (find_room(phrase, self.world),))
        except ValueError as error:
            return FrameAnswer(phrase, (), str(error))

    def _find_element(self, name: str) -> FrameAnswer:
        """The locales that have a door, elevator, thing, landmark or face of this name."""
        passage = self.world.find_passage(name)
        if passage is not None:
            return FrameAnswer(name, passage.between)
        locale = name.partition("/")[0]
        try:
            frame = self.frame(locale) if locale else None
        except ValueError:
            frame = None
        if frame is not None and name in elements_of(frame):
            return FrameAnswer(name, (locale,))
        near = () if frame is None else get_close_matches(name, sorted(elements_of(frame)), MAX_SUGGESTED)
        expected = ", ".join(near) or f"a door, thing, landmark or face of {self.world.name}"
        return FrameAnswer(name, (), f"expected {expected}, got {name!r}")

    def restore(self, reference: FrameReference) -> LocaleFrame:
        """The frame that a journal refers to. Raises ValueError where this world is another, or has no such locale."""
        if reference.world != self.fingerprint:
            raise ValueError(f"expected a frame of the world {self.fingerprint!r}, got one of {reference.world!r}")
        return self.frame(reference.locale).with_changes(reference.changes)


def elements_of(frame: LocaleFrame) -> frozenset[str]:
    """The names of a frame's doors, things, landmarks and faces."""
    return frozenset(_names(frame))


def _names(frame: LocaleFrame) -> Iterator[str]:
    yield from (doorway.name for doorway in frame.doorways)
    yield from (link.name for link in frame.links)
    yield from (thing.name for thing in frame.things)
    yield from element_names(frame.parts)
