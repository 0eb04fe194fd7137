"""The story of whole missions: a good one, a kidnap, a bump, one that is blocked and one that stays lost."""

from __future__ import annotations

import json
import math
import re
import shutil
from dataclasses import asdict
from pathlib import Path

import pytest

from docs.tools.moments import moments_of
from harvey.campaign.mission_task import Task, run_task
from harvey.cli import main
from headless_viewer import look_or_skip
from logs.explain.story import RunStory, story_lines, tell_run
from logs.explain.true_errors import read_errors
from logs.explain.turning_points import read_turning_points
from logs.reader import read_series
from logs.recording.paths import POSITION
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from recorded_runs import BUMP, Recorded
from world_models.entries import Certificate, Contact

TOLD_SHUT = """
description = "To Allen's office; that its door is shut is told at once."
world = "research_center"
details = ["research_center_details"]
goal = "(ptrans (hallway (68,4,0)) (allens-office (13,12,0)))"

[start]
heading_deg = 0.0
put_down_sigma_m = 0.02
put_down_sigma_deg = 1.0

[[told]]
what = "allens-door"
state = "shut"
at_s = 0.0
"""
RECORDED = {"across-allens-office": "office", "kidnapped": "kidnap", "bumped": "bump"}
SCENARIOS = {"blocked": (TOLD_SHUT, ()), "lost": (BUMP, (("servo.goal", "off"),))}
OUTCOMES = dict.fromkeys(RECORDED, "reached") | {name: name for name in SCENARIOS}
CYCLE = re.compile(r"cycles? (\d+)")


@pytest.fixture(scope="module", params=OUTCOMES)
def told(
    request: pytest.FixtureRequest, recorded: Recorded, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, Path]:
    name: str = request.param
    if name in RECORDED:
        return name, recorded(RECORDED[name]).path
    folder = tmp_path_factory.mktemp(name)
    text, settings = SCENARIOS[name]
    scenario = folder / f"{name}.toml"
    scenario.write_text(text, encoding="utf-8")
    assert run_task(Task(str(scenario), settings, 0, folder / "run")).outcome == OUTCOMES[name]
    return name, folder / "run"


@pytest.fixture(scope="module")
def history(told: tuple[str, Path]) -> Timeline:
    return Timeline(told[1] / "journal.jsonl")


@pytest.fixture(scope="module")
def story(told: tuple[str, Path], history: Timeline) -> RunStory:
    return tell_run(RunDirectory(told[1]), history)


def test_no_view_of_its_recording_reports_anything(told: tuple[str, Path], tmp_path: Path) -> None:
    """A real viewer without a window draws each run at its turning points."""
    recording = told[1] / "recording.rrd"
    cycles = [moment.cycle for moment in moments_of(recording, 2)]
    assert cycles
    assert look_or_skip(recording, tmp_path / "pictures", cycles) == []
    assert {path.name for path in (tmp_path / "pictures").iterdir()} == {f"cycle-{cycle}.png" for cycle in cycles}


def test_it_tells_how_the_run_went(told: tuple[str, Path], story: RunStory) -> None:
    name, _ = told
    page = "\n".join(story_lines(story))
    assert page.startswith(f"{name}, seed {3 if name == 'across-allens-office' else 0}: {OUTCOMES[name]} in cycle ")
    assert ("It was lost: " in page) is (name in ("kidnapped", "bumped", "lost"))
    assert ("It found out where it was, " in page) is (name in ("kidnapped", "bumped"))
    assert ("It did not find out where it was." in page) is (name == "lost")
    assert ("allens-door" in page.partition("How it ended")[2]) is (name == "blocked")


def test_each_sentence_has_a_cycle_of_the_journal_and_entries_that_it_made(
    story: RunStory, history: Timeline
) -> None:
    sentences = [sentence for section in story.sections for sentence in section.steps]
    known = set(history.refs)
    for sentence in sentences:
        assert sentence.cycle is None or sentence.cycle in history.cycles
        assert set(sentence.refs) <= known
        assert {int(number) for number in CYCLE.findall(sentence.text)} <= set(history.cycles)
    for ref, cycle in ((ref, sentence.cycle) for sentence in sentences for ref in sentence.refs[:1]):
        assert (history.entry(ref) or pytest.fail(ref)).cycle == cycle
    assert {row.cycle for row in story.milestones} <= set(history.cycles)
    assert {point.cycle for point in story.turning_points} <= set(history.cycles)


def test_the_turning_points_are_those_that_the_run_found(told: tuple[str, Path], history: Timeline) -> None:
    kept = RunDirectory(told[1]).read_result()["turning_points"]
    read = [point for point in read_turning_points(history) if point.is_main]
    assert read == [*read_turning_points(history, main=True)]
    assert [(p.cycle, p.kind, p.text, p.time_s) for p in read] == [
        (p["cycle"], p["kind"], p["text"], p["time_s"]) for p in kept]


def test_every_verdict_of_the_journal_is_a_row(story: RunStory, history: Timeline) -> None:
    certificates = [record for record in history.of_kind(Certificate) if record.change == "Posted"]
    judged = [row for row in story.milestones if row.p_wrong is not None]
    told = [(row.cycle, row.verdict, row.matched, row.expected, row.p_wrong, row.most_p_wrong) for row in judged]
    figures = "verdict", "matched", "expected", "p_wrong", "most_p_wrong"
    assert told == [(r.cycle, *(r.fields[name] for name in figures)) for r in certificates]
    ids = {ref.rpartition(".")[0] for row in story.milestones for ref in row.refs if ref.startswith("Milestone-")}
    assert ids == {id for id in history.newest if id.startswith("Milestone-")}


def test_each_contact_is_told_with_its_cycle(told: tuple[str, Path], story: RunStory, history: Timeline) -> None:
    felt = [record.cycle for record in history.of_kind(Contact)]
    truly = [contact["cycle"] for contact in RunDirectory(told[1]).read_result()["contacts"]]
    (section,) = (section for section in story.sections if section.headline == "What it touched")
    assert [s.cycle for s in section.steps if s.cycle is not None] == [*felt, *truly]
    assert all(re.search(r"\(-?[0-9.]+, -?[0-9.]+\) m", s.text) for s in section.steps if s.cycle is not None)


def test_as_json_it_is_whole(told: tuple[str, Path], story: RunStory, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["story", str(told[1]), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(json.dumps(asdict(story)))


def test_what_it_says_of_the_truth_comes_from_the_result_alone(told: tuple[str, Path], tmp_path: Path) -> None:
    shutil.copytree(told[1], tmp_path / "run")
    run = RunDirectory(tmp_path / "run")
    run.result.unlink()
    page = "\n".join(story_lines(tell_run(run, Timeline(run.journal))))
    assert "In truth" not in page and "collision" not in page and "there is no result of the simulator" in page


def test_how_far_off_it_was_is_what_the_recording_has_drawn(told: tuple[str, Path], history: Timeline) -> None:
    run = RunDirectory(told[1])
    drawn = dict(read_series(run.recording, POSITION, "Measurements:values"))
    errors = {error.cycle: error for error in read_errors(run, history)}
    assert errors and errors.keys() <= drawn.keys()
    for cycle, values in drawn.items():  # it is drawn also where a candidate is posted beside the belief
        (error,) = [errors[cycle]] if cycle in errors else read_errors(run, history, cycle)
        assert 1e3 * error.off_m == pytest.approx(math.hypot(*values), abs=0.01)
    assert read_errors(run, history, max(errors)) == [errors[max(errors)]]


def test_without_the_recording_nothing_is_said_of_the_truth(
    told: tuple[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(told[1], tmp_path / "run")
    RunDirectory(tmp_path / "run").recording.unlink()
    assert main(["why", str(tmp_path / "run"), "how far off was it?"]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and "harvey repair" in printed.err
