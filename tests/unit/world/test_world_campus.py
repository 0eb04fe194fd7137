"""The campus (Figures 8 and 9): its hierarchy, its floors, the ways between them, and the floor that it shares."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from harvey.commands.plan_picture import draw_plan
from world_models.building.checks import check_world
from world_models.building.plan_view import build_drawing, plan_svg
from world_models.building.world import World
from world_models.commands import find_room, parse_command
from world_models.entries import Place
from world_models.files.world_files import WORLDS, load_world

FLOORS_M = {"first-floor": 0.0, "second-floor": 3.6576, "third-floor": 7.3152, "fourth-floor": 10.9728}


@pytest.fixture(scope="module")
def campus() -> World:
    return load_world(WORLDS / "campus.toml")


def describe(world: World, names: dict[str, str], up_m: float = 0.0) -> Iterator[object]:
    """All that is seen of some rooms, to a nanometre, as it would be on the ground."""
    up = np.array([0.0, 0.0, up_m])
    for face in world.faces:
        if face.locale in names:
            yield face.name, face.kind, face.neighbour, (np.round(face.polygon_world - up, 9) + 0.0).tolist()
            for region in (*face.front, *face.back):
                yield (region.name, (np.round(region.polygon_world - up, 9) + 0.0).tolist(), region.colour,
                       region.texture, region.texture_scale_m, region.seed)
    for mark in world.landmarks:
        if mark.locale in names:
            yield (mark.name, mark.kind, mark.neighbour, (np.round(mark.lines_world - up, 9) + 0.0).tolist(),
                   np.nan_to_num(np.round(mark.edges.brightness, 9), nan=-1.0).tolist())


def test_the_campus_is_sound_and_has_figure_8s_hierarchy(campus: World) -> None:
    assert check_world(campus) == []
    assert campus.children_of("campus") == ("research-center", "court", "engineering")
    assert set(campus.children_of("research-center")) == {*FLOORS_M, "elevator", "stairwell"}
    assert {name: round(campus.floor_m(name), 4) for name in FLOORS_M} == FLOORS_M
    for car, floor in zip(campus.children_of("elevator"), FLOORS_M, strict=True):
        assert campus.floor_m(car) == pytest.approx(FLOORS_M[floor])


def test_the_second_floor_is_the_research_centers(campus: World) -> None:
    """But for the hallway, where the campus has a real elevator and real stairs."""
    alone = load_world(WORLDS / "research_center.toml")
    rooms = dict.fromkeys(room for room in alone.rooms if room != "hallway")
    up_m = campus.floor_m("second-floor")
    ours, theirs = ([repr(item) for item in describe(world, rooms, up)] for world, up in ((campus, up_m), (alone, 0)))
    assert ours == theirs


def ways(world: World, origin: str, destination: str) -> tuple[str, list[str]]:
    route = world.route(origin, destination)
    assert route is not None
    return route.container, [step.passage.name for step in route.steps]


def test_figure_9_is_sketched_level_by_level(campus: World) -> None:
    assert ways(campus, "robot-laboratory", "hansons-office") == ("campus", ["main-entrance", "engineering-entrance"])
    assert ways(campus, "robot-laboratory", "lobby") == ("research-center", ["elevator-door-2", "elevator-door-1"])
    assert ways(campus, "robot-laboratory", "hallway") == ("second-floor", ["laboratory-door"])
    assert ways(campus, "car-2", "car-1") == ("elevator", ["elevator-1-2"])
    assert ways(campus, "engineering-hall", "hansons-office") == ("engineering", ["hansons-door"])


def test_nobody_is_sent_up_the_stairs(campus: World) -> None:
    for floor in ("first-hallway", "third-hallway", "fourth-hallway"):
        container, names = ways(campus, "hallway", floor)
        assert container == "research-center" and all(name.startswith("elevator") for name in names)


def test_a_point_is_in_the_room_of_its_own_floor(campus: World) -> None:
    for room in ("hallway", "first-hallway", "third-hallway", "fourth-hallway"):
        x, y, z = campus.world_from_locale(room).apply((6.0, 1.2, 0.0))
        assert campus.locale_at((x, y, z)) == room
        assert campus.rooms_near((x, y, z + 1.0), 0.0) == (room,)


@pytest.mark.parametrize("there", ["hallway", "third-classroom", "court", "hansons-office", "car-4"])
def test_a_place_goes_through_the_floors_and_back(campus: World, there: str) -> None:
    here = Place("first-hallway", 3.0, 1.0, 0.5)
    pose = here.in_world(campus)
    across = Place.of_world(campus, there, pose.x_m, pose.y_m, pose.heading_rad)
    assert across.in_world(campus).distance_to(pose) < 1e-9
    again = across.in_world(campus)
    back = Place.of_world(campus, here.locale, again.x_m, again.y_m, again.heading_rad)
    assert (back.x_m, back.y_m, back.heading_rad) == pytest.approx((here.x_m, here.y_m, here.heading_rad))


@pytest.mark.parametrize(("words", "room"), [
    ("Hanson's office in Engineering", "hansons-office"), ("the workshop in Engineering", "machine-shop"),
    ("the workshop on the third floor", "third-workshop"), ("Riseman", "risemans-office"),
    ("the laboratory", "robot-laboratory"), ("the classroom of the first floor", "first-classroom"),
])
def test_rooms_are_found_by_where_they_are(campus: World, words: str, room: str) -> None:
    assert find_room(words, campus) == room


@pytest.mark.parametrize(("words", "message"), [
    ("an office in Engineering", "two rooms answer to 'an office in Engineering': hansons-office, risemans-office"),
    ("the workshop", "four rooms answer to 'the workshop'"),
    ("Allen's office in Engineering", "no room of campus answers to \"Allen's office in Engineering\""),
    ("the office on the moon", "no room of campus answers to 'the office on the moon'"),
])
def test_what_is_not_one_room_is_refused(campus: World, words: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        find_room(words, campus)


def test_bring_this_to_somebody_across_the_campus(campus: World) -> None:
    origin, destination = parse_command("Bring this from the laboratory to Hanson", campus)
    assert (origin.locale, destination.locale) == ("robot-laboratory", "hansons-office")


def test_the_plan_has_a_panel_for_every_storey(campus: World, tmp_path: Path) -> None:
    plan = build_drawing(campus)
    titles = [shape.text for shape in plan.shapes if shape.kind == "title"]
    assert [text.partition(",")[0] for text in titles] == list(FLOORS_M)
    names = [shape.text for shape in plan.shapes if shape.kind == "name"]
    assert sorted(names) == sorted(campus.rooms)
    for shape in plan.shapes:
        assert (shape.points > -1e-6).all() and (shape.points < plan.size + 1e-6).all()
    boxes = [(shape.points.min(axis=0), shape.points.max(axis=0)) for shape in plan.shapes if shape.kind == "room"]
    for index, (low, high) in enumerate(boxes):
        assert not any((low < h - 0.01).all() and (high > w + 0.01).all() for w, h in boxes[index + 1 :])
    assert plan_svg(campus).count('class="outdoors"') == 1 + 1  # and the legend's
    draw_plan(campus, tmp_path / "plan.png")
    assert (tmp_path / "plan.png").read_bytes()[:4] == b"\x89PNG"
