"""Laws of extents: a descent from the root finds what is near, and worlds in memory and compiled worlds agree."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from world_models.building.extents import LocaleExtent
from world_models.building.locale_source import WorldSource
from world_models.building.locales import Locale
from world_models.building.memory_locales import MemoryLocales
from world_models.building.world import World
from world_models.files.compiled.sqlite_locales import SqliteLocales
from world_models.files.compiled.writer import compile_world
from world_models.files.world_files import WORLDS, compile_file, load_world
from world_models.frames import Pose

COORDINATES = st.floats(-40.0, 40.0) | st.integers(-40, 40).map(float)
MARGINS = st.sampled_from([0.0, 1e-6, 0.3]) | st.floats(0.0, 30.0)


@st.composite
def hierarchies(draw: st.DrawFn) -> World:
    """Locales anywhere, also outside what contains them, in any order after the root."""
    count = draw(st.integers(1, 8))
    locales = [draw_locale(draw, "root", None)]
    for index in range(count):
        above = draw(st.integers(-1, index - 1))
        locales.append(draw_locale(draw, f"l{index}", "root" if above < 0 else f"l{above}"))
    rest = draw(st.permutations(locales[1:]))
    return World(MemoryLocales("root", {each.name: each for each in (locales[0], *rest)}, (), (), ()))


def draw_locale(draw: st.DrawFn, name: str, parent: str | None) -> Locale:
    x, y, z = draw(COORDINATES), draw(COORDINATES), draw(st.floats(-5.0, 5.0))
    frame = Pose.from_rotation_vector((0.0, 0.0, draw(st.floats(-3.0, 3.0))), (x, y, z))
    width, depth = draw(st.floats(0.1, 20.0)), draw(st.floats(0.1, 20.0))
    outline = np.array([(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)])
    return Locale(name, "room", parent, frame, outline, draw(st.floats(2.0, 4.0)), floor_m=draw(st.floats(-1.0, 1.0)))


def descend(source: WorldSource, x_m: float, y_m: float, margin_m: float) -> list[str]:
    """The locales near a point, found from the root down."""
    found: list[LocaleExtent] = []
    todo = [source.extent(source.name)]
    while todo:
        extent = todo.pop()
        if extent.reaches(x_m, y_m, margin_m):
            found += [extent] if extent.is_near(x_m, y_m, margin_m) else []
            todo += source.extents_in(extent.name)
    return [extent.name for extent in sorted(found, key=lambda extent: extent.number)]


def check_extents(one: WorldSource, other: WorldSource) -> None:
    names = list(one.names())
    assert names == list(other.names())
    world = World(one)
    for number, name in enumerate(names):
        extent = one.extent(name)
        assert extent == other.extent(name)
        assert (extent.name, extent.number, extent.is_room) == (name, number, one.is_room(name))
        assert number == one.number(name) == other.number(name)
        assert one.components(name) == other.components(name)
        assert bool(one.components(name)) == (name != one.name)
        assert tuple(each.name for each in one.extents_in(name)) == one.children(name)
        assert one.extents_in(name) == other.extents_in(name) == tuple(map(one.extent, one.children(name)))
        base, locale = world.floor_m(name), world.locale(name)
        inside = [(*extent.rectangle[:2], base + locale.floor_m, *extent.rectangle[2:], base + locale.height_m),
                  *(child.reach for child in one.extents_in(name))]
        assert extent.reach == (*np.min(inside, axis=0)[:3], *np.max(inside, axis=0)[3:])


def check_near(source: WorldSource, x_m: float, y_m: float, margin_m: float, expected: list[str]) -> None:
    assert list(source.near(x_m, y_m, margin_m)) == expected
    assert descend(source, x_m, y_m, margin_m) == expected


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(world=hierarchies(), data=st.data())
def test_a_descent_finds_what_is_near_in_any_world(world: World, data: st.DataObject, tmp_path: Path) -> None:
    memory = world.locale_source
    compile_world([world], tmp_path / "w.world")
    compiled = SqliteLocales(tmp_path / "w.world")
    check_extents(memory, compiled)
    for _ in range(4):
        margin_m = data.draw(MARGINS)
        x0, y0, x1, y1 = memory.extent(data.draw(st.sampled_from(list(memory.names())))).rectangle
        x_m = data.draw(COORDINATES | st.sampled_from([x0, x1, x0 - margin_m, x1 + margin_m]))
        y_m = data.draw(COORDINATES | st.sampled_from([y0, y1, y0 - margin_m, y1 + margin_m, (y0 + y1) / 2]))
        expected = [name for name in memory.names() if memory.extent(name).is_near(x_m, y_m, margin_m)]
        check_near(memory, x_m, y_m, margin_m, expected)
        check_near(compiled, x_m, y_m, margin_m, expected)


@pytest.fixture(scope="module", params=["research_center", "campus"])
def shipped(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[World, World]:
    text, out = WORLDS / f"{request.param}.toml", tmp_path_factory.mktemp("extents") / "shipped.world"
    return compile_file(text, out), load_world(out)


def test_both_sources_of_a_shipped_world_agree(shipped: tuple[World, World]) -> None:
    check_extents(shipped[0].locale_source, shipped[1].locale_source)


@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_a_descent_finds_what_is_near_in_a_shipped_world(shipped: tuple[World, World], data: st.DataObject) -> None:
    memory, compiled = (world.locale_source for world in shipped)
    x0, y0, _, x1, y1, _ = memory.extent(memory.name).reach
    x_m, y_m = data.draw(st.floats(x0 - 5.0, x1 + 5.0)), data.draw(st.floats(y0 - 5.0, y1 + 5.0))
    margin_m = data.draw(MARGINS)
    expected = list(memory.near(x_m, y_m, margin_m))
    check_near(memory, x_m, y_m, margin_m, expected)
    check_near(compiled, x_m, y_m, margin_m, expected)


def test_the_extent_of_an_unknown_locale_is_refused(shipped: tuple[World, World]) -> None:
    for world in shipped:
        with pytest.raises(ValueError, match=r"expected a locale of .*, got 'attic'"):
            world.locale_source.extent("attic")
        assert world.locale_source.extents_in("attic") == () == world.locale_source.components("attic")
