"""Asked on its way to go elsewhere: by the mission's file, or by somebody while the run goes on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from blackboard import Decision, Retracted, Scheduler
from harvey.cli import main
from harvey.replay.counterfactual import what_if
from harvey.runner.result import MissionResult
from harvey.runner.resume import find_remains
from harvey.runner.teller import PAGE, LiveTeller
from harvey.simulation.simulated_run import resume_mission, run_mission
from logs.run_directory import RunDirectory
from logs.timeline import Timeline
from recorded_runs import cut_off
from sim.scenario import ScenarioError
from sim.stage import Stage
from two_doors import two_doors
from world_models.entries import Goal, Milestone, PlanSketch, Redirection

SEED = 3
BACK = "(study (4,4,0))"


class Asks:
    """Somebody at the live page who asks once, in a given cycle."""

    def __init__(self, cycle: int, text: str) -> None:
        self._cycle, self._text, self._teller = cycle, text, LiveTeller()

    def __call__(self, scheduler: Scheduler) -> None:
        if scheduler.cycle == self._cycle:
            self._teller.hear(self._text)
        self._teller.tell(scheduler)


def drive(stage: Stage, tell: Any = None, out: Path | None = None) -> tuple[MissionResult, list[Decision]]:
    decisions: list[Decision] = []
    more = {} if tell is None else {"tell": tell}
    return run_mission(stage, SEED, sinks=[decisions.append], out=out, **more), decisions


def made(decisions: Sequence[Decision], kind: type[Any]) -> list[Any]:
    return [change.entry for decision in decisions for change in decision.made if isinstance(change.entry.value, kind)]


def left_active(decisions: Sequence[Decision]) -> dict[str, Any]:
    """The newest revision of each goal, sketch and milestone that is not over."""
    newest: dict[str, Any] = {}
    for decision in decisions:
        for change in decision.made:
            if isinstance(change.entry.value, Goal | PlanSketch | Milestone) and not isinstance(change, Retracted):
                newest[change.entry.id] = change.entry
    return {id: entry for id, entry in newest.items()
            if (entry.value.is_open if isinstance(entry.value, Milestone) else entry.value.is_active)}


@pytest.mark.parametrize("cycle", [0, 47, 95])
def test_it_goes_to_where_it_was_asked_to_go_instead(cycle: int, tmp_path: Path) -> None:
    """With the first goal, while it waits for a milestone, and in the other room."""
    result, decisions = drive(two_doors(tmp_path), Asks(cycle, BACK))
    assert (result.outcome, result.collisions, result.false_accepts) == ("reached", 0, 0)
    assert result.error_m < 0.0254
    (asked,) = made(decisions, Redirection)
    assert asked.value.by == PAGE and "goes to study (1.22, 1.22) m" in asked.value.answer
    first, abandoned, second, *_ = made(decisions, Goal)
    assert abandoned.id == first.id and abandoned.value.status == "abandoned"
    assert second.because[0].id == asked.id and second.value.destination.locale == "study"
    assert left_active(decisions) == {}


def test_by_the_missions_file_it_is_asked_at_its_time_and_once_after_a_crash(tmp_path: Path) -> None:
    stage = two_doors(tmp_path, ((2.0, "north-door", "open"),), more=f'[[told]]\nat_s = 4.0\ngoal = "{BACK}"\n')
    result, _ = drive(stage, Asks(12, "Go to the attic"), tmp_path / "whole")
    assert result.outcome == "reached" and result.error_m < 0.0254
    whole = RunDirectory(tmp_path / "whole")
    told = [entry.fields for record in Timeline(whole.journal).decisions() for entry in record.observed
            if entry.type in ("UserReport", "Redirection")]
    assert [one.get("text", one.get("what")) for one in told] == ["Go to the attic", "north-door", BACK]
    cycles = [record.cycle for record in Timeline(whole.journal).decisions()
              if any(entry.type == "UserReport" for entry in record.observed)]
    run = cut_off(whole, tmp_path / "cut", cycles[0] + 2, tail=0)
    assert resume_mission(run, find_remains(run), stage=stage).outcome == "reached"
    again = [entry.fields for record in Timeline(run.journal).decisions() for entry in record.observed
             if entry.type in ("UserReport", "Redirection")]
    assert again == told


def test_what_if_it_had_been_otherwise_hears_the_page_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stage = two_doors(tmp_path)
    drive(stage, Asks(60, BACK), tmp_path / "run")
    assert main(["replay", str(tmp_path / "run")]) == 0
    assert "all the same, byte for byte" in capsys.readouterr().out
    answer = what_if(RunDirectory(tmp_path / "run"), ["plan_adjuster"], ())
    assert answer.result is not None and answer.result.outcome == "reached" and answer.result.error_m < 0.15
    out = RunDirectory(tmp_path / "other")
    what_if(RunDirectory(tmp_path / "run"), ["parlour/picture-1"], (), out=out)
    told = [(entry.author, entry.fields["text"]) for record in Timeline(out.journal).decisions()
            for entry in record.observed if entry.type == "Redirection"]
    assert told == [(PAGE, BACK)]


@pytest.mark.parametrize(("more", "wanted"), [
    ('goal = "Go to the attic"', "no room of two-doors answers to 'the attic'"),
    ('goal = "Go from the study to the parlour"', "expected 'Go to ROOM', as the robot goes from where it is"),
    ('goal = "the parlour"\nwhat = "north-door"\nstate = "shut"', "expected either goal, or what and state, got both"),
    ('goal = "Fetch the paper"', "no room of"), ('goal = "Go to the"', "expected a room"),
    ('goal = "(parlour (4,5))"', "expected a place like (library (6,10,0))"),
    ('goal = "(attic (4,5,0))"', "attic")])
def test_a_bad_goal_in_the_file_is_refused_by_name(more: str, wanted: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError) as refused:
        two_doors(tmp_path, more=f"[[told]]\nat_s = 4.0\n{more}\n")
    assert wanted in str(refused.value)
