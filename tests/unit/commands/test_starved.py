"""A knowledge source that seldom gets its turn, or is refused, is told of at the end of a run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import harvey
from harvey.campaign.summary import format_result, format_results
from harvey.runner.result import MIN_WOKEN
from logs.explain.story import tell_run
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from world_models.entries import Hypothesis


@harvey.inference(keep=2)
@dataclass(frozen=True, slots=True)
class Note:
    """That it acted."""

    def sentence(self) -> str:
        return "it acted"


class Onlooker(harvey.KnowledgeSource):
    """Woken by each belief."""

    level = harvey.Level.GOAL
    on = (harvey.Watch(Hypothesis),)
    priority = 0.1
    writes = (Note,)

    def act(self, view: harvey.View, case: Any) -> Iterable[harvey.Effect]:
        yield harvey.Post(Note(), (case.entry,))


class Keen(Onlooker):
    """The same, at the level and with a priority by which it gets its turn."""

    level = harvey.Level.ACTION
    priority = 1.0


class Meddler(Keen):
    """Writes what it may not, at the first belief."""

    def act(self, view: harvey.View, case: Any) -> Iterable[harvey.Effect]:
        if case.entry.revision < 2:
            yield harvey.Retract(case.entry, (case.entry,))


@pytest.fixture(scope="module")
def driven(may_refuse: None, tmp_path_factory: pytest.TempPathFactory) -> tuple[harvey.MissionResult, RunDirectory]:
    run = RunDirectory(tmp_path_factory.mktemp("starved") / "run")
    return harvey.run("forty-foot-hallway", seed=0, out=run.path, knowledge_sources=[Onlooker, Keen, Meddler]), run


def test_who_starves_is_told_at_the_end(driven: tuple[harvey.MissionResult, RunDirectory]) -> None:
    result, run = driven
    (told,) = result.starved
    assert told.startswith("onlooker acted ") and "at the goal level, rated 0.10 at most" in told
    assert f"  starved       {told}\n" in format_result(result, None)
    assert run.read_result()["starved"] == [told]
    story = tell_run(run, Timeline(run.journal))
    assert any(one.text.startswith("Onlooker acted ") for one in story.sections[-1].steps)


def test_what_was_refused_is_told_at_the_end(driven: tuple[harvey.MissionResult, RunDirectory]) -> None:
    (told,) = driven[0].refused
    assert told == "meddler was refused: meddler may not write Hypothesis (2 times)"
    assert f"  refused       {told}\n" in format_result(driven[0], None)
    assert f"seed 0: {told}" in format_results(driven[:1])


def test_what_decisions_yields_is_exported(driven: tuple[harvey.MissionResult, RunDirectory]) -> None:
    result, run = driven
    decisions = list(harvey.open_run(run.path, knowledge_sources=[Onlooker, Keen, Meddler]).decisions())
    assert all(isinstance(decision, harvey.DecisionRecord) for decision in decisions)
    woken = [one for decision in decisions for one in decision.activated if one.source == "onlooker"]
    acted = [decision for decision in decisions if decision.chosen and decision.chosen.source == "onlooker"]
    assert len(woken) > MIN_WOKEN and isinstance(woken[0], harvey.Candidate)
    assert result.starved[0].startswith(f"onlooker acted {len(acted)} time")
    assert isinstance(decisions[0].observed[0], harvey.EntryRecord)


def test_nobody_starves_where_there_is_no_other_package(tmp_path: Path) -> None:
    assert harvey.run("forty-foot-hallway", seed=0, out=tmp_path / "run").starved == ()
