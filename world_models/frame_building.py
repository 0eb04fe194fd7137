"""The building as the frames on a board know it (§3.4): pure functions of frame revisions, cached by revision."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Literal, NamedTuple, TypeVar

from blackboard import MissingEntryError, View
from world_models.building.building import Building
from world_models.building.locale_frame import ANSWERED, CHANGED, FRAME_OF, ROOT, FrameAnswer, FrameRequest, LocaleFrame
from world_models.building.locales import Doorway

T = TypeVar("T")


class _Kept(NamedTuple):
    """A result, and the frames that it was computed from."""

    result: Any
    frames: tuple[LocaleFrame, ...]


class FrameBuilding(Building):
    """The building as far as its frames are on the board.

    Asking for more raises :class:`blackboard.effect.MissingEntryError`: the scheduler then asks the world for it.
    Results are kept with the root's frame, each with the frames that it was computed from: it holds as long as these
    are the current revisions, whatever else comes or changes.
    """

    frames: BoardFrames

    def __init__(self, view: View, instead: Iterable[LocaleFrame] = (), variant: str = "") -> None:
        """``instead``: of the frames on the board, to ask what would be if they were different.

        Results of one ``variant`` do not take the place of those of another.
        """
        super().__init__(BoardFrames(view, instead))
        self._variant = variant

    def cached(self, name: str, max_items: int, key: Hashable, compute: Callable[[], T]) -> T:
        frames = self.frames
        results: dict[Hashable, _Kept] = frames.root().memo.setdefault(name + self._variant, {})
        kept = results.get(key)
        if kept is not None and frames.are_current(kept.frames):
            result: T = kept.result
            return result
        with frames.noting() as used:
            result = compute()
        results.pop(key, None)
        while len(results) >= max_items:
            del results[next(iter(results))]
        results[key] = _Kept(result, tuple(used.values()))
        return result

    def root_frame(self) -> LocaleFrame:
        return self.frames.root()

    def frame(self, name: str) -> LocaleFrame:
        return self.frames[name]

    def shut_doorways(self) -> tuple[Doorway, ...]:
        """The doorways that are believed shut; a frame that says so never leaves the board."""
        return tuple({door.name: door for frame in self.frames.changed() for door in frame.shut_doorways}.values())

    def require(self, names: Iterable[str]) -> None:
        """Ask for the frames of several locales at once, where any is not there. Raises MissingEntryError."""
        self.frames.require(names)

    def list_rooms_in(self, name: str, height_m: float, margin_m: float) -> list[str]:
        """The rooms within a locale that reach a height within a margin, in the order of the hierarchy."""
        here = self.frame(name)
        if here.extent.is_room:
            return [name] if here.extent.reaches_height(height_m, margin_m) else []
        rooms: list[str] = []
        for child in here.children:
            if not child.reaches_height(height_m, margin_m):
                continue
            rooms += [child.name] if child.is_room else self.list_rooms_in(child.name, height_m, margin_m)
        return rooms

    def find_rooms(self, phrases: tuple[str, ...]) -> tuple[str, ...]:
        """The one room that answers to each phrase.

        Raises:
            MissingEntryError: the world was not asked yet; ValueError: no room, or more than one, answers to one.
        """
        answers = self.frames.answers("called")
        unknown = tuple(phrase for phrase in phrases if phrase not in answers)
        if unknown:
            raise MissingEntryError(FrameRequest(called=unknown))
        for phrase in phrases:
            if answers[phrase].error:
                raise ValueError(answers[phrase].error)
        return tuple(answers[phrase].locales[0] for phrase in phrases)

    def find_elements(self, name: str) -> tuple[str, ...]:
        """The locales that have a door, elevator, thing, landmark or face of a name.

        Raises:
            MissingEntryError: the world was not asked yet; ValueError: there is none.
        """
        extra = tuple(frame.name for frame in self.frames.changed()
                      if ("extra", name) in {(c.what, c.name) for c in frame.changes})
        if extra:  # no file knows it
            return extra
        answer = self.frames.answers("elements").get(name)
        if answer is None:
            raise MissingEntryError(FrameRequest(elements=(name,)))
        if answer.error:
            raise ValueError(answer.error)
        return answer.locales

    def is_walkable(self, origin: str, destination: str, max_rooms: int) -> bool:
        """Whether people can walk there by doors and stairs, as far as a search of ``max_rooms`` rooms tells."""
        reached, ahead = {origin}, [origin]
        while ahead and destination not in reached and len(reached) <= max_rooms:
            self.require(ahead)
            beyond: list[str] = []
            for room in ahead:
                beyond += [doorway.other(room) for doorway in self.doorways_of(room)]
                beyond += [link.other(room) for link in self.links_of(room)]
            ahead = list(dict.fromkeys(room for room in beyond if room not in reached))
            reached.update(ahead)
        return destination in reached


class BoardFrames(Mapping[str, LocaleFrame]):
    """The frames on a board, by the name of their locale; those that are not there are asked for."""

    def __init__(self, view: View, instead: Iterable[LocaleFrame] = ()) -> None:
        self._view = view
        self._instead = {frame.name: frame for frame in instead}
        self._notes: list[dict[str, LocaleFrame]] = []

    def __getitem__(self, name: str) -> LocaleFrame:
        """The frame of a locale.

        Raises:
            MissingEntryError: it is not on the board; ValueError: the world has no such locale.
        """
        found = self._find(name)
        if found is None:
            raise self._missing((name,))
        return self._note(found)

    def __iter__(self) -> Iterator[str]:
        return (entry.value.name for entry in self._view.all(LocaleFrame))

    def __len__(self) -> int:
        return len(self._view.all(LocaleFrame))

    def _find(self, name: str) -> LocaleFrame | None:
        if name in self._instead:
            return self._instead[name]
        entry = self._view.newest(FRAME_OF, name)
        return None if entry is None else entry.value

    def root(self) -> LocaleFrame:
        """The frame of the locale that contains all others. Raises MissingEntryError."""
        entry = self._view.newest(ROOT, True)
        if entry is None:
            raise MissingEntryError(FrameRequest(("",)))
        return self._note(entry.value)

    def changed(self) -> list[LocaleFrame]:
        """The frames that say otherwise than the file."""
        return [self._note(entry.value) for entry in self._view.having(CHANGED, True)]

    def require(self, names: Iterable[str]) -> None:
        """Raises MissingEntryError for all of these frames that are not on the board."""
        missing = tuple(name for name in names if self._view.newest(FRAME_OF, name) is None)
        if missing:
            raise self._missing(missing)

    def _missing(self, names: tuple[str, ...]) -> Exception:
        answers = self.answers("locales")
        errors = [answers[name].error for name in names if name in answers]
        return ValueError(errors[0]) if errors else MissingEntryError(FrameRequest(names))

    def answers(self, question: Literal["locales", "called", "elements"]) -> dict[str, FrameAnswer]:
        """What the world said to one kind of question, by what was asked; to ``locales`` only that there are none."""
        return {answer.asked: answer for request in self._view.having(ANSWERED, True)
                for answer in request.value.answers if answer.asked in getattr(request.value, question)}

    def _note(self, frame: LocaleFrame) -> LocaleFrame:
        if self._notes:
            self._notes[-1][frame.name] = frame
        return frame

    @contextmanager
    def noting(self) -> Iterator[dict[str, LocaleFrame]]:
        """Note by name the frames that are read meanwhile."""
        self._notes.append({})
        try:
            yield self._notes[-1]
        finally:
            used = self._notes.pop()
            if self._notes:
                self._notes[-1].update(used)

    def are_current(self, frames: Iterable[LocaleFrame]) -> bool:
        """Whether these are the revisions on the board; they count as read."""
        for frame in frames:
            if self._find(frame.name) is not frame:
                return False
            self._note(frame)
        return True
