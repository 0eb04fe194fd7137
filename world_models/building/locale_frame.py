"""Locale frames (§3.4): what the robot knows of a locale, as an entry, and the request that brings it to the board.

The long-term model of the building is a network of frames in a file. What matters for the task at hand is instantiated
from it on the board: a knowledge source that lacks a frame asks for it, and the world's port answers. What is
learnt of the locale revises its frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from typing import Any, Literal

from blackboard import Entry, Index, Level, View, observation, request
from world_models import words
from world_models.building.changes import Shift, add_extra, remove_element, remove_thing, shut_door
from world_models.building.geometry.scene import LocaleGeometry
from world_models.building.locales import EXTRA_KIND, ROBOT_TOP_M, Doorway, Link, Locale, LocaleExtent, Thing
from world_models.building.model_errors import WALL
from world_models.building.passages import PassageEdge
from world_models.entries import OPEN
from world_models.entries.location import Hypothesis
from world_models.entries.task import Goal, PlanSketch
from world_models.frames import frozen

ChangeKind = Literal["shut", "gone", "removed", "extra", "beside", "inexact"]
UNDONE: Mapping[str, ChangeKind] = {"open": "shut", "there": "gone"}
"""What takes back which change."""
RequestStatus = Literal["asked", "answered"]

LAST_FRAMES = 32
"""The newest frames that stay on the board whether or not anything on it names them."""
LAST_REQUESTS = 8


@dataclass(frozen=True, slots=True)
class FrameChange:
    """What is believed of a locale otherwise than its file says.

    Attributes:
        what: shut (a door), gone (a thing), removed (a landmark's lines, or a face), extra (something stands there
            that the file lacks), beside (a door or a wall stands elsewhere), or inexact (the whole building: its
            walls and doors stand centimetres elsewhere).
        name: of the door, thing, landmark, face or building.
        by: who said so.
        footprint: of what is extra or beside: the corners, counter-clockwise, of what it takes of the floor [m, world].
        height_m: of what is extra: up to here it hides what is behind it; 0 where nothing tells how high it is.
        by_m, sigma_m: of what stands beside: how far from its place in the file, and how well that is known [m, world].
    """

    what: ChangeKind
    name: str
    by: str
    footprint: tuple[tuple[float, float], ...] = ()
    height_m: float = 0.0
    by_m: tuple[float, float] = (0.0, 0.0)
    sigma_m: float = 0.0

    @property
    def shift(self) -> Shift:
        """Of what stands beside: what of the geometry is displaced, and by how much."""
        return Shift(frozen(self.footprint, (None, 2)), frozen(self.by_m, (2,)), WALL in self.name)

    def sentence(self) -> str:
        beside = f"stands {100.0 * math.hypot(*self.by_m):.1f} cm beside, to {100.0 * self.sigma_m:.1f} cm"
        said = {"shut": "is shut", "gone": "is gone", "removed": "is left out", "extra": "stands in the way",
                "beside": beside, "inexact": "is known to centimetres only"}[self.what]
        return f"{self.name} {said} ({self.by})"


@dataclass(frozen=True, slots=True)
class FrameReference:
    """A locale frame as the journal has it.

    Attributes:
        world: fingerprint of the file that it comes from.
        locale: its name.
        changes: what is believed differently than that file says.
    """

    world: str
    locale: str
    changes: tuple[FrameChange, ...]

    def sentence(self) -> str:
        return f"what is known of {self.locale}{_tell_changes(self.changes)}"


def _tell_changes(changes: Iterable[FrameChange]) -> str:
    return "".join(f"; {change.sentence()}" for change in changes)


def is_as_filed(frame: LocaleFrame) -> bool:
    return not frame.changes


def is_in_use(view: View, entry: Entry[LocaleFrame]) -> bool:
    """Whether something on the board names a frame's locale or one in it; a lost robot may need any."""
    if Level.GOAL in view.keys(OPEN):
        return True
    return entry.value.name in _named_locales(view)


def _named_locales(view: View) -> set[str]:
    """The locales of hypotheses, goals and active sketches, with the locales that contain them."""
    named = {entry.value.locale for entry in view.all(Hypothesis)}
    places = [place for entry in view.all(Goal) for place in (entry.value.origin, entry.value.destination)]
    places += [place for entry in view.all(PlanSketch) if entry.value.is_active
               for subgoal in entry.value.subgoals for place in (subgoal.origin, subgoal.destination)]
    return {step for name in named | {place.locale for place in places} for step in _path(view, name)}


def _path(view: View, name: str | None) -> Iterator[str]:
    """A locale and those that contain it, as far as their frames are on the board."""
    while name is not None:
        yield name
        frame = view.newest(FRAME_OF, name)
        name = None if frame is None else frame.value.locale.parent


@observation(keep=LAST_FRAMES, when=is_as_filed, unless=is_in_use, traced=True)
@dataclass(frozen=True, eq=False)
class LocaleFrame:
    """What is known of a locale: its own frame (§3.4, Figures 5 to 8).

    How well it is known stands in ``locale`` (standard deviations of its survey) and in ``changes`` (who said what).

    Attributes:
        world: fingerprint of the file that it comes from.
        locale: its name, kind, container, place in the container, outline, and file:line of its description.
        extent: where it lies in the world.
        children: where the locales lie that it contains directly.
        doorways, links: its open doors, elevators and stairs; doors that are believed shut stand in ``changes``.
        parts: its faces with their regions and its landmarks, and those that it shares with each neighbour.
        things: furniture and the like.
        edges: of the passage graph between the locales that it contains directly (Figure 8).
        components: for each component of it the component of its container.
        changes: what is believed differently than the file says.
        memo: results that were computed from this frame and others; no part of what is known.
    """

    world: str
    locale: Locale
    extent: LocaleExtent
    children: tuple[LocaleExtent, ...]
    doorways: tuple[Doorway, ...]
    links: tuple[Link, ...]
    parts: tuple[LocaleGeometry, ...]
    things: tuple[Thing, ...]
    edges: tuple[PassageEdge, ...]
    components: tuple[int, ...]
    changes: tuple[FrameChange, ...] = ()
    filed: LocaleFrame | None = field(default=None, repr=False)
    memo: dict[str, Any] = field(default_factory=dict, repr=False)

    @property
    def name(self) -> str:
        return self.locale.name

    @property
    def shut_doorways(self) -> tuple[Doorway, ...]:
        """The doorways that the file has open and that are believed shut."""
        shut = {change.name for change in self.changes if change.what == "shut"}
        return tuple(doorway for doorway in (self.filed or self).doorways if doorway.name in shut)

    def changed(self, change: FrameChange) -> LocaleFrame:
        """The frame with one thing believed differently. Raises ValueError where it has nothing of that name."""
        filed, changes = self.filed or self, (*self.changes, change)
        if change.what == "shut":
            door = next((d for d in self.doorways if d.name == change.name), None)
            if door is None:
                raise ValueError(f"expected an open door of {self.name}, got {change.name!r}")
            parts = shut_door(self.parts, door, self.extent.reach[2])
            doorways = tuple(d for d in self.doorways if d is not door)
            return replace(self, parts=parts, doorways=doorways, changes=changes, filed=filed, memo={})
        if change.what == "beside":
            shift = change.shift
            return replace(
                self, parts=shift.move_parts(self.parts, self.things), things=tuple(map(shift.move_thing, self.things)),
                doorways=tuple(map(shift.move_doorway, self.doorways)), changes=changes, filed=filed, memo={})
        if change.what == "inexact":
            return replace(self, changes=changes, filed=filed, memo={})
        if change.what == "gone":
            parts, things = remove_thing(self.parts, self.things, change.name)
            return replace(self, parts=parts, things=things, changes=changes, filed=filed, memo={})
        if change.what == "extra":
            things = (*self.things, _to_thing(change, self.name))
            floor_m = self.extent.reach[2]
            parts = add_extra(self.parts, change.name, self.name, change.footprint, floor_m, change.height_m)
            return replace(self, parts=parts, things=things, changes=changes, filed=filed, memo={})
        parts = remove_element(self.parts, change.name)
        return replace(self, parts=parts, changes=changes, filed=filed, memo={})

    @property
    def is_inexact(self) -> bool:
        """Whether it is the building's, of which the model was found to be inexact."""
        return any(change.what == "inexact" for change in self.changes)

    def restored(self, what: ChangeKind, name: str) -> LocaleFrame:
        """The frame without a change of an element: as the file says again."""
        return self.with_changes(change for change in self.changes if (change.what, change.name) != (what, name))

    def without_finds(self) -> LocaleFrame:
        """The frame without things that the file lacks; the same object each time."""
        if "without finds" not in self.memo:
            rest = [change for change in self.changes if change.what != "extra"]
            self.memo["without finds"] = self if len(rest) == len(self.changes) else self.with_changes(rest)
        bare: LocaleFrame = self.memo["without finds"]
        return bare

    def with_changes(self, changes: Iterable[FrameChange]) -> LocaleFrame:
        """The frame as filed, with these changes, one after the other. Raises ValueError as :meth:`changed` does."""
        frame = self.filed or self
        for change in changes:
            frame = frame.changed(change)
        return frame

    def journal_form(self) -> FrameReference:
        """By reference to the world's file; only what differs from it stands in the journal."""
        return FrameReference(self.world, self.name, self.changes)

    def sentence(self) -> str:
        parent = f" in {self.locale.parent}" if self.locale.parent else ""
        held = (f"{words.count(len(self.children), 'locale')} in it" if self.children else
                f"{words.count(len(self.doorways), 'open door')}, {words.count(len(self.things), 'thing')}")
        source = PurePath(self.locale.source).name
        return f"what is known of {self.name}{parent}: {held}{_tell_changes(self.changes)}; from {source}"


def _to_thing(change: FrameChange, locale: str) -> Thing:
    """What stands there and the file lacks; where nobody knows how high it is, it is in the way at every height."""
    footprint = frozen(change.footprint, (None, 2))
    return Thing(change.name, locale, EXTRA_KIND, footprint, 0.0, change.height_m or ROBOT_TOP_M, None, change.by)


FRAME_OF: Index[LocaleFrame] = Index(LocaleFrame, lambda frame: frame.name, "frame")
"""Frames by the name of their locale."""
ROOT: Index[LocaleFrame] = Index(LocaleFrame, lambda frame: frame.locale.parent is None or None, "root")
CHANGED: Index[LocaleFrame] = Index(LocaleFrame, lambda frame: bool(frame.changes) or None, "changed")
REDRAWN: Index[LocaleFrame] = Index(
    LocaleFrame, lambda frame: any(change.what == "beside" for change in frame.changes) or None, "redrawn")
"""Frames in which a door or a wall stands elsewhere."""


def has_answer(frame_request: FrameRequest) -> bool:
    return frame_request.status == "answered"


@dataclass(frozen=True, slots=True)
class FrameAnswer:
    """What the world says to a name or a phrase.

    Attributes:
        asked: the name or phrase.
        locales: those that are meant.
        error: in words why there are none, or too many; else "".
    """

    asked: str
    locales: tuple[str, ...]
    error: str = ""


@request(keep=LAST_REQUESTS, when=has_answer)
@dataclass(frozen=True, slots=True)
class FrameRequest:
    """Asks the long-term model of the building for locale frames, or which locale is meant.

    Attributes:
        locales: whose frames are wanted; "" for the root.
        called: phrases for a room, as ``Allen's office``.
        elements: names of doors, elevators, things, landmarks or faces: in which locales are they?
        status: asked, or answered.
        answers: to ``called`` and ``elements``, and to ``locales`` that there are not.
    """

    locales: tuple[str, ...] = ()
    called: tuple[str, ...] = ()
    elements: tuple[str, ...] = ()
    status: RequestStatus = "asked"
    answers: tuple[FrameAnswer, ...] = ()

    def sentence(self) -> str:
        frames = words.listed([name or "the whole building" for name in self.locales], 6)
        asked = [f"what is known of {frames}"] if frames else []
        asked += [f"where {words.listed([*self.called, *self.elements], 6)} is"] * bool(self.called or self.elements)
        said = [answer.error or f"{answer.asked} is in {' and '.join(answer.locales)}" for answer in self.answers]
        answered = f"; answered{': ' * bool(said)}{', '.join(said)}" * has_answer(self)
        return f"asks {' and '.join(asked)}{answered}"


ANSWERED: Index[FrameRequest] = Index(FrameRequest, lambda r: has_answer(r) or None, "answered")
