"""Laws of the locale hierarchy: frames, containment and doorways of the shipped world and of made-up ones."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from world_models.building.geometry.outlines import distance_to_border
from world_models.building.locales import Doorway
from world_models.building.world import World
from world_models.files.toml.source import Source
from world_models.files.world_files import WORLDS, load_world, read_world

WORLD = load_world(WORLDS / "research_center.toml")

names = st.sampled_from(sorted(WORLD.locales))
rooms = st.sampled_from(WORLD.rooms)
metres = st.floats(-40.0, 40.0)
points = st.tuples(metres, metres, st.floats(0.0, 2.0))


@st.composite
def nested_worlds(draw: st.DrawFn) -> World:
    """A room in a chain of locales with arbitrary frames."""
    depth = draw(st.integers(1, 5))
    text = ['name = "top"', 'units = "metres"']
    for level in range(depth):
        x, y, z, turn = (draw(st.floats(-50, 50)) for _ in range(4))
        text.append(f"[locales.l{level}]\nkind = 'box'\nat = [{x!r}, {y!r}, {z!r}]\nturn = {turn!r}")
        text.append(f"in = 'l{level - 1}'" if level else "")
    text.append(f"size = [{draw(st.floats(1, 30))!r}, {draw(st.floats(1, 30))!r}]\nheight = 3")
    return read_world(Source.parse("\n".join(text)))


@settings(deadline=None, max_examples=40)
@given(nested_worlds(), points)
def test_a_point_survives_the_way_down_and_up_the_hierarchy(world: World, point: tuple[float, ...]) -> None:
    leaf = world.rooms[0]
    down = np.array(point)
    for name in world.path_of(leaf):
        down = world.locales[name].frame.inverse().apply(down)
    assert np.allclose(world.world_from_locale(leaf).inverse().apply(point), down, atol=1e-9)
    up = down
    for name in reversed(world.path_of(leaf)):
        up = world.locales[name].frame.apply(up)
    assert np.allclose(up, point, atol=1e-9)


@settings(deadline=None)
@given(names, names, points)
def test_frames_of_any_two_locales_are_joined_by_their_transforms(a: str, b: str, point: tuple[float, ...]) -> None:
    b_from_a = WORLD.world_from_locale(b).inverse() @ WORLD.world_from_locale(a)
    assert np.allclose(b_from_a.inverse().apply(b_from_a.apply(point)), point, atol=1e-9)


@settings(deadline=None)
@given(nested_worlds(), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_what_lies_in_a_locale_lies_in_all_that_contain_it(world: World, u: float, v: float) -> None:
    leaf = world.rooms[0]
    width, depth = world.locales[leaf].outline[2]
    point = world.world_from_locale(leaf).apply([u * width, v * depth, 1.0])
    for name in world.path_of(leaf):
        assert world.locales[name].contains(world.world_from_locale(name).inverse().apply(point), 1e-6)


@settings(deadline=None)
@given(rooms, st.floats(-0.2, 1.2), st.floats(-0.2, 1.2))
def test_locale_at_agrees_with_outlines(room: str, u: float, v: float) -> None:
    outline = WORLD.outline(room)
    point = outline[0] + u * (outline[1] - outline[0]) + v * (outline[3] - outline[0])
    found = WORLD.locale_at(point)
    if 0 < u < 1 and 0 < v < 1:
        assert found == room
    elif distance_to_border(point, outline) > 1e-6:
        assert found != room


@settings(deadline=None)
@given(st.tuples(metres, metres))
def test_the_deepest_locale_is_found(point: tuple[float, float]) -> None:
    found = WORLD.locale_at(point)
    holding = [name for name, locale in WORLD.locales.items()
               if locale.contains(WORLD.world_from_locale(name).inverse().apply([*point, 0]))]
    assert (found is None) == (not holding)
    if found is not None:
        assert max(len(WORLD.path_of(name)) for name in holding) == len(WORLD.path_of(found))


@pytest.mark.parametrize("doorway", WORLD.doorways, ids=lambda d: d.name)
def test_a_doorway_joins_two_locales_and_lies_on_both_outlines(doorway: Doorway) -> None:
    a, b = doorway.between
    assert a != b and {a, b} <= set(WORLD.rooms)
    assert WORLD.walk(a, b) == [a, b]
    for name in (a, b):
        outline = WORLD.outline(name)
        middle = doorway.threshold_of(name).mean(axis=0)
        for foot in (*doorway.threshold_of(name), middle):
            assert distance_to_border(foot, outline) < 1e-9
        assert doorway.other(doorway.other(name)) == name
        outward = doorway.outward_from(name)
        assert WORLD.locale_at(middle - 0.1 * outward) == name
        assert WORLD.locale_at(middle + (doorway.depth_m + 0.1) * outward) == doorway.other(name)
        assert math.isclose(float(np.linalg.norm(outward)), 1.0)


def test_a_doorway_refuses_a_locale_that_it_does_not_join() -> None:
    with pytest.raises(ValueError, match="mail-room"):
        WORLD.doorways[0].other("mail-room")
