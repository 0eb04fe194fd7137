"""What is known of the building and of the robot: the locale frames on the board as they come, change and leave."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from blackboard import Change, Entry, Retracted
from logs.recording.logger import Logger, Moment, Panel, Subject
from logs.recording.loggers.surroundings.model_building import Strip, across, strip
from logs.recording.palette import KNOWN, REVISED
from logs.recording.paths import FRAME_LIST, FRAMES
from logs.recording.stream import RecordingStream, viewable
from world_models import words
from world_models.building.locale_frame import FrameRequest, LocaleFrame
from world_models.entries import CameraState, Footprint, Wheels

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
    """Outlines each room whose frame is on the board, marks what is believed differently, and lists all frames."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._known: dict[str, Known] = {}
        self._askers: dict[str, str] = {}
        self._robot: dict[type[Any], Entry[Any]] = {}

    def panels(self) -> Sequence[Panel]:
        view = rrb.TextDocumentView(origin=FRAME_LIST, name="Frames on the board")
        return (Panel(view, "decisions", 1, 12),)

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(FRAME_LIST, rr.TextDocument.from_fields(media_type="text/markdown"))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        left = [ref.id for ref in moment.decision.left if ref.id in self._known]
        for ref in moment.decision.left:
            self._askers.pop(ref.id, None)
        if self._last and not left and not moment.touched(LocaleFrame, FrameRequest, *ROBOT_KINDS):
            return
        before = self._newest()
        self._take(moment.decision.observed)
        for id in left:
            self._known.pop(id, None)
        self._take(moment.decision.made)
        now = self._newest()
        for name in {**before, **now}:
            if (old := before.get(name)) != (new := now.get(name)):
                self._draw(stream, old.entry.value if old else None, new.entry.value if new else None)
        if self.is_new(FRAME_LIST, text := describe(now.values(), self._robot.values())):
            stream.log(FRAME_LIST, rr.TextDocument, text=[text])

    def _take(self, changes: Iterable[Change]) -> None:
        for change in changes:
            entry, value = change.entry, change.entry.value
            if isinstance(value, FrameRequest):
                self._askers.setdefault(entry.id, entry.author)
            elif isinstance(value, ROBOT_KINDS):
                self._robot[type(value)] = entry
            elif isinstance(value, LocaleFrame) and isinstance(change, Retracted):
                self._known.pop(entry.id, None)
            elif isinstance(value, LocaleFrame):
                asked_by = next((self._askers[ref.id] for ref in entry.because if ref.id in self._askers), entry.author)
                known = self._known.get(entry.id) or Known(entry, entry.cycle, asked_by)
                self._known[entry.id] = replace(known, entry=entry)

    def _newest(self) -> dict[str, Known]:
        """The newest frame of each locale, by its name."""
        return {known.entry.value.name: known for known in self._known.values()}

    def _draw(self, stream: RecordingStream, old: LocaleFrame | None, new: LocaleFrame | None) -> None:
        """Draw a room whose frame came or changed; clear one whose frame left."""
        frame = new or old
        if frame is None or not frame.extent.is_room:
            return
        world, path = self.subject.world, outline_path(frame.name)
        floor_m, corners = world.floor_m(frame.name), world.outline(frame.name)
        ring = strip([*corners, corners[0]], floor_m + frame.locale.height_m)
        stream.log(path, rr.LineStrips3D, strips=[ring] if new else [],
                   colors=[REVISED if frame.changes else KNOWN], radii=[OUTLINE_M])
        if any(f is not None and f.changes for f in (old, new)):
            marks = list(marks_of(new, floor_m + BAR_M)) if new else []
            stream.log(marks_path(frame.name), rr.LineStrips3D, strips=[mark for mark, _ in marks],
                       labels=[text for _, text in marks], colors=[REVISED], radii=[MARK_M])


def outline_path(room: str) -> str:
    """Entity path of a room's outline."""
    return rr.new_entity_path([*FRAMES.split("/"), viewable(room)]).lstrip("/")


def marks_path(room: str) -> str:
    """Entity path of the marks on what is believed differently of a room."""
    return f"{outline_path(room)}/changes"


def marks_of(frame: LocaleFrame, height_m: float) -> Iterator[tuple[Strip, str]]:
    """A bar across each door that is believed shut, a cross over each thing that is gone, with who said so."""
    doors = {door.name: door for door in frame.shut_doorways}
    things = {thing.name: thing for thing in (frame.filed or frame).things}
    for change in frame.changes:
        if change.what == "shut" and change.name in doors:
            yield strip(across(doors[change.name]), height_m), change.sentence()
        elif change.what == "gone" and change.name in things:
            a, b, c, d = things[change.name].footprint_world
            yield strip([a, c, (a + c) / 2, b, d], height_m), change.sentence()


def describe(known: Iterable[Known], robot: Iterable[Entry[Any]]) -> str:
    """The list in markdown: frames with what is believed differently first, then in the order of the world's file."""
    frames = sorted(known, key=lambda k: (not k.entry.value.changes, k.entry.value.extent.number))
    more = [f"... and {words.count(len(frames) - MAX_LISTED, 'frame')} more"] * (len(frames) > MAX_LISTED)
    table = [HEADER, *(_row(k) for k in frames[:MAX_LISTED])] if frames else ["No frame is on the board."]
    itself = [f"- {entry.value.sentence()} ({entry.ref}, by {words.source(entry.author)})" for entry in robot]
    return "\n".join([*table, "", *more, *itself])


def _row(known: Known) -> str:
    entry = known.entry
    changes = "; ".join(change.sentence() for change in entry.value.changes)
    since = f"{known.since}, revised in {entry.cycle}" if entry.revision else str(known.since)
    return f"| {entry.value.name} | {entry.ref} | {since} | {words.source(known.asked_by)} | {changes} |"


LOGGERS = (LocaleFrames,)
