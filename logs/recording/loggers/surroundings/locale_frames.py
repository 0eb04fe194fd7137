"""What is known of the building and of the robot: the locale frames on the board as they come, change and leave."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from blackboard.change import Change, Retracted
from blackboard.entry import Entry
from logs.recording.board_mirror import Moment
from logs.recording.logger import Logger, Panel, Subject
from logs.recording.palette import KNOWN, REVISED
from logs.recording.paths import FRAME_LIST, FRAMES
from logs.recording.stream import RecordingStream, viewable
from world_models import words
from world_models.building.locale_frame import FrameChange, FrameRequest, LocaleFrame
from world_models.building.locales import Doorway, Thing
from world_models.entries.robot import CameraState, Footprint, Wheels

ROBOT_KINDS = (CameraState, Wheels, Footprint)

MAX_LISTED = 40
"""The list has so many frames at most."""

OUTLINE_M, MARK_M = 0.04, 0.1
"""Radii of the strips."""
BAR_M = 1.2
"""A shut door is barred, and a thing that is gone struck out, so high above the floor."""

HEADER = "| locale | frame | since cycle | asked for by | otherwise than in the file |\n|:--|:--|--:|:--|:--|"


@dataclass(frozen=True, slots=True)
class Known:
    """A frame on the board, as the list tells it.

    Attributes:
        entry: its current revision.
        since: the cycle in which it came.
        asked_by: the knowledge source that asked for it, or who told it unasked.
    """

    entry: Entry[LocaleFrame]
    since: int
    asked_by: str


class LocaleFrames(Logger):
    """Outlines each room whose frame is on the board, marks what is believed otherwise, and lists all frames."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._world = subject.world
        self._known: dict[str, Known] = {}
        self._askers: dict[str, str] = {}
        self._robot: dict[type[Any], Entry[Any]] = {}
        self._listed = ""

    def panels(self) -> Sequence[Panel]:
        view = rrb.TextDocumentView(origin=FRAME_LIST, name="Frames on the board")
        return (Panel(view, "decisions", 1, 12),)

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(FRAME_LIST, rr.TextDocument.from_fields(media_type="text/markdown"))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        left = [ref.id for ref in moment.decision.left if ref.id in self._known]
        for ref in moment.decision.left:
            self._askers.pop(ref.id, None)
        if self._listed and not left and not moment.touched(LocaleFrame, FrameRequest, *ROBOT_KINDS):
            return
        before = self._newest()
        self._take(moment.decision.observed)
        for id in left:
            self._known.pop(id, None)
        self._take(moment.decision.made)
        now = self._newest()
        for name in {**before, **now}:
            self._draw(stream, before.get(name), now.get(name))
        text = describe(now.values(), self._robot.values())
        if text != self._listed:
            self._listed = text
            stream.log(FRAME_LIST, rr.TextDocument, text=[text])

    def _take(self, changes: Iterable[Change]) -> None:
        for change in changes:
            entry = change.entry
            if isinstance(entry.value, FrameRequest):
                self._askers.setdefault(entry.id, entry.author)
            elif isinstance(entry.value, ROBOT_KINDS):
                self._robot[type(entry.value)] = entry
            elif isinstance(entry.value, LocaleFrame):
                if isinstance(change, Retracted):
                    self._known.pop(entry.id, None)
                else:
                    self._know(entry)

    def _know(self, entry: Entry[LocaleFrame]) -> None:
        known = self._known.get(entry.id)
        if known is None:
            askers = (self._askers[ref.id] for ref in entry.because if ref.id in self._askers)
            known = Known(entry, entry.cycle, next(askers, entry.author))
        self._known[entry.id] = replace(known, entry=entry)

    def _newest(self) -> dict[str, Known]:
        """The newest frame of each locale, by its name."""
        return {known.entry.value.name: known for known in self._known.values()}

    def _draw(self, stream: RecordingStream, before: Known | None, now: Known | None) -> None:
        """Draw a room whose frame came or changed; clear one whose frame left."""
        if before == now:
            return
        old, new = (known.entry.value if known else None for known in (before, now))
        frame = new or old
        if frame is None or not frame.extent.is_room:
            return
        floor_m, corners = self._world.floor_m(frame.name), self._world.outline(frame.name)
        ring = _strip([*corners, corners[0]], floor_m + frame.locale.height_m)
        colour = REVISED if frame.changes else KNOWN
        stream.log(outline_path(frame.name), rr.LineStrips3D, strips=[ring] if new else [],
                   colors=[colour], radii=[OUTLINE_M])
        if any(f is not None and f.changes for f in (old, new)):
            marks = list(marks_of(new, floor_m + BAR_M)) if new else []
            stream.log(marks_path(frame.name), rr.LineStrips3D, strips=[strip for strip, _ in marks],
                       labels=[text for _, text in marks], colors=[REVISED], radii=[MARK_M])


def outline_path(room: str) -> str:
    """Entity path of a room's outline."""
    return rr.new_entity_path([*FRAMES.split("/"), viewable(room)]).lstrip("/")


def marks_path(room: str) -> str:
    """Entity path of the marks on what is believed otherwise of a room."""
    return f"{outline_path(room)}/changes"


def marks_of(frame: LocaleFrame, height_m: float) -> Iterator[tuple[NDArray[np.float32], str]]:
    """A bar across each door that is believed shut, a cross over each thing that is gone, with who said so."""
    doors = {door.name: door for door in frame.shut_doorways}
    things = {thing.name: thing for thing in (frame.filed or frame).things}
    for change in frame.changes:
        if change.what == "shut" and change.name in doors:
            yield _bar(doors[change.name], height_m), change.sentence()
        elif change.what == "gone" and change.name in things:
            yield _cross(things[change.name], height_m), change.sentence()


def _bar(door: Doorway, height_m: float) -> NDArray[np.float32]:
    """From jamb to jamb, half-way through the wall."""
    (left, right), (right_there, left_there) = door.thresholds_world
    return _strip([(left + left_there) / 2, (right + right_there) / 2], height_m)


def _cross(thing: Thing, height_m: float) -> NDArray[np.float32]:
    a, b, c, d = thing.footprint_world
    return _strip([a, c, (a + c) / 2, b, d], height_m)


def _strip(points: Sequence[Any], height_m: float) -> NDArray[np.float32]:
    """(n, 3) points of the plan at a height."""
    return np.array([(*point[:2], height_m) for point in points], np.float32)


def describe(known: Iterable[Known], robot: Iterable[Entry[Any]]) -> str:
    """The list in markdown: frames with what is believed otherwise first, then in the order of the world's file."""
    frames = sorted(known, key=lambda k: (not k.entry.value.changes, k.entry.value.extent.number))
    more = [f"... and {words.count(len(frames) - MAX_LISTED, 'frame')} more"] * (len(frames) > MAX_LISTED)
    table = [HEADER, *(_row(k) for k in frames[:MAX_LISTED])] if frames else ["No frame is on the board."]
    itself = [f"- {entry.value.sentence()} ({entry.ref}, by {words.source(entry.author)})" for entry in robot]
    return "\n".join([*table, "", *more, *itself])


def _row(known: Known) -> str:
    entry = known.entry
    changes = "; ".join(map(FrameChange.sentence, entry.value.changes))
    since = f"{known.since}, revised in {entry.cycle}" if entry.revision else str(known.since)
    return f"| {entry.value.name} | {entry.ref} | {since} | {words.source(known.asked_by)} | {changes} |"


LOGGERS = (LocaleFrames,)
