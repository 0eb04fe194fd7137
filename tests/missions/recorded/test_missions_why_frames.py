"""Why, down to the locale frames and the world's file: on a mission that is told on the way that a door is shut."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from harvey.cli import main
from harvey.replay.why_not_again import Fate, in_cycle, in_run
from logs.explain.model import WorldFile
from logs.explain.phrases import Sentence, Story, describe_decision
from logs.explain.why import lines_of, story
from logs.run_directory import RunDirectory
from logs.run_head import RunHead
from logs.timeline import Timeline
from recorded_runs import Recorded
from world_models.files.toml.mission import ROOT
from world_models.frame_store import FrameStore, elements_of

DOOR = "archive-north-door"
WHERE = re.compile(r"([\w-]+)(?: of ([\w-]+))? \(([\w/.-]+):(\d+)\)")


@pytest.fixture(scope="module")
def run(recorded: Recorded) -> RunDirectory:
    return recorded("shut door")


@pytest.fixture(scope="module")
def history(run: RunDirectory) -> Timeline:
    return Timeline(run.journal)


@pytest.fixture(scope="module")
def store(run: RunDirectory) -> FrameStore:
    head = RunHead.read(run.path)
    return FrameStore(head.load_world(), head.world_sha256)


def told(history: Timeline, ref: str, run: RunDirectory | None = None) -> Story:
    record = history.entry(ref)
    assert record is not None
    return story(history, record, None if run is None else WorldFile(run))


def value_in(history: Timeline, ref: str) -> dict[str, Any]:
    record = history.entry(ref)
    assert record is not None
    return dict(record.fields)


def step(of: Story, label: str) -> Sentence:
    found = next((one for one in of.steps if one.label == label), None)
    assert found is not None, f"{of.ref} tells no {label!r}"
    return found


def test_a_turn_goes_back_to_model_lines_their_frames_and_lines_of_the_file(
    run: RunDirectory, history: Timeline, store: FrameStore
) -> None:
    turns = [ref for ref in history.refs if ref.startswith("MotorCommand-")]
    told_lines = 0
    for ref in turns:
        found = told(history, ref, run)
        model = step(found, "model")
        held = {value_in(history, frame)["locale"] for frame in model.refs}
        names = elements_of_all(store, held)
        for thing, locale, file, line in WHERE.findall(model.text):
            name = f"{locale}/{thing}" if locale else thing
            assert name in names
            assert names[name] == f"{ROOT / file}:{line}"
            told_lines += 1
        assert "matched" in {one.label for one in found.steps}
    assert told_lines > len(turns) > 5


def elements_of_all(store: FrameStore, locales: set[str]) -> dict[str, str]:
    """Landmarks of some locales by name, with file:line as the world has it."""
    frames = [store.frame(locale) for locale in locales]
    assert all(elements_of(frame) for frame in frames)
    return {mark.name: mark.source for frame in frames for part in frame.parts for _, mark in part.landmarks}


def test_a_story_says_by_which_frames_the_act_went(history: Timeline) -> None:
    for decision in history.decisions():
        for record in decision.made:
            known = [one for one in told(history, record.ref).steps if one.label == "known"]
            frames = {ref for one in known for ref in one.refs}
            assert frames <= set(decision.used)
            is_told = any(ref.startswith("LocaleFrame-") or not ref.endswith(".0") for ref in decision.used)
            assert bool(known) == is_told
            assert not any(ref.endswith(".0") and not ref.startswith("LocaleFrame-") for ref in frames)


def test_an_act_that_asked_waits_and_comes_again(history: Timeline) -> None:
    asked = [decision for decision in history.decisions() if decision.asks is not None]
    assert len(asked) >= 4
    for decision in asked:
        assert decision.chosen is not None and decision.asks is not None
        fates = [one.fate for one in in_cycle(history, decision.chosen.source, decision.cycle)]
        assert Fate.ASKED in fates and Fate.ACTED not in fates
        answer = step(told(history, decision.asks.ref), "answered")
        assert re.search(r"came again in cycle \d+: it made [A-Z]", answer.text)
    goal = history.entry("Goal-1.0")
    assert goal is not None
    assert "It had waited for an answer first: it asked for what is known of reception (FrameRequest-1.0)" in (
        describe_decision(history, goal))


def test_what_was_pending_is_known_where_acts_wait(history: Timeline) -> None:
    for decision in history.decisions():
        found = history.candidates(decision.cycle)
        chosen = decision.chosen
        assert len(found) == decision.pending + (chosen is not None and decision.asks is None)
        assert chosen is None or found[0].number == chosen.number
    acted = [one for one in in_run(history, "interpreter") if one.fate is Fate.ACTED]
    assert [one.why for one in acted] == ["it was the best there was, rated 1.00"]


def test_a_sketch_drawn_anew_goes_back_to_what_was_told(run: RunDirectory, history: Timeline) -> None:
    superseded = next(ref for ref in history.refs if ref.startswith("PlanSketch-")
                      and value_in(history, ref)["status"] == "superseded")
    route = value_in(history, superseded)["path"]
    drawn = [ref for ref in history.refs if re.fullmatch(r"PlanSketch-\d+\.0", ref)
             and value_in(history, ref)["path"] == route]
    for ref in (superseded, drawn[-1]):
        found = told(history, ref, run)
        assert f"{DOOR} is shut (user)" in step(found, "changed").text
        assert step(found, "told").refs == ("UserReport-1.0",)
    assert main(["why", str(run.path)]) == 0


def test_a_door_a_landmark_and_a_room_are_answered_by_name(
    run: RunDirectory, history: Timeline, store: FrameStore, capsys: pytest.CaptureFixture[str]
) -> None:
    def said(name: str) -> str:
        assert main(["why", str(run.path), name]) == 0
        return " ".join(capsys.readouterr().out.split())

    door = said(DOOR)
    assert f"{DOOR} is described in world_models/worlds/two_ways.toml:" in door
    assert f"the model reviser wrote: {DOOR} is shut (user). [LocaleFrame-2.1, UserReport-1.0, LocaleFrame-2.0]" in door
    assert "LocaleFrame-4.1" in door and "PlanSketch-1.0" in door
    milestone = history.entry("Milestone-1.1")  # what is expected of it stands in its first revision
    assert milestone is not None
    landmark = next(name for name in milestone.fields["landmarks"] if "/" in name)
    assert "[Milestone-1." in said(landmark)
    locale = landmark.partition("/")[0]
    line = store.world.locale(locale).source.rpartition(":")[2]
    assert f"{locale} is described in world_models/worlds/two_ways.toml:{line}" in said(locale)


def test_a_name_that_nothing_has_is_answered_with_near_ones(
    run: RunDirectory, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["why", str(run.path), "north-hall/stor"]) == 2
    assert "north-hall/store" in capsys.readouterr().err
    assert main(["why", str(run.path), "Gaol"]) == 2
    assert "Goal-1" in capsys.readouterr().err


@pytest.mark.parametrize("lost", ["the head", "the world"])
def test_without_the_worlds_file_it_answers_and_says_so(
    run: RunDirectory, history: Timeline, tmp_path: Path, capsys: pytest.CaptureFixture[str], lost: str
) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(run.path, copy)
    if lost == "the head":
        (copy / "run.json").unlink()
    else:
        head = json.loads((copy / "run.json").read_text(encoding="utf-8"))
        (copy / "run.json").write_text(json.dumps({**head, "world": "nowhere.toml"}), encoding="utf-8")
    for name in ("MotorCommand-2", "reception-north-door", "north-hall", "LocaleFrame-4"):
        assert main(["why", str(copy), name]) == 0
        out = " ".join(capsys.readouterr().out.split())
        assert "cannot be told: " in out
        assert ("run.json" if lost == "the head" else "nowhere.toml") in out
    model = step(told(history, "MotorCommand-2.0", RunDirectory(copy)), "model")
    assert "come from what is known of " in model.text and model.refs
    assert "\n".join(lines_of(told(history, "MotorCommand-2.0")))
