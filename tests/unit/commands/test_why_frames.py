"""What explanations say of frames, of what was learnt of the robot, and of what was withdrawn."""

from __future__ import annotations

from typing import Any

import pytest

from blackboard import plain
from harvey.replay.why_not_again import Fate, in_run
from logs.explain.model import tell_changes, tell_used
from logs.explain.phrases import Sentence, sentence
from logs.explain.subjects import milestone_story
from logs.explain.web import GROUNDS, MODEL, NAMING, PRINCIPAL, cycle_lines, kind_of
from logs.explain.why import FOLDED, LABELS, SEVERAL, story
from logs.records import OWN, Candidate, DecisionRecord, EntryRecord
from memory_timeline import MemoryTimeline
from world_models.building.locale_frame import FrameChange, FrameReference, FrameRequest
from world_models.entries import Footprint, Milestone, UserReport

SHUT = FrameChange("shut", "library-door", "user")


def entry(
    ref: str, value: Any, because: tuple[str, ...] = (), *, author: str = "source", cycle: int = 1
) -> EntryRecord:
    kind = ref.partition("-")[0]
    change = "Posted" if ref.endswith(".0") else "Revised"
    return EntryRecord(change, ref, kind, author, because, plain(value), cycle, author in ("world", "user", "robot"))


def frame(ref: str, locale: str, *changes: FrameChange, because: tuple[str, ...] = (), cycle: int = 1) -> EntryRecord:
    author = "model_reviser" if changes else "world"
    return entry(ref, FrameReference("0123", locale, changes), because, author=author, cycle=cycle)


def act(number: int, source: str) -> Candidate:
    return Candidate(number, source, "plan", "UserReport-1.0", "Posted", 0.5, 1)


def decision(
    *made: EntryRecord, observed: tuple[EntryRecord, ...] = (), used: tuple[str, ...] = (), cycle: int = 1,
    chosen: Candidate | None = None, activated: tuple[Candidate, ...] = (), pending: int = 0,
) -> DecisionRecord:
    return DecisionRecord(cycle, "plan", observed, (), activated, (), chosen, None, pending, made, "", {}, used)


def test_a_reference_is_told_with_who_said_what() -> None:
    assert sentence(frame("LocaleFrame-1.0", "hallway")) == "what is known of hallway"
    assert sentence(frame("LocaleFrame-1.1", "hallway", SHUT)) == (
        "what is known of hallway; library-door is shut (user)")


@pytest.mark.parametrize(("used", "text", "refs"), [
    ((), None, ()),
    (("Footprint-1.0",), None, ()),
    (("LocaleFrame-1.0",), "what was known of hallway.", ("LocaleFrame-1.0",)),
    (("Footprint-1.1", "LocaleFrame-1.0"),
     "what was known of hallway and by the revised model of the robot itself (Footprint-1.1).",
     ("LocaleFrame-1.0", "Footprint-1.1")),
    (("LocaleFrame-1.0", "LocaleFrame-2.1", "LocaleFrame-3.1"),
     "what was known of library, study and hallway; library-door is shut (user).",
     ("LocaleFrame-2.1", "LocaleFrame-3.1", "LocaleFrame-1.0")),
])
def test_what_an_act_went_by_is_told_shortly(used: tuple[str, ...], text: str | None, refs: tuple[str, ...]) -> None:
    seen = (frame("LocaleFrame-1.0", "hallway"), frame("LocaleFrame-2.1", "library", SHUT),
            frame("LocaleFrame-3.1", "study", SHUT), entry("Footprint-1.1", Footprint(0.36), author="robot"))
    made = entry("Note-1.0", 0)
    found = list(tell_used(MemoryTimeline([decision(made, observed=seen, used=used)]), made))
    assert found == ([] if text is None else [Sentence(f"The act went by {text}", refs, label="known")])


def test_equal_changes_of_two_frames_are_told_once() -> None:
    frames = (frame("LocaleFrame-1.1", "hallway", SHUT), frame("LocaleFrame-2.1", "library", SHUT),
              frame("LocaleFrame-3.0", "study"))
    made = entry("Note-1.0", 0, tuple(f.ref for f in frames))
    (told,) = tell_changes(MemoryTimeline([decision(made, observed=frames)]), made)
    assert told.text == "It was known differently than in the world's file: library-door is shut (user)."
    assert told.refs == (frames[0].ref,)


def test_a_withdrawn_milestone_says_what_it_rested_on() -> None:
    said = entry("UserReport-1.0", UserReport("library-door", "shut"), author="user")
    known = frame("LocaleFrame-1.0", "hallway")
    value = Milestone("", 0, "M1 of hallway", 0.0, ("hallway/pillar-1",), status="expected")
    expected = entry("Milestone-1.0", value, (known.ref,))
    revised = frame("LocaleFrame-1.1", "hallway", SHUT, because=(said.ref, known.ref), cycle=2)
    gone = entry("Milestone-1.1", {**plain(value), "status": "withdrawn"}, (revised.ref,),
                 author="dependency_withdrawer", cycle=3)
    history = MemoryTimeline([
        decision(expected, observed=(said, known)), decision(revised, cycle=2), decision(gone, cycle=3)])
    told = milestone_story(history, "Milestone-1")
    assert [step.label for step in told.steps] == ["expected", "withdrawn", "changed"]
    assert told.steps[1].text == "The dependency withdrawer withdrew it in cycle 3."
    assert told.steps[2].refs == ("LocaleFrame-1.1",)
    texts = {step.label: step.text for step in story(history, gone).steps}
    assert texts["told"] == "It was told that library-door is shut."


def test_an_act_that_asked_is_pending_until_it_acts() -> None:
    """It acted once; before, it had asked."""
    asking, other = act(1, "sketcher"), act(2, "motor")
    decisions = [
        decision(entry("FrameRequest-1.0", FrameRequest(("hallway",)), author="sketcher"), chosen=asking,
                 activated=(asking, other), pending=2),
        decision(entry("Note-1.0", 0, cycle=2), cycle=2, chosen=other, pending=1),
        decision(entry("Note-2.0", 0, cycle=3), cycle=3, chosen=asking),
    ]
    history = MemoryTimeline(decisions)
    assert [[c.number for c in history.candidates(cycle)] for cycle in (1, 2, 3)] == [[1, 2], [2, 1], [1]]
    assert [(one.cycle, one.fate) for one in in_run(history, "sketcher")] == [(3, Fate.ACTED)]
    told = [cycle_lines(one, history.candidates(one.cycle)) for one in decisions]
    assert [sum("sketcher (plan)" in line for line in lines) for lines in told] == [1, 1, 1]


def test_what_is_known_and_told_is_a_ground() -> None:
    for ref in ("LocaleFrame-1.0", "CameraState-1.0", "Wheels-1.0", "Footprint-1.0", "UserReport-1.0"):
        assert kind_of(entry(ref, 0)) == MODEL
    assert kind_of(entry("FrameRequest-1.0", 0)) is None


def test_the_kinds_that_are_told_apart_by_name_are_known() -> None:
    followed = {kind for _, follows in LABELS.values() for kind in follows or ()}
    assert {*LABELS, *followed, *SEVERAL, *FOLDED, *PRINCIPAL, *GROUNDS, *NAMING} <= set(OWN)
