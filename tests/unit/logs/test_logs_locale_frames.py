"""The frames on the board are seen in the recording: as they come, as they change, and as they leave."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blackboard import Blackboard, Change, Decision, Effect, Level, Post, Ref, Revise
from journals import logged
from logs.reader import read_series
from logs.recording.loggers.decisions import Messages
from logs.recording.loggers.surroundings.locale_frames import (
    HEADER,
    MAX_LISTED,
    Known,
    describe,
    marks_path,
    outline_path,
)
from logs.recording.palette import KNOWN, REVISED
from logs.recording.paths import FRAME_LIST
from logs.recording.writer import RecordingWriter
from scripted_mission import CAMERA, MOUNT
from two_doors import WORLD
from world_models.actuator import ActuatorModel
from world_models.building.locale_frame import FRAME_OF, FrameChange, FrameRequest, LocaleFrame
from world_models.building.world import World
from world_models.entries import CameraState, Footprint, Wheels
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frame_store import FrameStore
from world_models.robot import RobotModel

STUDY, PARLOUR = outline_path("study"), outline_path("parlour")
ACTUATOR = ActuatorModel()
SHUT, GONE = FrameChange("shut", "north-door", "user"), FrameChange("gone", "study/table-1", "timetable")


@pytest.fixture(scope="module")
def world() -> World:
    return read_world(Source.parse(WORLD, "two_doors.toml"))


class Told:
    """A board of which a recorder is told, one decision a cycle."""

    def __init__(self, recorder: RecordingWriter) -> None:
        self.board, self._recorder, self._cycle = Blackboard(), recorder, 0

    def decide(self, effects: Iterable[Effect], author: str, left: Sequence[Ref] = ()) -> tuple[Change, ...]:
        self._cycle += 1
        made = self.board.apply(effects, author=author, cycle=self._cycle)
        for ref in left:
            self.board.forget(ref.id)
        self._recorder(Decision(self._cycle, (), (), Level.PLAN, (), (), None, None, 0, made, left=tuple(left)))
        return made

    def frame(self, name: str) -> Any:
        entry = self.board.view.newest(FRAME_OF, name)
        assert entry is not None
        return entry


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory, world: World) -> Path:
    """1: the robot; 2: asked; 3: two frames come; 4, 5, 8: one is revised; 6: the other leaves; 7: it comes back."""
    path = tmp_path_factory.mktemp("frames") / "recording.rrd"
    recorder = RecordingWriter(path, world=world, camera=CAMERA, mount=MOUNT, title="frames", recording_id="frames")
    store, told = FrameStore(world, "a file"), Told(recorder)
    told.decide([Post(entry) for entry in RobotModel(world, CAMERA, MOUNT, ACTUATOR).entries()], "robot")
    (request,) = told.decide([Post(FrameRequest(("study", "parlour")))], "sketcher")
    frames, answered = store.answer(request.entry.value)
    told.decide([*(Post(frame, (request.entry,)) for frame in frames), Revise(request.entry, answered)], "world")
    for change in (SHUT, GONE):
        study = told.frame("study")
        told.decide([Revise(study, study.value.changed(change))], "model_reviser")
    told.decide([], "nobody", left=[told.frame("parlour").ref])
    told.decide([Post(store.frame("parlour"))], "what if")
    study = told.frame("study")
    told.decide([Revise(study, study.value.with_changes(()))], "model_reviser")
    recorder.close()
    return path


def colours(recording: Path, entity: str) -> list[tuple[int, tuple[int, ...]]]:
    return [(cycle, tuple(int(value[0]).to_bytes(4, "big")))
            for cycle, value in logged(recording, entity, "LineStrips3D:colors")]


def test_a_room_is_outlined_from_the_cycle_in_which_its_frame_comes_until_it_leaves(
    recording: Path, world: World
) -> None:
    rows = logged(recording, PARLOUR, "LineStrips3D:strips")
    assert [(cycle, len(strips)) for cycle, strips in rows] == [(3, 1), (6, 0), (7, 1)]
    ring = np.array(rows[0][1][0])
    assert np.allclose(ring[:-1, :2], world.outline("parlour"), atol=1e-5) and np.array_equal(ring[0], ring[-1])


def test_a_revised_room_has_another_colour_and_gets_its_own_back(recording: Path) -> None:
    assert colours(recording, STUDY) == [(3, KNOWN), (4, REVISED), (5, REVISED), (8, KNOWN)]
    assert all(colour == KNOWN for _, colour in colours(recording, PARLOUR))


def test_a_shut_door_is_barred_and_a_thing_that_is_gone_is_struck_out(recording: Path, world: World) -> None:
    labels = logged(recording, marks_path("study"), "LineStrips3D:labels")
    shut, gone = "north-door is shut (user)", "study/table-1 is gone (timetable)"
    assert labels == [(4, [shut]), (5, [shut, gone]), (8, [])]
    strips = dict(logged(recording, marks_path("study"), "LineStrips3D:strips"))
    bar, cross = (np.array(strip)[:, :2] for strip in strips[5])
    door = next(door for door in world.doorways if door.name == "north-door")
    assert np.allclose(bar.mean(axis=0), door.centre_world, atol=1e-5)
    assert np.linalg.norm(bar[1] - bar[0]) == pytest.approx(door.width_m, abs=1e-5)
    table = next(thing for thing in FrameStore(world, "a file").frame("study").things if thing.name == "study/table-1")
    assert np.allclose(cross[[0, 3, 1, 4]], table.footprint_world, atol=1e-5)


def test_the_list_has_who_asked_since_when_and_what_is_believed_otherwise(recording: Path) -> None:
    lists = dict(read_series(recording, FRAME_LIST, "TextDocument:text"))
    assert list(lists) == [1, 3, 4, 5, 6, 7, 8], "only when something changes"
    assert HEADER not in lists[1] and "No frame is on the board." in lists[1]
    for kind in (CameraState, Wheels, Footprint):
        assert f"({kind.__name__}-1.0, by robot)" in lists[1]
    assert "| study | LocaleFrame-1.0 | 3 | sketcher |  |" in lists[3]
    assert "| parlour | LocaleFrame-2.0 | 3 | sketcher |  |" in lists[3]
    changes = "north-door is shut (user); study/table-1 is gone (timetable)"
    assert f"| study | LocaleFrame-1.2 | 3, revised in 5 | sketcher | {changes} |" in lists[5]
    assert "parlour" not in lists[6]
    assert "| parlour | LocaleFrame-3.0 | 7 | what if |  |" in lists[7]
    assert "| study | LocaleFrame-1.3 | 3, revised in 8 | sketcher |  |" in lists[8]


def test_a_long_list_has_what_is_believed_otherwise_first_and_says_how_much_is_left_out(world: World) -> None:
    store, board = FrameStore(world, "a file"), Blackboard()
    frames = [store.frame("parlour")] * (MAX_LISTED + 2) + [store.frame("study").changed(SHUT)]
    posted = board.apply([Post(frame) for frame in frames], author="world", cycle=1)
    text = describe([Known(change.entry, 1, "sketcher") for change in posted], [])
    assert text.splitlines()[2].startswith("| study |")
    assert text.count("LocaleFrame-") == MAX_LISTED and "... and 3 frames more" in text


def said(changes: Iterable[Change]) -> list[str]:
    messages = Messages()
    return [text for change in changes if (text := messages.message(change))]


def test_an_answer_is_one_clause_however_many_frames_it_brings(world: World) -> None:
    store, board = FrameStore(world, "a file"), Blackboard()
    asked = board.apply([Post(FrameRequest(("", "study", "cellar"), elements=("north-door",)))], author="x", cycle=1)
    assert said(asked) == ["asks what is known of the whole building, study and cellar and where north-door is"]
    frames, answered = store.answer(asked[0].entry.value)
    told = board.apply([*map(Post, frames), Revise(asked[0].entry, answered)], author="world", cycle=1)
    (answer,) = said(told)
    assert answer.startswith("answer: what is known of the whole building and study, north-door is in ")
    assert "cellar" in answer


def test_a_revised_frame_is_told_by_what_is_believed_otherwise(world: World) -> None:
    board, frame = Blackboard(), FrameStore(world, "a file").frame("study")
    (posted,) = board.apply([Post(frame)], author="world", cycle=1)
    changed: LocaleFrame = frame.changed(SHUT)
    (shut,) = board.apply([Revise(posted.entry, changed)], author="model_reviser", cycle=2)
    (again,) = board.apply([Revise(shut.entry, changed.with_changes(()))], author="model_reviser", cycle=3)
    assert said([posted, shut, again]) == [
        "believes of study: north-door is shut (user)", "believes of study again what the file says"]
