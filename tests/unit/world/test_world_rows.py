"""The short forms of world files: rows of things and doors, included files, copies; each fault with its line."""

from pathlib import Path

import pytest

from world_models.building.checks import check_world
from world_models.building.world import World
from world_models.files.toml.other_files import compute_digest
from world_models.files.toml.source import Source
from world_models.files.world_files import WorldError, load_world, read_world

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


def test_a_world_is_not_made_from_itself(tmp_path: Path) -> None:
    path = tmp_path / "house.toml"
    path.write_text('name = "h"\nunits = "metres"\n[locales.top]\nfrom = "house.toml"\n')
    with pytest.raises(WorldError, match=r"expected another world file, that is not made from this one"):
        load_world(path)
    assert compute_digest(path)


def test_outdoors_has_no_ceiling_and_a_skyline() -> None:
    court = house("sky = true\nwall_heights = { north = 2, south = 1 }\n")
    assert check_world(court) == []
    assert not any(face.name == "hall/ceiling" for face in court.faces)
    tops = {round(float(z), 2) for mark in court.landmarks for z in mark.lines_world[..., 2].ravel()}
    assert {1.0, 2.0, 2.7} <= tops


def test_a_board_across_a_doorway_is_a_fault() -> None:
    more = ('things = [ ["chest", "east", 2.4] ]\n[locales.den]\nkind = "room"\nat = [9.2, 0]\nsize = [3, 5]\n'
            '[doors]\nd = { between = ["hall", "den"], wall = "east", along = 2, open = true }\n')
    assert [str(f) for f in check_world(house(more))] == [
        "house.toml:10: hall/chest-1: expected the doorway d free, got it in there"]


def test_a_step_in_a_doorway_is_a_fault() -> None:
    more = ('[locales.den]\nkind = "room"\nat = [9.2, 0, 0.2]\nsize = [3, 5]\n'
            '[doors]\nd = { between = ["hall", "den"], wall = "east", along = 2, open = true }\n')
    assert [str(f) for f in check_world(house(more))] == [
        "house.toml:15: d: expected hall and den on one level, got a step of 0.20 m"]


def test_a_finish_of_a_locale_without_walls_is_refused() -> None:
    with pytest.raises(WorldError, match=r"locales\.wing\.floor: expected a finish only in a locale with walls"):
        house('in = "wing"\n[locales.wing]\nkind = "wing"\nfloor = "oak"\n')
