"""Laws of the compiled world: it answers as its text, and touches only what it is asked for."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from world_models.building.checks import check_world
from world_models.building.geometry.scene import LocaleGeometry
from world_models.building.world import World
from world_models.files.packed import FORMAT, PackedFrames, compile_world
from world_models.files.toml.source import Source, WorldError
from world_models.files.world_files import WORLDS, compile_file, load_world, read_world

DETAILS = WORLDS.parent.parent / "sim" / "buildings" / "research_center_details.toml"
ARRAYS = ("polygons_world", "planes_world", "line_landmark", "line_index", "corners_world", "corner_landmark",
          "corner_lines", "line_locales", "corner_locales", "surface_locales")


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("store") / "research_center.world"
    compile_file(WORLDS / "research_center.toml", out, [DETAILS])
    return out


def check_same(one: World, other: World) -> None:
    assert tuple(one.locales) == tuple(other.locales) and one.rooms == other.rooms and one.counts() == other.counts()
    assert [f.name for f in one.faces] == [f.name for f in other.faces]
    assert [m.name for m in one.landmarks] == [m.name for m in other.landmarks]
    for attribute in ARRAYS:
        assert np.array_equal(getattr(one.scene, attribute), getattr(other.scene, attribute)), attribute
    for name in one.locales:
        assert np.array_equal(one.outline(name), other.outline(name))
        assert one.locale(name).properties == other.locale(name).properties
        assert [d.name for d in one.doorways_of(name)] == [d.name for d in other.doorways_of(name)]
        assert [t.name for t in one.things_of(name)] == [t.name for t in other.things_of(name)]
        assert one.frames[name].edges == other.frames[name].edges
        assert one.frames[name].components == other.frames[name].components


def test_a_compiled_world_answers_as_its_text(compiled: Path) -> None:
    check_same(load_world(WORLDS / "research_center.toml", details=[DETAILS]), load_world(compiled))


def test_a_robot_in_a_room_touches_the_room(compiled: Path) -> None:
    world = load_world(compiled)
    frames = world.frames
    assert isinstance(frames, PackedFrames) and frames.touched == []
    world.scene_of(["mail-room"])
    world.obstacles("mail-room")
    assert frames.touched == ["mail-room"]
    route = world.route("mail-room", "library")
    assert route is not None and [step.passage.name for step in route.steps] == ["mail-door", "library-door"]
    assert set(frames.touched) == {"mail-room", "hallway", "library", "second-floor", "research-center"}


def test_what_is_no_compiled_world_is_told(compiled: Path, tmp_path: Path) -> None:
    with pytest.raises(WorldError, match="expected a readable file"):
        load_world(tmp_path / "none.world")
    with pytest.raises(WorldError, match=r"expected a TOML file where details are added.*, got a compiled world"):
        load_world(compiled, details=["others.toml"])
    old = compiled.read_bytes().replace(FORMAT.encode(), b"harvey world 1")
    (tmp_path / "old.world").write_bytes(old)
    with pytest.raises(WorldError, match=r"old\.world: expected '.*', got 'harvey world 1': compile it again"):
        load_world(tmp_path / "old.world")
    for text in (b"", b"name = 'x'", compiled.read_bytes()[:5000]):
        (tmp_path / "bad.world").write_bytes(text)
        with pytest.raises(WorldError, match=r"bad\.world: expected"):
            load_everything(load_world(tmp_path / "bad.world"))


def load_everything(world: World) -> list[LocaleGeometry]:
    check_world(world)
    return list(world.parts)


@settings(deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_damaged_compiled_world_is_told_or_read(compiled: Path, tmp_path: Path, data: st.DataObject) -> None:
    content = bytearray(compiled.read_bytes())
    for _ in range(data.draw(st.integers(1, 20))):
        at = data.draw(st.integers(0, len(content) - 1) | st.integers(0, 20_000))
        content[at] = data.draw(st.integers(0, 255))
    bad = tmp_path / "bad.world"
    bad.write_bytes(content)
    try:
        load_everything(load_world(bad))
    except WorldError as error:
        assert str(error).startswith("bad.world: expected")


@st.composite
def networks(draw: st.DrawFn) -> World:
    """Rooms in a row of floors and houses, with doors between random neighbours in the row."""
    text = ['name = "campus"', 'units = "metres"']
    holders = draw(st.lists(st.sampled_from(["", "h0", "h1", "f0", "f1"]), min_size=2, max_size=9))
    for name, above in (("h0", ""), ("h1", ""), ("f0", "h0"), ("f1", "h0")):
        if any(holder == name or (name == "h0" and holder in ("f0", "f1")) for holder in holders):
            text.append(f"[locales.{name}]\nkind = 'floor'" + (f"\nin = '{above}'" if above else ""))
    for index, holder in enumerate(holders):
        text.append(f"[locales.r{index}]\nkind = 'room'\nsize = [3, 3]\nat = [{3.2 * index}, 0]")
        text.append(f"in = '{holder}'" if holder else "")
    text.append("[doors]")
    for index in range(len(holders) - 1):
        if draw(st.booleans()):
            between = f"between = ['r{index}', 'r{index + 1}']"
            text.append(f"d{index} = {{ {between}, wall = 'east', along = 1.5, open = true }}")
    return read_world(Source.parse("\n".join(text)))


@settings(deadline=None, max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(world=networks())
def test_any_world_survives_compiling(world: World, tmp_path: Path) -> None:
    compile_world(world, tmp_path / "w.world")
    check_same(world, load_world(tmp_path / "w.world"))
