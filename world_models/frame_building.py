"""The building as the frames on a board know it (§3.4): pure functions of frame revisions, cached by revision."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Literal, NamedTuple, TypeVar

from blackboard.board import View
from blackboard.effect import MissingEntryError
from world_models.building.building import FLOOR_MARGIN_M, Building
from world_models.building.extents import LocaleExtent
from world_models.building.locale_source import LocaleGeometry, PassageEdge
from world_models.building.locales import Doorway, Link, Locale
from world_models.building.things import Thing
from world_models.entries.locale_frame import ANSWERED, CHANGED, FRAME_OF, ROOT, FrameAnswer, FrameRequest, LocaleFrame

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

    locale_source: FrameLocales

    def __init__(self, view: View, instead: Iterable[LocaleFrame] = (), variant: str = "") -> None:
        """``instead``: of the frames on the board, to ask what would be if they were otherwise.

        Results of one ``variant`` do not take the place of those of another.
        """
        super().__init__(FrameLocales(view, instead))
        self._variant = variant

    def cached(self, name: str, max_items: int, key: Hashable, compute: Callable[[], T]) -> T:
        frames = self.locale_source
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

    @property
    def root(self) -> str:
        return self.locale_source.root().name

    def locale(self, name: str) -> Locale:
        return self.locale_source.frame(name).locale

    def shut_doorways(self) -> tuple[Doorway, ...]:
        return self.locale_source.shut_doorways()

    def require(self, names: Iterable[str]) -> None:
        """Ask for the frames of several locales at once, where any is not there. Raises MissingEntryError."""
        self.locale_source.require(names)

    def list_rooms_in(self, name: str, height_m: float, margin_m: float) -> list[str]:
        """The rooms within a locale that reach a height within a margin, in the order of the hierarchy."""
        here = self.locale_source.extent(name)
        if here.is_room:
            return [name] if _reaches_height(here, height_m, margin_m) else []
        rooms: list[str] = []
        for child in self.locale_source.extents_in(name):
            if not _reaches_height(child, height_m, margin_m):
                continue
            rooms += [child.name] if child.is_room else self.list_rooms_in(child.name, height_m, margin_m)
        return rooms

    def find_rooms(self, phrases: tuple[str, ...]) -> tuple[str, ...]:
        """The one room that answers to each phrase.

        Raises:
            MissingEntryError: the world was not asked yet; ValueError: no room, or more than one, answers to one.
        """
        return self.locale_source.find_rooms(phrases)

    def find_elements(self, name: str) -> tuple[str, ...]:
        """The locales that have a door, elevator, thing, landmark or face of a name.

        Raises:
            MissingEntryError: the world was not asked yet; ValueError: there is none.
        """
        return self.locale_source.find_elements(name)

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


class FrameLocales:
    """A :class:`world_models.building.locale_source.LocaleSource` of the frames on a board."""

    def __init__(self, view: View, instead: Iterable[LocaleFrame] = ()) -> None:
        self._view = view
        self._instead = {frame.name: frame for frame in instead}
        self._notes: list[dict[str, LocaleFrame]] = []

    def frame(self, name: str) -> LocaleFrame:
        """The frame of a locale.

        Raises:
            MissingEntryError: it is not on the board; ValueError: the world has no such locale.
        """
        found = self._find(name)
        if found is None:
            raise self._missing((name,))
        return self._note(found)

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

    def require(self, names: Iterable[str]) -> None:
        """Raises MissingEntryError for all of these frames that are not on the board."""
        missing = tuple(name for name in names if self._view.newest(FRAME_OF, name) is None)
        if missing:
            raise self._missing(missing)

    def find_rooms(self, phrases: tuple[str, ...]) -> tuple[str, ...]:
        """See :meth:`FrameBuilding.find_rooms`."""
        answers = self._answers("called")
        unknown = tuple(phrase for phrase in phrases if phrase not in answers)
        if unknown:
            raise MissingEntryError(FrameRequest(called=unknown))
        for phrase in phrases:
            if answers[phrase].error:
                raise ValueError(answers[phrase].error)
        return tuple(answers[phrase].locales[0] for phrase in phrases)

    def _missing(self, names: tuple[str, ...]) -> Exception:
        answers = self._answers("locales")
        errors = [answers[name].error for name in names if name in answers]
        return ValueError(errors[0]) if errors else MissingEntryError(FrameRequest(names))

    def _answers(self, question: Literal["locales", "called", "elements"]) -> dict[str, FrameAnswer]:
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

    # -- locale source ---------------------------------------------------------------------------------------------

    def locale(self, name: str) -> Locale | None:
        return self.frame(name).locale

    def children(self, name: str) -> tuple[str, ...]:
        return tuple(child.name for child in self.frame(name).children)

    def is_room(self, name: str) -> bool:
        return self.frame(name).extent.is_room

    def number(self, name: str) -> int:
        return self.extent(name).number

    def extent(self, name: str) -> LocaleExtent:
        return self.frame(name).extent

    def extents_in(self, name: str) -> tuple[LocaleExtent, ...]:
        return self.frame(name).children

    def near(self, x_m: float, y_m: float, margin_m: float, z_m: float | None = None) -> Sequence[str]:
        """From the root down, into each locale that reaches the point."""
        found: list[LocaleExtent] = []
        todo = [self.root().extent]
        while todo:
            here = todo.pop()
            if not here.reaches(x_m, y_m, margin_m):
                continue
            if z_m is not None and not _reaches_height(here, z_m, FLOOR_MARGIN_M):
                continue
            if here.is_near(x_m, y_m, margin_m):
                found.append(here)
            if not here.is_room:
                todo += self.extents_in(here.name)
        return [extent.name for extent in sorted(found, key=_number)]

    def doorways(self, locale: str) -> tuple[Doorway, ...]:
        return self.frame(locale).doorways

    def links(self, locale: str) -> tuple[Link, ...]:
        return self.frame(locale).links

    def geometry(self, locale: str) -> tuple[LocaleGeometry, ...]:
        return self.frame(locale).parts

    def things(self, locale: str) -> tuple[Thing, ...]:
        return self.frame(locale).things

    def passage_edges(self, container: str) -> tuple[PassageEdge, ...]:
        return self.frame(container).edges

    def components(self, locale: str) -> tuple[int, ...]:
        return self.frame(locale).components

    def shut_doorways(self) -> tuple[Doorway, ...]:
        """The doorways that are believed shut; a frame that says so never leaves the board."""
        frames = (self._note(entry.value) for entry in self._view.having(CHANGED, True))
        return tuple({doorway.name: doorway for frame in frames for doorway in frame.shut_doorways}.values())

    def find_elements(self, name: str) -> tuple[str, ...]:
        """See :meth:`FrameBuilding.find_elements`."""
        changed = (self._note(entry.value) for entry in self._view.having(CHANGED, True))
        extra = tuple(frame.name for frame in changed if ("extra", name) in {(c.what, c.name) for c in frame.changes})
        if extra:  # no file knows it
            return extra
        answer = self._answers("elements").get(name)
        if answer is None:
            raise MissingEntryError(FrameRequest(elements=(name,)))
        if answer.error:
            raise ValueError(answer.error)
        return answer.locales


def _reaches_height(extent: LocaleExtent, z_m: float, margin_m: float) -> bool:
    """Whether a locale, with all that it contains, reaches a height within a margin [m, world]."""
    return extent.reach[2] - margin_m <= z_m <= extent.reach[5] + margin_m


def _number(extent: LocaleExtent) -> int:
    return extent.number
