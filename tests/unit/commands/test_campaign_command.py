"""``harvey campaign``, and the options of campaigns: what is told, drawn, kept and refused."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from harvey.campaign import mission_task as missions
from harvey.campaign.engine import Results
from harvey.campaign.mission_task import Task
from harvey.campaign.random_missions import draw_missions, format_mission
from harvey.campaign.show import read_progress
from harvey.campaign.workers import CaseAnswer, Workers, check_origin, choose_workers, chosen_workers, origin
from harvey.cli import main
from harvey.errors import BadInput
from sim.scenario import parse_scenario
from world_models import plugins
from world_models.commands import parse_command
from world_models.files.toml.mission import named_file
from world_models.files.toml.source import WORLDS
from world_models.files.world_files import load_world


def campaign(folder: Path, outcomes: list[str], total: int = 40, killed: tuple[int, ...] = ()) -> str:
    """The files of a campaign that has done a case every two seconds, and was left alone for an hour once."""
    with closing(Results(folder, {"code": "any"})) as results:
        for case, outcome in enumerate(outcomes):
            at = 1000.0 + 2.0 * case + 3600.0 * (case >= 3)
            result = {"outcome": outcome, "final_error_m": 0.01 * case}
            results.add(case, result, {"at": at, "took_s": 4.0, "worker": "a:1"})
        for case in killed:
            results.give_up(case, 3)
    about = {"name": "bump", "unit": "mission", "total": total, "workers": "2 local", "dashboard": "http://there"}
    (folder / "campaign.json").write_text(json.dumps(about))
    return str(folder)


def test_progress_is_told_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = campaign(tmp_path / "a", ["reached"] * 9 + ["lost"], killed=(30,))
    progress = read_progress(tmp_path / "a")
    assert progress.rate_per_s == pytest.approx(9 / 16)  # the hour's pause is no work: 8 steps of 2 s
    assert progress.remaining_s == pytest.approx(29 * 16 / 9)
    assert main(["campaign", "show", folder]) == 0
    out = capsys.readouterr().out
    for told in ("bump: 10 of 40 missions done, 1 given up", "33.8 missions a minute", "remaining     0:00:52",
                 "http://there", "case 30: given up after 3 kills"):
        assert told in out
    assert (tmp_path / "a" / "progress.png").read_bytes().startswith(b"\x89PNG")


def test_a_worse_campaign_is_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = campaign(tmp_path / "good", ["reached"] * 20)
    bad = campaign(tmp_path / "bad", ["reached"] * 10 + ["lost"] * 10)
    assert main(["campaign", "compare", good, bad]) == 1
    assert "-50.00 points" in capsys.readouterr().out
    assert main(["campaign", "compare", bad, good]) == 0
    assert "the second is better" in capsys.readouterr().out
    assert main(["campaign", "compare", good, bad, "--success", "final_error_m<0.05"]) == 0
    assert "0 of 20 went differently" in capsys.readouterr().out


def test_random_missions_begin_and_end_on_free_floor_and_are_those_of_their_seed() -> None:
    scenario = parse_scenario(format_mission(named_file("two_ways", WORLDS, Path())))
    world = load_world(scenario.world)
    drawn = draw_missions(scenario, tuple(range(20)))
    assert drawn[7:9] == draw_missions(scenario, (7, 8)) and len(set(drawn)) == 20
    for (_, goal), (_, _heading) in drawn:
        ends = parse_command(goal, world)
        assert ends[0].locale != ends[1].locale  # another room, which doors lead to
        for place in ends:
            x, y = place.in_world(world).position
            gaps = [np.linalg.norm(corners - (x, y), axis=1).min() for corners in world.obstacles(place.locale)]
            assert world.locale_at((x, y)) == place.locale and min(gaps, default=1.0) > 0.35


@pytest.mark.parametrize(("argv", "told"), [
    (["campaign", "show", "nowhere"], "expected the directory of a campaign"),
    (["run", "bump", "--seed", "0..3", "--workers", "0"], "--workers: expected a number from 1 to 4096, or all"),
    (["run", "bump", "--seed", "0..3", "--workers", "2", "--cluster", "local:2"], "without --cluster"),
    (["run", "bump", "--workers", "2"], "--workers: expected several seeds"),
    (["run", "bump", "--keep", "none"], "--keep: expected several seeds"),
    (["experiment", "levels", "--workers", "many"], "--workers: expected"),
    (["campaign", "worker", "nowhere"], "expected tcp://host:port"),
])
def test_what_cannot_be_used_is_refused(
    argv: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(argv) == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(("argv", "asked_by"), [
    (["run", "bump", "--seed", "0..3", "--cluster", "local:2"], "--cluster"),
    (["experiment", "levels", "--cluster", "local:2"], "--cluster"),
    (["campaign", "worker", "tcp://host:8786"], "campaign worker")])
def test_without_the_extra_a_cluster_says_what_to_install(
    argv: list[str], asked_by: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(plugins, "entry_points", lambda group: ())
    assert main(argv) == 2
    needs = "harvey-cluster: pip install ./extras/harvey-cluster"
    assert capsys.readouterr().err == f"harvey: {asked_by} needs {needs}\n"


def test_who_works_is_chosen_for_a_while() -> None:
    with choose_workers(Workers(3)):
        assert chosen_workers() == Workers(3)
    assert chosen_workers() == Workers()


@pytest.mark.parametrize(("what", "theirs"), [("code", "other"), ("arithmetic", "abacus")])
def test_a_worker_that_computes_otherwise_is_refused(what: str, theirs: str) -> None:
    answer = CaseAnswer(1, 0.1, "host:1", {**origin(), what: theirs})
    with pytest.raises(BadInput, match="worker host:1: expected the"):
        check_origin(answer)


@pytest.mark.parametrize(("keep", "outcome", "stays"), [
    ("all", "reached", True), ("failures", "reached", False), ("failures", "lost", True), ("none", "lost", False)])
def test_run_directories_stay_as_wished(
    keep: missions.Keep, outcome: str, stays: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run_task(task: Task) -> SimpleNamespace:
        if task.out is not None:
            task.out.mkdir()
        return SimpleNamespace(outcome=outcome)

    monkeypatch.setattr(missions, "run_task", run_task)
    missions.drive_kept(Task("bump", (), 0, tmp_path / "0"), keep)
    assert (tmp_path / "0").exists() == stays
