"""Questions in words about things in the way are answered from the journal."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from blackboard import plain
from harvey.errors import BadInput
from logs.explain.in_short import measure_gaps
from logs.explain.questions_in_words import QUESTIONS, answers, is_question
from logs.records import DecisionRecord, EntryRecord
from memory_timeline import MemoryTimeline
from world_models.building.locale_frame import FrameChange, FrameReference
from world_models.entries import (
    CameraPicture,
    DoorPicture,
    DoorState,
    MotorCommand,
    Obstacle,
    Outcome,
    Place,
    PlanSketch,
    Subgoal,
)

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


@pytest.mark.parametrize(("here", "gaps"), [((-2.0, 0.25), (1.25, 0.5)), ((0.25, 3.0), (0.5, 3.0))])
def test_the_room_beside_a_thing_is_measured_to_the_next_thing_or_wall(here: Any, gaps: Any) -> None:
    room, cupboard, bin_ = (np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]) for x0, y0, x1, y1 in (
        (-3.0, -1.0, 1.0, 4.0), (0.2, 1.75, 0.4, 2.0), (-0.5, -1.0, 1.0, -0.5)))
    world: Any = SimpleNamespace(outline=lambda _: room, obstacles=lambda _: [cupboard])
    assert measure_gaps(world, THERE, [bin_], np.array(here)) == pytest.approx(gaps)


@pytest.mark.parametrize(("question", "told"), [
    ("what did it think?", "hallway/obstacle-1"), ("why not round it?", "0.5 m wide"), ("how sure was it?", "belief")])
def test_what_it_thought_and_how_surely_is_told_also_where_it_had_no_belief(question: str, told: str) -> None:
    assert any(told in str(story) for story in answers(RUN, question))


def test_only_a_move_that_creeps_is_a_stop() -> None:
    told = history(entry("MotorCommand-1.0", MotorCommand(0.0, 0.6, 0.4), (), 1),
                   entry("MotorCommand-2.0", MotorCommand(0.0, 0.3, 0.09), (), 2),
                   entry("MotorCommand-3.0", MotorCommand(0.2, 0.0), (), 3))
    (story,) = answers(told, "why did you stop?")
    assert story.ref == "MotorCommand-2.0" and "slowly, at 0.09 m/s" in story.headline
    assert "slowly" not in MotorCommand(0.0, 0.6, 0.4).sentence()


def test_what_went_wrong_and_how_it_ended_are_told() -> None:
    assert any("library-door is shut" in story.headline for story in answers(RUN, "what went wrong?"))
    assert any("library-door is shut" in story.headline for story in answers(RUN, "how did it end?"))
    (cut,) = answers(history(entry("CameraPicture-3.0", CameraPicture(b"", 3, 1.0))), "what went wrong?")
    assert cut.headline == "Nothing had gone wrong when the run was cut off."
    (nobody,) = answers(RUN, "what was done to it?")
    assert "there is no result of the simulator" in nobody.headline


def test_where_nothing_happened_that_is_said() -> None:
    assert [story.headline for story in answers(history(), "why that detour?")] == [
        "It took no detour: no plan was withdrawn for anything in the way."]


def test_a_detour_is_told_with_the_plan_before_and_after_and_what_lay_between() -> None:
    def plan(*points: tuple[float, float]) -> tuple[Subgoal, ...]:
        places = [Place("hallway", x, y) for x, y in points]
        return tuple(Subgoal(one, other, True) for one, other in pairwise(places))

    old = PlanSketch("Goal-1", (1,), "hallway", plan((-1.0, 0.15), (2.0, 0.15)))
    told = history(
        entry("CameraPicture-3.0", CameraPicture(b"", 3, 1.0), (), 1),
        entry("PlanSketch-1.0", replace(old, path=(), locale=""), (), 2),
        entry("PlanSketch-2.0", old, (), 3),
        entry("Obstacle-1.0", THERE, ("CameraPicture-3.0",), 4),
        entry("LocaleFrame-1.1", FrameReference("0123", "hallway", (EXTRA,)), ("Obstacle-1.0",), 5),
        entry("PlanSketch-2.1", replace(old, status="superseded"), ("LocaleFrame-1.1",), 6),
        entry("PlanSketch-3.0", replace(old, path=(), locale=""), (), 7),
        entry("PlanSketch-4.0", replace(old, subgoals=plan((-1.0, 0.15), (0.2, 0.9), (2.0, 0.15))), (), 8))
    for question in ("why that detour?", "why did it go another way?", "why was the plan withdrawn?"):
        (story,) = answers(told, question)
        steps = {step.label: step.text for step in story.steps}
        assert story.headline == "In cycle 6 it planned another way through hallway."
        assert steps["before"] == "It was to go to (2.00, 0.15) m of hallway."
        assert "its middle is 0.10 m from the line of that plan" in steps["between"]
        assert steps["after"] == "In cycle 8 it was to go to (0.20, 0.90) m of hallway, then (2.00, 0.15) m of hallway."


@pytest.mark.parametrize(("question", "word"), [
    ("is it raining there?", "raining"), ("is the garage-door shut?", "garage-door"),
    ("why did you stop at the pub?", "pub"), ("how far off is the moon?", "moon")])
def test_a_question_with_a_word_that_says_nothing_is_refused_with_the_nearest(question: str, word: str) -> None:
    with pytest.raises(BadInput, match=f"'{word}' said nothing"):
        answers(RUN, question)


@pytest.mark.parametrize("question", QUESTIONS)
def test_the_questions_that_are_named_are_understood(question: str) -> None:
    assert question.startswith("how far") or list(answers(RUN, question))


def test_the_nearest_question_is_named_first() -> None:
    with pytest.raises(BadInput, match=r"expected a question as 'is the door shut\?', "):
        answers(RUN, "is the garage-door shut?")
