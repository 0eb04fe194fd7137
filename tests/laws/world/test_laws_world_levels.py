"""Laws of location in the hierarchy: any path leads back, and neither up nor across does a location grow surer."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from world_models.building.world import World
from world_models.entries.location import covariance_tuple
from world_models.files.store import read_world
from world_models.files.toml.source import Source
from world_models.frames import Pose2, wrap_angle
from world_models.levels import Location, lowered, raised, seen_from


@st.composite
def campuses(draw: st.DrawFn) -> World:
    """A tree of locales, each surveyed more or less well; its leaves are rooms."""
    text = ['name = "campus"', 'units = "metres"']

    def place(name: str, within: str, deeper: int) -> None:
        x, y, turn = draw(st.floats(-50, 50)), draw(st.floats(-50, 50)), draw(st.floats(-180, 180))
        survey = f"survey = {{ sigma = {draw(st.floats(0, 2))!r}, sigma_deg = {draw(st.floats(0, 3))!r} }}"
        text.append(f"[locales.{name}]\nkind = 'box'\nat = [{x!r}, {y!r}]\nturn = {turn!r}\n{survey}")
        text.append(f"in = '{within}'" if within else "")
        parts = draw(st.integers(1, 2)) if deeper else 0
        text.extend([] if parts else ["size = [5, 4]\nheight = 3"])
        for part in range(parts):
            place(f"{name}{part}", name, deeper - 1)

    for index in range(draw(st.integers(1, 2))):
        place(f"b{index}", "", draw(st.integers(0, 3)))
    return read_world(Source.parse("\n".join(text)))


@st.composite
def located(draw: st.DrawFn) -> tuple[World, Location]:
    world = draw(campuses())
    locale = draw(st.sampled_from(world.rooms))
    root = np.array(draw(st.lists(st.floats(-0.5, 0.5), min_size=9, max_size=9))).reshape(3, 3)
    pose = Pose2(draw(st.floats(-20, 20)), draw(st.floats(-20, 20)), draw(st.floats(-3.1, 3.1)))
    return world, Location(locale, pose, covariance_tuple(root @ root.T))


def as_sure(one: Location, other: Location) -> bool:
    """Whether the place of one is in no direction known better than that of the other, up to rotation."""
    before, after = (np.linalg.eigvalsh(np.array(item.covariance)[:2, :2]) for item in (other, one))
    return bool(np.all(after >= before - 1e-9)) and one.covariance[2][2] >= other.covariance[2][2] - 1e-12


@settings(deadline=None, max_examples=60)
@given(located())
def test_going_up_never_invents_precision(case: tuple[World, Location]) -> None:
    world, here = case
    while world.locale(here.locale).parent is not None:
        above = raised(world, here)
        assert as_sure(above, here)
        back = lowered(world, above, here.locale)
        assert back.pose.distance_to(here.pose) < 1e-9
        assert abs(wrap_angle(back.pose.heading_rad - here.pose.heading_rad)) < 1e-9
        assert as_sure(back, above)
        here = above


@settings(deadline=None, max_examples=60)
@given(located(), st.data())
def test_any_path_of_the_hierarchy_leads_back(case: tuple[World, Location], data: st.DataObject) -> None:
    world, here = case
    there = here
    for _ in range(data.draw(st.integers(1, 5))):
        step = seen_from(world, there, data.draw(st.sampled_from(sorted(world.locales))))
        assert as_sure(step, there)
        there = step
    back = seen_from(world, there, here.locale)
    assert back.pose.distance_to(here.pose) < 1e-8
    assert abs(wrap_angle(back.pose.heading_rad - here.pose.heading_rad)) < 1e-9


@settings(deadline=None, max_examples=40)
@given(located())
def test_a_location_means_one_place_in_the_world(case: tuple[World, Location]) -> None:
    world, here = case
    top = seen_from(world, here, world.root)
    expected = world.world_from_locale(here.locale).apply([here.pose.x_m, here.pose.y_m, 0.0])[:2]
    assert math.hypot(*(top.pose.position - expected)) < 1e-9
    assert world.name in str(top) and "+-" in str(top)
