"""World files: what is wrong with each is told with its line; rows of things and doors, included files, copies."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pytest

from world_models.building.checks import check_world
from world_models.building.world import World, build_frames
from world_models.files.toml.other_files import compute_digest
from world_models.files.toml.source import Source
from world_models.files.world_files import WORLDS, WorldError, load_world, read_world

HEAD = """\
name = "house"
units = "metres"
[finishes]
oak = { colour = [0.5, 0.4, 0.3] }
[parts]
chest = [ { x = [-0.3, 0.3], y = [0, 0.4], z = [0, 0.6], finish = "oak" } ]
[locales.hall]
kind = "room"
size = [9, 5]
"""
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


def house(more: str) -> World:
    return read_world(Source.parse(HEAD + more, "house.toml"))


LONG = """things = [
  { part = "chest", wall = "north", along = 1 }, { part = "chest", wall = "north", along = 3, name = "big" },
  { part = "chest", wall = "south", along = 2, up = 0.5 }, { part = "chest", wall = "south", along = 4, up = 0.5 },
  { part = "chest", at = [3, 2], turn = 90 }, { part = "chest", at = [4, 2] }, { part = "chest", at = [6, 2] } ]
"""
SHORT = """things = [ ["chest", "north", 1, 3, "big"], ["chest", "south", { from = 2, to = 4, step = 2 }, { up = 0.5 }],
  ["chest", [3, 2, 90], { from = [4, 2], to = [6, 2], step = 2 }] ]
"""


def test_rows_are_the_same_things_as_tables() -> None:
    short, long = house(SHORT), house(LONG)
    assert [t.name for t in short.things] == [t.name for t in long.things]
    assert len(short.things) == 7 and check_world(short) == check_world(long) == []
    for one, other in zip(short.faces, long.faces, strict=True):
        assert one.name == other.name and one.polygon_world.tolist() == other.polygon_world.tolist()


def test_a_row_of_doors_is_several_doors() -> None:
    world = house('[doors]\ncell = { between = ["hall"], wall = "north", along = { from = 1, to = 7, step = 3 } }\n')
    leaves = [face.name for face in world.faces if face.name.endswith("/leaf")]
    assert leaves == [f"hall/cell-{number}/leaf" for number in (1, 2, 3)]


@pytest.mark.parametrize(("more", "message"), [
    ('things = [ ["chest"] ]', "house.toml:10: locales.hall.things.0: expected an array of at least 2 elements"),
    ('things = [\n["chest", "north"] ]', "house.toml:11: locales.hall.things.0: expected a part, a wall or none"),
    ('things = [ ["sink", "north", 1] ]', "things.0.0: expected one of the parts chest, got 'sink'"),
    ('things = [ ["chest", "up", 1] ]', "things.0.1: expected one of south, east, north, west, got 'up'"),
    ('things = [ ["chest", "north", [1, 2]] ]', "things.0.2: expected a number along the wall, or { from"),
    ('things = [ ["chest", 3] ]', "things.0.1: expected an array of 2 or 3 numbers"),
    ('things = [ ["chest", [1, 1, 999]] ]', "things.0.1.2: expected degrees from -360 to 360"),
    ('things = [ ["chest", "north", { from = 1, to = 7, step = 2 }, "big"] ]', "expected a name for one thing, got it"),
    ('things = [ ["chest", "north", { from = 7, to = 1, step = 2 }] ]', "expected 1 to 1000 places"),
    ('things = [ ["chest", "north", { from = 1, to = 7 }] ]', "expected the key 'step'"),
    ('things = [ ["chest", "north", 1, { colour = 3 }] ]',
     "expected one of the keys finish, up, turn, sigma_cm, kind, words, got 'colour'"),
    ("wall_heights = { north = 9 }\n", "house.toml:10: locales.hall.wall_heights.north: expected a number from 0.1 to"),
    ('walls = ["oak"]\n', "house.toml:10: locales.hall.walls: expected a finish for each of the 4 walls south"),
    ("sky = 1\n", "house.toml:10: locales.hall.sky: expected true or false"),
    ('[locales.attic]\nlike = "cellar"\n', "house.toml:11: locales.attic.like: expected a locale of this file"),
    ('[locales.attic]\nlike = "attic"\n', "house.toml:11: locales.attic.like: expected a locale of this file"),
    ('[locales.attic]\nfrom = "nowhere"\n', "house.toml:11: locales.attic.from: expected a .toml file that is"),
    ('[locales.attic]\nfrom = "typical_floor"\nof = "moon"\n', "house.toml:12: locales.attic.of: expected one of hall"),
    ('[locales.attic]\nfrom = "typical_floor"\nwithout = ["moon"]\n',
     "house.toml:12: locales.attic.without.0: expected a locale, door, link or thing"),
    ('[locales.attic]\nfrom = "typical_floor"\nadd = { moon = [] }\n', "locales.attic.add.moon: expected one of"),
    ('[locales.attic]\nfrom = "typical_floor"\nsize = [1, 2]\n', "house.toml:12: locales.attic.size: expected one of"),
    ('[links]\nlift = { kind = "elevator", between = ["hall", "hall"], stop = [1, 1, 0] }\n',
     "house.toml:11: links.lift.between: expected different locales"),
    ('[doors]\nd = { between = ["hall"], wall = "north", along = { from = 1, to = 2, step = 0 } }\n',
     "house.toml:11: doors.d.along.step: expected a number from 0.01 to"),
])
def test_mistakes_in_short_forms_are_told_with_their_line(more: str, message: str) -> None:
    with pytest.raises(WorldError) as caught:
        house(more)
    assert message in str(caught.value) and ", got " in str(caught.value)


def test_a_file_includes_others_and_its_fingerprint_tells(tmp_path: Path) -> None:
    parts, house_file = tmp_path / "mine.toml", tmp_path / "house.toml"
    parts.write_text('units = "feet"\n[finishes]\noak = { colour = [0.5, 0.4, 0.3] }\n[defaults]\nheight = 10\n')
    house_file.write_text('include = ["mine.toml"]\nname = "house"\nunits = "metres"\n'
                          '[locales.hall]\nkind = "room"\nsize = [4, 3]\nwalls = "oak"\n')
    world, before = load_world(house_file), compute_digest(house_file)
    assert check_world(world) == [] and world.locale("hall").height_m == pytest.approx(3.048)
    parts.write_text(parts.read_text().replace("0.3]", "0.4]"))
    assert compute_digest(house_file) != before


@pytest.mark.parametrize(("included", "message"), [
    ("parts.toml", "expected a file that does not include itself"),
    ("gone.toml", "parts.toml:2: include.0: expected a .toml file that is there"),
])
def test_a_file_that_cannot_be_included_is_told(included: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "parts.toml").write_text(f'units = "feet"\ninclude = ["{included}"]\n')
    path = tmp_path / "house.toml"
    path.write_text('include = ["parts.toml"]\nname = "h"\nunits = "metres"\n'
                    '[locales.hall]\nkind = "room"\nsize = [4, 3]\n')
    with pytest.raises(WorldError, match=message):
        load_world(path)


def test_outdoors_has_no_ceiling_and_a_skyline() -> None:
    court = house("sky = true\nwall_heights = { north = 2, south = 1 }\n")
    assert check_world(court) == []
    assert not any(face.name == "hall/ceiling" for face in court.faces)
    tops = {round(float(z), 2) for mark in court.landmarks for z in mark.lines_world[..., 2].ravel()}
    assert {1.0, 2.0, 2.7} <= tops


@pytest.mark.parametrize(("things", "at", "told"), [
    ('things = [ ["chest", "east", 2.4] ]\n', "[9.2, 0]",
     "10: hall/chest-1: expected the doorway d free, got it in there"),
    ("", "[9.2, 0, 0.2]", "15: d: expected hall and den on one level, got a step of 0.20 m"),
])
def test_a_board_across_a_doorway_and_a_step_in_it_are_faults(things: str, at: str, told: str) -> None:
    more = (f'{things}[locales.den]\nkind = "room"\nat = {at}\nsize = [3, 5]\n'
            '[doors]\nd = { between = ["hall", "den"], wall = "east", along = 2, open = true }\n')
    assert [str(f) for f in check_world(house(more))] == [f"house.toml:{told}"]


def test_a_finish_of_a_locale_without_walls_is_refused() -> None:
    with pytest.raises(WorldError, match=r"locales\.wing\.floor: expected a finish only in a locale with walls"):
        house('in = "wing"\n[locales.wing]\nkind = "wing"\nfloor = "oak"\n')
