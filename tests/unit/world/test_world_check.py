"""What ``World.check`` finds wrong with worlds that can be read."""

from collections.abc import Iterable, Sequence
from typing import Any

import pytest

from world_models.building.checks import check_world
from world_models.building.world import World, build_frames
from world_models.files.toml.source import Source
from world_models.files.world_files import WORLDS, load_world, read_world

HOUSE = """\
name = "house"
units = "metres"
[finishes]
oak = { colour = [0.5, 0.4, 0.3] }
[parts]
chest = [ { x = [-0.5, 0.5], y = [0, 0.4], z = [0, 0.6], finish = "oak" } ]
[locales.kitchen]
kind = "room"
size = [4, 3]
things = [ { part = "chest", at = [2, 1] }, { part = "chest", wall = "south", along = 2 } ]
[locales.parlour]
kind = "room"
at = [4.2, 0]
size = [4, 3]
[doors]
middle = { between = ["kitchen", "parlour"], wall = "east", along = 1.5, open = true }
back = { between = ["kitchen"], wall = "west", along = 1.5 }
"""


def faults(old: str = "", new: str = "") -> list[str]:
    assert old in HOUSE
    return [str(fault) for fault in check_world(read_world(Source.parse(HOUSE.replace(old, new, 1), "house.toml")))]


def test_a_sound_house_has_no_faults() -> None:
    assert faults() == []


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("at = [4.2, 0]", "at = [3.5, 0]", "house.toml:11: parlour: expected a room apart from others"),
        ("at = [4.2, 0]", "at = [1, 1]\nturn = 20", "house.toml:11: parlour: expected a room apart from others"),
        ("at = [4.2, 0]", "at = [6, 0]", "house.toml:16: door middle: expected a wall of parlour behind the east wall"),
        ("at = [4.2, 0]", "at = [4.2, 2.9]", "house.toml:16: door middle: expected a wall of parlour behind"),
        ("along = 1.5, open", "along = 2.9, open", "house.toml:16: door middle: expected an opening within"),
        ("open = true", "open = true, height = 3", "house.toml:16: door middle: expected an opening within"),
        ("open = true", "open = false", "house.toml:11: parlour: expected open doorways from kitchen"),
        ("at = [2, 1]", "at = [3.8, 1]", "house.toml:10: kitchen/chest-1: expected it inside kitchen"),
        ("along = 2 }", "along = 3.8 }", "house.toml:10: kitchen/chest-2: expected it inside kitchen"),
        ("along = 2 }", "along = 4.8 }", "house.toml:10: chest-2: expected a place on the south wall of kitchen"),
        ("along = 2 }", "along = 2, up = 2.5 }", "house.toml:10: kitchen/chest-2: expected it between floor and"),
        ('{ part = "chest", wall = "south", along = 2 }', ", ".join(['{ part = "chest", at = [2, 1] }'] * 3),
         "house.toml:10: kitchen/chest-2: expected a place of its own, got that of kitchen/chest-1, and 2 more are"),
        ('"], wall = "west"', '"], wall = "east"',
         "house.toml:17: door back: expected solid wall, got the opening of middle"),
    ],
)
def test_faults_are_told_with_their_line(old: str, new: str, expected: str) -> None:
    found = faults(old, new)
    assert any(expected in fault for fault in found), found


def test_who_waits_for_a_large_world_sees_how_far_it_is() -> None:
    seen: list[tuple[str, int]] = []

    def watched(items: Sequence[Any], what: str) -> Iterable[Any]:
        for number, item in enumerate(items, 1):
            seen.append((what, number))
            yield item

    assert check_world(read_world(Source.parse(HOUSE, "house.toml")), watched) == []
    assert seen == [(what, number) for what in ("rooms closed", "rooms apart", "things in their rooms")
                    for number in (1, 2)]


def test_a_room_with_a_hole_is_not_closed() -> None:
    world = read_world(Source.parse(HOUSE, "house.toml"))
    faces = [face for face in world.faces if face.name != "kitchen/north-wall"]
    leaky = World(build_frames(world.locales, world.doorways, faces, world.landmarks, world.things))
    assert [str(f) for f in check_world(leaky)] == [
        "house.toml:7: kitchen: expected a room closed by floor, ceiling, walls and doors, got a gap"]


def test_the_shipped_world_and_its_details_are_sound() -> None:
    details = WORLDS.parent.parent / "sim" / "buildings" / "research_center_details.toml"
    assert check_world(load_world(WORLDS / "research_center.toml", details=[details])) == []
