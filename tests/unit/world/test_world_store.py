"""Reading world files: what comes of them, and what a person is told about a mistake."""

from pathlib import Path

import numpy as np
import pytest

from world_models.building.checks import check_world
from world_models.building.world import World
from world_models.files import world_files
from world_models.files.construction.builder import build_world
from world_models.files.packed import pack_frame
from world_models.files.toml.source import Source
from world_models.files.world_files import WORLDS, WorldError, load_world, read_world

HEAD = 'name = "cottage"\nunits = "feet"\n'
KITCHEN = '[locales.kitchen]\nkind = "room"\nsize = [10, 8]\n'


def read(text: str, *details: str) -> World:
    return read_world(Source.parse(text, "cottage.toml"), [Source.parse(d, "more.toml") for d in details])


def test_lengths_are_in_the_stated_unit() -> None:
    feet, metres = read(HEAD + KITCHEN), read(HEAD.replace("feet", "metres") + KITCHEN)
    assert np.allclose(feet.outline("kitchen")[2], [3.048, 2.4384])
    assert np.allclose(metres.outline("kitchen")[2], [10.0, 8.0])


def test_a_turned_locale_has_its_own_frame() -> None:
    world = read(HEAD.replace("feet", "metres") + KITCHEN + "at = [20, 5]\nturn = 90\n")
    assert np.allclose(world.world_from_locale("kitchen").apply([1.0, 2.0, 0.5]), [18.0, 6.0, 0.5])
    assert world.path_of("kitchen") == ("cottage", "kitchen")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "cottage.toml:1: the file: expected the key 'name', got keys none"),
        ("name = ", "cottage.toml:1: expected TOML, got: Invalid value (at end of document)"),
        (HEAD, "cottage.toml:1: the file: expected the key 'locales', got keys name, units"),
        (HEAD.replace("feet", "yards") + KITCHEN, "cottage.toml:2: units: expected one of feet, metres, got 'yards'"),
        (HEAD + KITCHEN.replace("[10, 8]", "[10]"),
         "cottage.toml:5: locales.kitchen.size: expected an array of 2 numbers, got [10]"),
        (HEAD + KITCHEN.replace("8", "nan"), "cottage.toml:5: locales.kitchen.size.1: expected a number from"),
        (HEAD + KITCHEN + "colour = 3\n", "cottage.toml:6: locales.kitchen.colour: expected one of the keys kind, in,"),
        (HEAD + KITCHEN + 'in = "attic"\n', "cottage.toml:6: locales.kitchen.in: expected one of the locales cottage"),
        (HEAD + KITCHEN + 'in = "kitchen"\n', "expected a locale that is not itself contained in this one"),
        (HEAD + KITCHEN + 'walls = "pink"\n', "cottage.toml:6: locales.kitchen.walls: expected one of the finishes"),
        (HEAD + KITCHEN + '\n\nthings = [\n\n  { part = "sink", at = [1, 1] } ]\n',
         "cottage.toml:10: locales.kitchen.things.0.part: expected one of the parts (none), got 'sink'"),
        (HEAD + KITCHEN + "things = [ { at = [1, 1] } ]\n", "expected either a part or boxes, got neither"),
        (HEAD + KITCHEN + "things = [ { boxes = [ { x = [2, 1], y = [0, 1], z = [0, 1] } ], at = [1, 1] } ]\n",
         "expected the key 'finish'"),
        (HEAD + '[finishes]\na = { colour = [0, 0, 2] }\n' + KITCHEN,
         "cottage.toml:4: finishes.a.colour.2: expected a number from 0 to 1, got 2"),
        (HEAD + '[locales.kitchen]\nkind = "room"\noutline = [[0, 0], [4, 4], [4, 0], [0, 4]]\n',
         "cottage.toml:5: locales.kitchen.outline: expected corners counter-clockwise round"),
        (HEAD + KITCHEN + '[doors]\nd = { between = ["kitchen", "hall"], wall = "east", along = 3 }\n',
         "cottage.toml:7: doors.d.between.1: expected one of kitchen, got 'hall'"),
        (HEAD + KITCHEN + '[doors]\nd = { between = ["kitchen"], wall = "east", along = 3, open = true }\n',
         "doors.d.between: expected two different locales"),
        (HEAD + KITCHEN + '[doors]\nd = { between = ["kitchen"], wall = "up", along = 3 }\n',
         "doors.d.wall: expected one of south, east, north, west, got 'up'"),
    ],
)
def test_mistakes_are_told_with_their_line(text: str, message: str) -> None:
    with pytest.raises(WorldError) as caught:
        read(text)
    assert message in str(caught.value)


def test_files_that_are_no_text_are_refused(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match="expected a readable file"):
        load_world(tmp_path / "none.toml")
    with pytest.raises(WorldError, match="expected a readable file"):
        load_world(tmp_path)
    (tmp_path / "latin.toml").write_bytes(b'name = "\xe9"')
    with pytest.raises(WorldError, match=r"latin\.toml: expected UTF-8 text, got byte 0xe9 at offset 8"):
        load_world(tmp_path / "latin.toml")


def test_a_file_is_named_as_it_was_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    there = Path("houses")
    there.mkdir()
    (there / "a.toml").write_text(HEAD + KITCHEN.replace("8", "nan"))
    (there / "b.toml").write_text("name = \n")
    (there / "c.toml").write_bytes(b'name = "caf\xe9"\n')
    for name, told in (("a", ":5: locales.kitchen.size.1"), ("b", ":1: expected TOML"), ("c", ": expected UTF-8")):
        with pytest.raises(WorldError) as caught:
            load_world(there / f"{name}.toml")
        assert str(caught.value).startswith(f"{there / name}.toml{told}")


def test_a_world_that_is_made_from_itself_is_refused_however_it_is_named(tmp_path: Path) -> None:
    (tmp_path / "houses").mkdir()
    file = tmp_path / "houses" / "a.toml"
    file.write_text(HEAD + KITCHEN + '[locales.annexe]\nfrom = "../houses/a.toml"\n')
    with pytest.raises(WorldError, match=r"a\.toml:7: .*another world file, that is not made from this one"):
        load_world(file)


def test_a_byte_order_mark_is_read_over(tmp_path: Path) -> None:
    (tmp_path / "marked.toml").write_bytes(b"\xef\xbb\xbf" + (HEAD + KITCHEN).encode())
    assert load_world(tmp_path / "marked.toml").rooms == ("kitchen",)


@pytest.mark.parametrize(("value", "told"), [
    ("1979-05-27", "1979-05-27"), ("07:32:00", "07:32:00"), ("true", "true"), ("[true, 07:32:00]", "[true, 07:32:00]"),
    ("{ a = 1 }", "{a = 1}"), ("0x" + "f" * 5000, "a number of more than 80 digits"), ("-inf", "-inf"),
])
def test_values_are_told_as_the_file_has_them(value: str, told: str) -> None:
    with pytest.raises(WorldError, match=r"cottage\.toml:2: units: expected one of feet, metres, got") as caught:
        read(HEAD.replace('"feet"', value) + KITCHEN)
    assert str(caught.value).endswith(f", got {told}")


def test_line_ends_of_other_systems_are_read(tmp_path: Path) -> None:
    (tmp_path / "dos.toml").write_bytes((HEAD + KITCHEN).replace("\n", "\r\n").encode())
    assert load_world(tmp_path / "dos.toml").rooms == ("kitchen",)


DETAIL = """\
units = "metres"
[finishes]
red = { colour = [1, 0, 0] }
[parts]
socket = [ { x = [0, 0.1], y = [0, 0.01], z = [0.3, 0.4], finish = "red" } ]
[locales.kitchen]
things = [ { part = "socket", wall = "north", along = 1.0 } ]
"""


def test_details_only_add_things() -> None:
    plain, detailed = read(HEAD + KITCHEN), read(HEAD + KITCHEN, DETAIL)
    assert [thing.name for thing in detailed.things] == ["kitchen/socket-1"] and not plain.things
    assert [f.name for f in detailed.faces[: len(plain.faces)]] == [f.name for f in plain.faces]
    assert detailed.things[0].source == "more.toml:7" and not check_world(detailed)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("locales.kitchen", "locales.hall", "more.toml:6: locales.hall: expected one of the locales kitchen"),
        ("things =", "size = [3, 3]\nthings =", "more.toml:7: locales.kitchen.size: expected one of the keys things"),
        ("[parts]", "[doors]\n[parts]", "more.toml:4: doors: expected one of the keys"),
    ],
)
def test_details_may_not_change_the_world(old: str, new: str, message: str) -> None:
    with pytest.raises(WorldError) as caught:
        read(HEAD + KITCHEN, DETAIL.replace(old, new))
    assert message in str(caught.value)


def test_details_may_not_give_a_name_another_meaning() -> None:
    with pytest.raises(WorldError, match=r"more\.toml:3: finishes\.red: expected a new name"):
        read(HEAD + '[finishes]\nred = { colour = [0.5, 0, 0] }\n' + KITCHEN, DETAIL)


def test_the_shipped_files_are_read() -> None:
    details = WORLDS.parent.parent / "sim" / "buildings" / "research_center_details.toml"
    model, building = load_world(WORLDS / "research_center.toml"), load_world(
        WORLDS / "research_center.toml", details=[details])
    assert len(building.faces) > len(model.faces) + 100
    assert building.locales.keys() == model.locales.keys()


def test_questions_about_unknown_names_are_refused() -> None:
    world = read(HEAD + KITCHEN)
    for ask in (world.outline, world.obstacles, world.path_of, world.world_from_locale, world.doorways_of,
                world.landmark):
        with pytest.raises(ValueError, match=r"expected .*got 'hall'"):
            ask("hall")
    with pytest.raises(ValueError, match=r"expected a point .* got shape \(4,\)"):
        world.locale_at([0, 0, 0, 0])


def test_a_world_is_read_once_as_long_as_none_of_its_files_changes(tmp_path: Path) -> None:
    """Neither the file itself, nor one that it includes, nor its details, nor the doors that are opened."""
    world, parts, details = (tmp_path / name for name in ("cottage.toml", "parts.toml", "details.toml"))
    world.write_text(HEAD + 'include = ["parts.toml"]\n' + KITCHEN)
    parts.write_text('units = "feet"\n[finishes]\nbeige = { colour = [0.9, 0.8, 0.7] }\n')
    details.write_text('units = "feet"\n[locales]\n')
    known = load_world(world)
    assert load_world(str(world)) is known
    assert load_world(world, details=[details]) is not known
    assert load_world(world, altered=lambda spec: spec) is not known
    parts.write_text('units = "feet"\n[finishes]\nbeige = { colour = [0.1, 0.8, 0.7] }\n')
    changed = load_world(world)
    assert changed is not known
    world.write_text(world.read_text().replace("[10, 8]", "[10, 9]"))
    assert np.allclose(load_world(world).outline("kitchen")[2], [3.048, 2.7432])
    world.write_text("name = ")
    with pytest.raises(WorldError, match="expected TOML"):
        load_world(world)


def test_a_building_is_built_once_in_a_users_life(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is kept is the same to the bit; broken, it is built again; with nowhere to keep it, each time."""
    built: list[object] = []
    monkeypatch.setattr(world_files, "build_world", lambda spec: built.append(spec) or build_world(spec))

    def load_anew(cache: Path) -> list[bytes]:
        monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
        world_files._read_once.cache_clear()
        return [pack_frame(frame) for frame in load_world(WORLDS / "research_center.toml").frames.values()]

    first = load_anew(tmp_path)
    assert load_anew(tmp_path) == first and len(built) == 1
    [kept] = (tmp_path / "harvey" / "worlds").iterdir()
    kept.write_bytes(kept.read_bytes()[:9000])
    assert load_anew(tmp_path) == first and len(built) == 2
    assert load_anew(kept) == first and load_anew(Path("nowhere")) == first and len(built) == 4
    assert not Path("nowhere").exists()
