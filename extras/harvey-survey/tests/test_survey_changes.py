"""A survey: a right model stays, the order of runs does not matter, a patch that is undone leaves the same bytes."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harvey.cli import main
from harvey.errors import BadInput
from harvey_survey.adjustment import SurveyChange, adjust, find_gone, propose_changes, weigh_gone
from harvey_survey.patch_file import apply_changes, build_patch, format_patch, read_patch, write_world
from harvey_survey.seen_pictures import SeenPicture, read_looks
from world_models.building.model_errors import find_line_errors
from world_models.building.world import World
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose2

WORLD = WORLDS / "research_center.toml"
NAMES = ("office", "bump", "kidnap")
HOUSE = """# a house
name = "house"
units = "metres"

[finishes]
wood = { colour = [0.5, 0.4, 0.3] }

[parts]
box = [{ x = [-0.2, 0.2], y = [0.0, 0.4], z = [0.0, 1.0], finish = "wood" }]

[locales.hall]   # its frame is the world's
kind = "room"
at = [0.0, 0.0]
size = [6.0, 4.0]   # by tape
things = [["box", "north", 1.0, 3.0, 5.0], ["box", [3.0, 2.0, 90], "table"],
  { part = "box", wall = "west", along = 2.0 }]

[locales.room]
kind = "room"
at = [6.2, 0.0]
size = [4.0, 4.0]
things = [["box", "east", { from = 1, to = 3, step = 1 }]]

[doors]
door = { between = ["hall", "room"], wall = "east", along = 2.0, open = true }   # the only one
"""


@pytest.fixture
def house(tmp_path: Path) -> Path:
    path = tmp_path / "house.toml"
    path.write_text(HOUSE, "utf-8")
    return path


@pytest.fixture(scope="module")
def world() -> World:
    return load_world(WORLD)


@pytest.fixture(scope="module")
def looks(recorded: Any, world: World) -> tuple[SeenPicture, ...]:
    return read_looks(world, WORLD, [recorded(name) for name in NAMES])


def moved(kind: str, name: str, **by_cm: float) -> SurveyChange:
    return SurveyChange(kind, name, by_cm, dict.fromkeys(by_cm, 0.5), 0.999, "found elsewhere")


def gone(name: str) -> SurveyChange:
    return SurveyChange("thing", name, {}, {}, 0.999, "never found")


def test_right_model_stays(world: World, looks: tuple[SeenPicture, ...]) -> None:
    found = adjust(world, looks, 0.05)
    assert propose_changes(world, looks, found) == ()
    z = found.offs_m / found.sigmas_m
    assert np.mean(np.abs(z[found.pictures > 0]) < 1.96) > 0.9


def test_displacement_is_found_in_any_order(world: World, looks: tuple[SeenPicture, ...]) -> None:
    """The file has two things elsewhere by 8 cm; pictures and noise stay what they were."""
    wanted = {"allens-office/window-1 along": 0.08, "allens-office/white-board-1 along": -0.08}
    displaced = []
    for look in looks:
        errors = find_line_errors(world, look.marks, look.numbers.tolist(), 0.05).restate(1.0)
        offs = np.array([wanted.get(way, 0.0) for way in errors.displacement_modes])
        displaced.append(replace(look, pieces_world=errors.displace(look.pieces_world, -offs)))
    found = adjust(world, displaced, 0.05)
    by_way = dict(zip(found.ways, found.offs_m.tolist(), strict=True))
    assert all(by_way[way] == pytest.approx(off, abs=0.025) for way, off in wanted.items())
    again = adjust(world, displaced[::-1], 0.05)
    np.testing.assert_allclose(again.offs_m, found.offs_m, atol=1e-9)


def test_gone_needs_looks_from_several_places(world: World, looks: tuple[SeenPicture, ...]) -> None:
    name = "allens-office/window-1"
    overlooked = [replace(look, found=look.found & np.array([mark.name != name for mark in look.marks]))
                  for look in looks if any(mark.name == name for mark in look.marks)]
    assert find_gone(world, looks) == ()
    here = [replace(look, pose=Pose2(3.0 * k, 0.0, 0.0)) for k, look in enumerate(overlooked)] * 2
    same = [replace(look, pose=here[0].pose) for look in here]
    assert [change.name for change in find_gone(world, here)] == [name]
    assert find_gone(world, same) == ()
    assert weigh_gone(9, 0) > weigh_gone(3, 0) > weigh_gone(1, 0) > 0.0 > weigh_gone(9, 9)


def test_edits_keep_comments_and_move_what_they_say(house: Path) -> None:
    changes = (moved("wall", "hall wall 3", into=-10.0), moved("wall", "hall wall 1", into=4.0),
               moved("door", "door", along=-5.0), moved("thing", "hall/table", x=3.0, y=-2.0), gone("hall/box-2"))
    text, left = apply_changes(house, changes)
    assert left == ()
    assert [line.partition("#")[2] for line in text.splitlines()] == [
        line.partition("#")[2] for line in HOUSE.splitlines()]
    house.with_name("better.toml").write_text(text, "utf-8")
    before, after = load_world(house), load_world(house.with_name("better.toml"))
    assert after.outline("hall").tolist() == pytest.approx(np.array([[-0.1, 0], [5.96, 0], [5.96, 4], [-0.1, 4]]))
    assert after.outline("room").min(axis=0) == pytest.approx([6.16, 0.0])
    where = {thing.name: thing.footprint_world.mean(axis=0) for thing in before.things}
    there = {thing.name: thing.footprint_world.mean(axis=0) for thing in after.things}
    assert sorted(set(where) - set(there)) == ["hall/box-2"]
    shift = {"hall/table": [0.03, -0.02], "hall/box-4": [-0.1, 0.0]}
    for name, at in there.items():
        assert at - where[name] == pytest.approx(shift.get(name, [0.0, 0.0]), abs=1e-6), name
    assert after.doorways[0].centre_world == pytest.approx([6.06, 1.95])


def test_what_cannot_be_written_is_left_and_said(house: Path) -> None:
    text, left = apply_changes(house, (moved("thing", "room/box-2", along=5.0), moved("wall", "room wall 0", into=3.0)))
    assert text == HOUSE
    assert [change.name for change, _ in left] == ["room/box-2", "room wall 0"]
    assert all("step" in why for _, why in left)


def test_patch_undone_gives_the_same_bytes(house: Path) -> None:
    data = HOUSE.replace("\n", "\r\n").encode()
    house.write_bytes(data)
    changes = (moved("door", "door", along=5.0), gone("hall/box-1"), moved("thing", "room/box-1", along=2.0))
    patch = build_patch(house, changes, 2, 9)
    assert [one.is_accepted for one in patch.proposals] == [True, True, False]
    file = house.with_name("patch.toml")
    file.write_text(format_patch(patch), "utf-8")
    assert read_patch(file) == patch and len(tomllib.loads(file.read_text("utf-8"))["change"]) == 3
    made = write_world(house, patch)
    assert b"along = 2.05" in made and made.count(b"\r\n") == data.count(b"\r\n")
    without = patch.accepting((1, 2), is_accepted=False)
    assert write_world(house, without) == data
    assert write_world(house, without.accepting((1, 2), is_accepted=True)) == made
    with pytest.raises(BadInput, match="expected numbers of changes, which are 1 to 3, got 7"):
        patch.accepting((7,), is_accepted=True)
    house.write_text("# other\n" + HOUSE, "utf-8")
    with pytest.raises(BadInput, match="expected the world file of the patch"):
        write_world(house, patch)


def test_command(recorded: Any, house: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "better.toml"
    assert main(["survey", str(recorded("office").path), "--world", "research_center", "--out", str(out)]) == 0
    assert out.read_bytes() == WORLD.read_bytes()
    assert "0 of 0 changes" in capsys.readouterr().out
    patch = tmp_path / "house-patch.toml"
    patch.write_text(format_patch(build_patch(house, (gone("hall/box-1"), moved("door", "door", along=5.0)), 2, 9)))
    run = ["survey", "--world", str(house), "--out", str(out), "--patch", str(patch)]
    assert main([*run, "--accept", "2"]) == 0
    assert "not accepted" in capsys.readouterr().out and out.read_text("utf-8") == HOUSE.replace(
        "along = 2.0, open", "along = 2.05, open")
    assert main([*run, "--undo", "all"]) == 0
    assert out.read_bytes() == house.read_bytes()
    for wrong, said in ((["--accept", "3"], "got 3"), (["--accept", "x"], "expected numbers of changes as 1,4,9"),
                        (["--sigma-cm", "0"], "--sigma-cm"), (["--out", str(house)], "which is kept")):
        try:
            code = main([*run, *wrong])
        except SystemExit as stop:
            code = int(stop.code or 0)
        assert code == 2 and said in capsys.readouterr().err
