"""What the recording shows of locale frames is what is on the board, whatever came, changed and left before."""

from __future__ import annotations

from functools import cache
from typing import Any, cast

from hypothesis import given
from hypothesis import strategies as st

from blackboard import Blackboard, Decision, Effect, Entry, Level, Post, Ref, Retract, Revise
from logs.recording.logger import Moment, Subject
from logs.recording.loggers.surroundings.locale_frames import LocaleFrames, marks_path, outline_path
from logs.recording.palette import KNOWN, REVISED
from logs.recording.paths import FRAME_LIST
from logs.recording.stream import RecordingStream
from logs.timeline import Mirror
from scripted_mission import CAMERA, MOUNT, house
from world_models.building.locale_frame import FrameChange, LocaleFrame
from world_models.building.world import World
from world_models.frame_store import FrameStore

ROOMS = ("kitchen", "parlour")
SHUT = FrameChange("shut", "kitchen-door", "user")

steps = st.tuples(st.sampled_from(("come", "shut", "open", "leave", "retract")), st.sampled_from(ROOMS))


class LastLogged:
    """In place of a recording: the last row of each entity, and how many there were."""

    def __init__(self) -> None:
        self.rows: dict[str, dict[str, Any]] = {}
        self.count = 0

    def log(self, path: str, _kind: Any, **components: Any) -> None:
        self.rows[path] = components
        self.count += 1


@cache
def the_house() -> World:
    return house()


@given(st.lists(st.tuples(steps, st.booleans()), max_size=25))
def test_what_is_drawn_and_listed_is_what_is_on_the_board(plan: list[tuple[tuple[str, str], bool]]) -> None:
    """A step may come from outside or by an act; a frame may be asked for that is there already."""
    world, board, stream = the_house(), Blackboard(), LastLogged()
    logger, store = LocaleFrames(Subject("house", world, CAMERA, MOUNT)), FrameStore(world, "a file")
    drawn = cast(RecordingStream, stream)
    for cycle, ((what, room), is_observed) in enumerate(plan, start=1):
        there = [entry for entry in board.view.all(LocaleFrame) if entry.value.name == room]
        left: tuple[Ref, ...] = ()
        if what == "leave" and there:
            left = (there[0].ref,)
            board.forget(there[0].id)
        effects = step(what, there, store.frame(room))
        changes = board.apply(effects, author="world", cycle=cycle)
        observed, made = (changes, ()) if is_observed else ((), changes)
        decision = Decision(cycle, (), observed, Level.PLAN, (), (), None, None, 0, made, left=left)
        logger.log(drawn, Moment(decision, Mirror()))
        for name in ROOMS:
            newest = [entry.value for entry in board.view.all(LocaleFrame) if entry.value.name == name][-1:]
            outline = stream.rows.get(outline_path(name), {"strips": []})
            assert len(outline["strips"]) == len(newest)
            if newest:
                assert outline["colors"] == [REVISED if newest[0].changes else KNOWN]
            marks = stream.rows.get(marks_path(name), {"labels": []})
            assert marks["labels"] == [change.sentence() for frame in newest for change in frame.changes]
            assert (f"| {name} |" in stream.rows[FRAME_LIST]["text"][0]) == bool(newest)
    logged = stream.count
    for cycle in (98, 99):
        logger.log(drawn, Moment(Decision(cycle, (), (), Level.PLAN, (), (), None, None, 0), Mirror()))
    assert stream.count == logged + (not plan), "where nothing changes nothing is logged"


def step(what: str, there: list[Entry[LocaleFrame]], frame: LocaleFrame) -> list[Effect]:
    if what == "come":
        return [Post(frame)]
    if not there:
        return []
    if what == "retract":
        return [Retract(there[-1])]
    if what == "shut" and not there[-1].value.changes:
        return [Revise(there[-1], there[-1].value.changed(SHUT))]
    return [Revise(there[-1], there[-1].value.with_changes(()))] if what == "open" else []
