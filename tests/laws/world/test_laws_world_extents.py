"""Laws of extents: a descent from the root finds what is near, and worlds in memory and compiled worlds agree."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from world_models.building.locales import MAX_FLUSH_M, ROBOT_TOP_M, STEP_M, Locale, Thing
from world_models.building.world import World, build_frames
from world_models.files.packed import compile_world
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
    return World(build_frames({each.name: each for each in (locales[0], *rest)}))


def draw_locale(draw: st.DrawFn, name: str, parent: str | None) -> Locale:
    x, y, z = draw(COORDINATES), draw(COORDINATES), draw(st.floats(-5.0, 5.0))
    frame = Pose.from_rotation_vector((0.0, 0.0, draw(st.floats(-3.0, 3.0))), (x, y, z))
    width, depth = draw(st.floats(0.1, 20.0)), draw(st.floats(0.1, 20.0))
    outline = np.array([(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)])
    return Locale(name, "room", parent, frame, outline, draw(st.floats(2.0, 4.0)), floor_m=draw(st.floats(-1.0, 1.0)))


def list_near(world: World, x_m: float, y_m: float, margin_m: float) -> list[str]:
    """The locales near a point, found by asking each."""
    return [name for name, frame in world.frames.items() if frame.extent.is_near(x_m, y_m, margin_m)]


def check_extents(one: World, other: World) -> None:
    names = list(one.frames)
    assert names == list(other.frames)
    parents = {locale.parent for locale in one.locales.values()}
    for number, name in enumerate(names):
        extent, children = one.frame(name).extent, one.frame(name).children
        assert extent == other.frame(name).extent
        assert (extent.name, extent.number, extent.is_room) == (name, number, name not in parents)
        assert one.is_room(name) == other.is_room(name) == extent.is_room
        assert one.frame(name).components == other.frame(name).components
        assert bool(one.frame(name).components) == (name != one.name)
        assert tuple(each.name for each in children) == one.children_of(name)
        assert one.children_of(name) == tuple(each for each in names if one.locale(each).parent == name)
        assert children == other.frame(name).children == tuple(one.frame(each).extent for each in one.children_of(name))
        base, locale = one.floor_m(name), one.locale(name)
        inside = [(*extent.rectangle[:2], base + locale.floor_m, *extent.rectangle[2:], base + locale.height_m),
                  *(child.reach for child in children)]
        assert extent.reach == (*np.min(inside, axis=0)[:3], *np.max(inside, axis=0)[3:])


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(world=hierarchies(), data=st.data())
def test_a_descent_finds_what_is_near_in_any_world(world: World, data: st.DataObject, tmp_path: Path) -> None:
    compile_world(world, tmp_path / "w.world")
    compiled = load_world(tmp_path / "w.world")
    check_extents(world, compiled)
    for _ in range(4):
        margin_m = data.draw(MARGINS)
        x0, y0, x1, y1 = world.frame(data.draw(st.sampled_from(list(world.frames)))).extent.rectangle
        x_m = data.draw(COORDINATES | st.sampled_from([x0, x1, x0 - margin_m, x1 + margin_m]))
        y_m = data.draw(COORDINATES | st.sampled_from([y0, y1, y0 - margin_m, y1 + margin_m, (y0 + y1) / 2]))
        expected = list_near(world, x_m, y_m, margin_m)
        assert world.near(x_m, y_m, margin_m) == expected == compiled.near(x_m, y_m, margin_m)


@pytest.fixture(scope="module", params=["research_center", "campus"])
def shipped(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[World, World]:
    text, out = WORLDS / f"{request.param}.toml", tmp_path_factory.mktemp("extents") / "shipped.world"
    return compile_file(text, out), load_world(out)


def test_both_sources_of_a_shipped_world_agree(shipped: tuple[World, World]) -> None:
    check_extents(*shipped)


@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_a_descent_finds_what_is_near_in_a_shipped_world(shipped: tuple[World, World], data: st.DataObject) -> None:
    built, compiled = shipped
    x0, y0, _, x1, y1, _ = built.root_frame().extent.reach
    x_m, y_m = data.draw(st.floats(x0 - 5.0, x1 + 5.0)), data.draw(st.floats(y0 - 5.0, y1 + 5.0))
    margin_m = data.draw(MARGINS)
    expected = list_near(built, x_m, y_m, margin_m)
    assert built.near(x_m, y_m, margin_m) == expected == compiled.near(x_m, y_m, margin_m)


def test_an_unknown_locale_is_refused(shipped: tuple[World, World]) -> None:
    for world in shipped:
        with pytest.raises(ValueError, match=r"expected a locale of .*, got 'attic'"):
            world.frame("attic")
        assert "attic" not in world.frames


@pytest.mark.parametrize(("low_m", "high_m", "protrusion_m", "is_in_the_way"), [
    (0.0, STEP_M, None, False), (0.0, STEP_M + 1e-6, None, True), (ROBOT_TOP_M, 2.0, None, False),
    (ROBOT_TOP_M - 1e-6, 2.0, None, True), (0.5, 1.0, MAX_FLUSH_M, False), (0.5, 1.0, MAX_FLUSH_M + 1e-6, True)])
def test_a_thing_is_in_the_way_where_the_robot_could_hit_it(
    low_m: float, high_m: float, protrusion_m: float | None, is_in_the_way: bool
) -> None:
    """Not what it rolls over, what hangs over it, or what lies flush in a wall: both sides of each bound."""
    thing = Thing("rug-1", "hall", "rug", np.zeros((4, 2)), low_m, high_m, protrusion_m, "by a law")
    assert thing.is_obstacle == is_in_the_way
