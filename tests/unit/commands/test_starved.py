"""A knowledge source of another package that seldom gets its turn is told of at the end of a run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import harvey
from harvey.campaign.summary import format_result
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


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> tuple[harvey.MissionResult, RunDirectory]:
    run = RunDirectory(tmp_path_factory.mktemp("starved") / "run")
    return harvey.run("forty-foot-hallway", seed=0, out=run.path, knowledge_sources=[Onlooker, Keen]), run


def test_who_starves_is_told_at_the_end(driven: tuple[harvey.MissionResult, RunDirectory]) -> None:
    result, run = driven
    (told,) = result.starved
    assert told.startswith("onlooker acted ") and "at the goal level, rated 0.10 at most" in told
    assert f"  starved       {told}\n" in format_result(result, None)
    assert run.read_result()["starved"] == [told]
    story = tell_run(run, Timeline(run.journal))
    assert any(one.text.startswith("Onlooker acted ") for one in story.sections[-1].steps)


def test_what_decisions_yields_is_exported(driven: tuple[harvey.MissionResult, RunDirectory]) -> None:
    result, run = driven
    decisions = list(harvey.open_run(run.path, knowledge_sources=[Onlooker, Keen]).decisions())
    assert all(isinstance(decision, harvey.DecisionRecord) for decision in decisions)
    woken = [one for decision in decisions for one in decision.activated if one.source == "onlooker"]
    acted = [decision for decision in decisions if decision.chosen and decision.chosen.source == "onlooker"]
    assert len(woken) > MIN_WOKEN and isinstance(woken[0], harvey.Candidate)
    assert result.starved[0].startswith(f"onlooker acted {len(acted)} time")
    assert isinstance(decisions[0].observed[0], harvey.EntryRecord)


def test_nobody_starves_where_there_is_no_other_package(tmp_path: Path) -> None:
    assert harvey.run("forty-foot-hallway", seed=0, out=tmp_path / "run").starved == ()
