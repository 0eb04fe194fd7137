"""The first world file: it has no faults whatever its rooms are called, its mission runs, nothing is overwritten."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from harvey.cli import main
from harvey.dry_run import dry_run
from harvey.simulation.simulated_run import build_robot_model
from sim.scenario import load_scenario
from world_models.building.checks import check_world
from world_models.files.first_world import first_world_text
from world_models.files.toml.source import Source
from world_models.files.world_files import load_world, read_world

NAMES = st.from_regex(r"[a-z][a-z0-9]{0,7}(-[a-z0-9]{1,4})?", fullmatch=True).filter(lambda n: n != "corridor")


@settings(max_examples=12, deadline=None)
@given(names=st.lists(NAMES, min_size=3, max_size=9, unique=True))
def test_it_has_no_faults_and_every_room_is_reached_from_every_other(names: list[str]) -> None:
    name, *rooms = names
    world = read_world(Source.parse(first_world_text(name, rooms), f"{name}.toml"))
    assert (world.name, check_world(world)) == (name, [])
    assert sorted(world.rooms) == sorted([*rooms, "corridor"])
    assert [world.walk(rooms[0], room) for room in rooms[1:]] == [[rooms[0], "corridor", room] for room in rooms[1:]]


def test_the_mission_at_its_end_is_planned_with_every_milestone_clear(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["world", "new", "attic"]) == 0
    assert "harvey world check attic.toml" in capsys.readouterr().out
    text = Path("attic.toml").read_text(encoding="utf-8")
    mission = text[text.index("#   world ="):].replace("#   ", "")
    Path("mission.toml").write_text(mission, encoding="utf-8")
    scenario = load_scenario(tmp_path / "mission.toml")
    previews, outcome = dry_run(load_world(scenario.world), build_robot_model(scenario), scenario.command)
    assert outcome.kind == "reached" and {preview.verdict for preview in previews} == {"clear"}


def test_a_file_that_exists_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("attic.toml").write_text("mine", encoding="utf-8")
    assert main(["world", "new", "attic"]) == 2
    assert "got 'attic.toml', which exists and is kept" in capsys.readouterr().err
    assert Path("attic.toml").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(("argv", "told"), [
    (["../attic"], "expected names of small letters, digits and hyphens, as 'second-floor', got '../attic'"),
    (["attic", "--rooms", "a,"], "got ''"),
    (["attic", "--rooms", "office"], "expected 2 to 20 rooms, got 1"),
    (["attic", "--rooms", "a,b,a"], "got 'a' twice"),
    (["attic", "--rooms", "attic,b"], "got 'attic' twice"),
    (["attic", "--rooms", "corridor,b"], "got 'corridor' twice"),
])
def test_names_that_cannot_be_used_are_refused_and_nothing_is_written(
    argv: list[str], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["world", "new", *argv]) == 2
    assert told in capsys.readouterr().err and not list(tmp_path.iterdir())
