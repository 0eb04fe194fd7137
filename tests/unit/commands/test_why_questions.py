"""Questions in words about things in the way are answered from the journal."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from blackboard.journal import plain
from harvey.errors import BadInput
from logs.explain.questions_in_words import answers, is_question
from logs.records import DecisionRecord, EntryRecord
from memory_timeline import MemoryTimeline
from world_models.building.locale_frame import FrameChange, FrameReference
from world_models.entries.body import CameraPicture
from world_models.entries.door_state import DoorPicture, DoorState
from world_models.entries.obstacle import Obstacle
from world_models.entries.task import Outcome, PlanSketch

SQUARE = ((0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (0.0, 0.5))
BOX = Obstacle("hallway/obstacle-1", "hallway", SQUARE, 0.05, 0.25, 0.25, 0.5, certainty=0.7, by="camera",
               evidence="CameraPicture-3, pixels (10, 20) to (30, 40): it does not look like the floor",
               status="suspected")
THERE = replace(BOX, status="there", certainty=0.99)
PICTURE = DoorPicture("CameraPicture-3", (10.0, 20.0, 30.0, 40.0), 0.0, 0.0, 0.0, 3.0, "a leaf")
DOOR = DoorState("library-door", ("hallway", "library"), "shut", 0.99, 4.0, 2, PICTURE, 5.0)
EXTRA = FrameChange("extra", "hallway/obstacle-1", "thing_mapper", SQUARE)


def entry(ref: str, value: Any, because: tuple[str, ...] = (), cycle: int = 1) -> EntryRecord:
    change = "Posted" if ref.endswith(".0") else "Revised"
    return EntryRecord(change, ref, ref.partition("-")[0], "source", because, plain(value), cycle, False)


def history(*records: EntryRecord) -> MemoryTimeline:
    return MemoryTimeline(DecisionRecord(
        record.cycle, "plan", (), (), (), (), None, None, 0, (record,), "", {}, ()) for record in records)


SKETCH = PlanSketch("Goal-1", (), "hallway", (), status="superseded")
RUN = history(
    entry("CameraPicture-3.0", CameraPicture(b"", 3, 1.0), (), 1),
    entry("Obstacle-1.0", BOX, ("CameraPicture-3.0",), 2),
    entry("Obstacle-1.1", THERE, ("CameraPicture-3.0",), 3),
    entry("LocaleFrame-1.1", FrameReference("0123", "hallway", (EXTRA,)), ("Obstacle-1.1",), 4),
    entry("DoorState-1.0", DOOR, ("CameraPicture-3.0",), 6),
    entry("Outcome-1.0", Outcome("blocked", "library-door is shut"), ("DoorState-1.0",), 7))


def test_names_of_entries_and_doors_are_no_questions() -> None:
    assert is_question("what is in the way?") and is_question("why that detour")
    assert not any(map(is_question, ("MotorCommand-12", "allens-office/desk", "library-door")))


def test_what_is_in_the_way_is_told_down_to_pixels() -> None:
    (story,) = answers(RUN, "what is in the way?")
    assert story.ref == "Obstacle-1.1" and "at (0.25, 0.25) m of hallway is in the way" in story.headline
    texts = [step.text for step in story.steps]
    assert any("pixels (10, 20) to (30, 40)" in text for text in texts)
    assert "What is known of hallway had it from cycle 4 on." in texts
    assert any("CameraPicture-3.0" in step.refs for step in story.steps)


def test_with_a_cycle_it_is_told_as_it_was_known_then() -> None:
    (story,) = answers(RUN, "what is in the way?", 2)
    assert story.ref == "Obstacle-1.0" and "may be in the way" in story.headline
    (story,) = answers(RUN, "what is in the way?", 1)
    assert story.headline == "Up to cycle 1: nothing that the model lacks was found in the way."


def test_a_shut_door_is_told_with_its_pictures() -> None:
    (story,) = answers(RUN, "is the door shut?")
    assert story.headline.startswith("Library-door is shut")
    assert "CameraPicture-3, pixels (10, 20) to (30, 40), showed a leaf" in story.steps[0].text


def test_a_stop_is_told_with_the_door_that_it_is_for() -> None:
    (story,) = answers(RUN, "why did you stop there?")
    assert "blocked" in story.headline
    assert [step.label for step in story.steps] == ["door"]


def test_where_nothing_happened_that_is_said() -> None:
    assert [story.headline for story in answers(history(), "why that detour?")] == [
        "It took no detour: no plan was withdrawn for anything in the way."]


def test_another_question_is_answered_with_those_that_are_known() -> None:
    with pytest.raises(BadInput, match="expected a question as 'what is in the way"):
        list(answers(RUN, "what time is it?"))
