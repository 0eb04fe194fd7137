"""A door found shut and things gone, on the geometry of one locale."""

import numpy as np
import pytest

from logs.recording.loggers.surroundings.model_building import _meshes
from world_models.building.changes import build_shut_faces, element_names, remove_element, remove_thing, shut_door
from world_models.building.geometry.faces import UNKNOWN, area_vector, expected_brightness
from world_models.building.world import World, build_frames
from world_models.files.world_files import WORLDS, load_world

WORLD = load_world(WORLDS / "research_center.toml", details=[])
OFFICE = WORLD.frame("allens-office").parts
HALLWAY = WORLD.frame("hallway").parts
(DOOR,) = WORLD.doorways_of("allens-office")


def test_shut_faces_fill_the_opening_towards_each_room_and_claim_no_colour() -> None:
    for locale, face in zip(DOOR.between, build_shut_faces(DOOR, 0.5), strict=True):
        assert (face.name, face.kind, face.locale) == (f"{locale}/{DOOR.name}/shut", "barrier", locale)
        assert face.neighbour == DOOR.other(locale)
        inward = -np.array([*DOOR.outward_from(locale), 0.0])
        assert np.allclose(area_vector(face.polygon_world), DOOR.width_m * DOOR.height_m * inward)
        assert face.polygon_world[:, 2].tolist() == [0.5, 0.5, 0.5 + DOOR.height_m, 0.5 + DOOR.height_m]
        assert np.isnan(face.front[0].colour).all() and face.back == ()
    assert np.isnan(expected_brightness(UNKNOWN, (0.0, 0.0, 1.0)))


def test_a_shut_door_takes_the_place_of_the_opening_in_the_parts_of_both_rooms() -> None:
    office, hallway = (shut_door(parts, DOOR, 0.0) for parts in (OFFICE, HALLWAY))
    assert element_names(OFFICE) - element_names(office) == {
        f"{room}/{DOOR.name}/doorway" for room in DOOR.between}
    assert element_names(office) - element_names(OFFICE) == {f"{room}/{DOOR.name}/shut" for room in DOOR.between}
    shared = {(part.locale, part.neighbour): part for part in hallway}
    for part in office:
        if part.neighbour is not None:
            same = shared[part.locale, part.neighbour]
            assert [(n, face.name) for n, face in part.faces] == [(n, face.name) for n, face in same.faces]
            for (n, mark), (k, other) in zip(part.landmarks, same.landmarks, strict=True):
                assert (n, mark.name) == (k, other.name) and np.array_equal(mark.lines_world, other.lines_world)
    numbers = [number for part in hallway for number, _ in part.faces]
    assert len(set(numbers)) == len(numbers) and sum(number < 0 for number in numbers) == 2


def test_other_doors_stay_open_and_what_does_not_change_is_the_same() -> None:
    shut = shut_door(HALLWAY, DOOR, 0.0)
    doorways = [face.name for part in shut for _, face in part.faces if face.kind == "doorway"]
    assert len(doorways) == 2 * (len(WORLD.doorways_of("hallway")) - 1)
    assert all(one is other for one, other in zip(HALLWAY, shut, strict=True)
               if "allens-office" not in (one.locale, one.neighbour))


def test_doors_are_shut_in_any_order_and_twice_alike() -> None:
    first, second = WORLD.doorways_of("hallway")[:2]
    one, other = (sorted((part.locale, part.neighbour or "", [number for number, _ in part.faces]) for part in parts)
                  for parts in (shut_door(shut_door(HALLWAY, first, 0.0), second, 0.0),
                                shut_door(shut_door(shut_door(HALLWAY, second, 0.0), first, 0.0), second, 0.0)))
    assert one == other


def test_a_shared_part_that_was_not_there_is_made() -> None:
    own = tuple(part for part in OFFICE if part.neighbour is None)
    assert [(part.locale, part.neighbour, len(part.faces)) for part in shut_door(own, DOOR, 0.0)[1:]] == [
        (*DOOR.between, 1), (*DOOR.between[::-1], 1)]


def test_a_thing_that_is_gone_leaves_no_face_no_line_and_no_obstacle() -> None:
    things = WORLD.things_of("allens-office")
    parts, left = remove_thing(OFFICE, things, "allens-office/desk")
    gone = element_names(OFFICE) - element_names(parts)
    assert gone and all(name.startswith("allens-office/desk/") for name in gone)
    assert [thing for thing in things if thing not in left] == [
        thing for thing in things if thing.name == "allens-office/desk"]
    marks = {mark.name: (number, mark) for part in parts for number, mark in part.landmarks}
    for part in OFFICE:
        for number, mark in part.landmarks:
            assert marks[mark.name][0] == number
            assert len(marks[mark.name][1].edges) == (0 if mark.name == "allens-office/desk" else len(mark.edges))
    assert all(len(part.scene.line_landmark) <= len(was.scene.line_landmark)
               for part, was in zip(parts, OFFICE, strict=True))
    with pytest.raises(ValueError, match=r"expected one of the things .*allens-office/desk.*, got 'desk'"):
        remove_thing(OFFICE, things, "desk")


def test_a_thing_is_gone_and_not_one_whose_name_begins_alike() -> None:
    things = WORLD.things_of("hallway")
    parts, left = remove_thing(HALLWAY, things, "hallway/pillar-1")
    assert len(left) == len(things) - 1
    assert element_names(parts) >= {name for name in element_names(HALLWAY) if not name.startswith("hallway/pillar-1")}


def test_one_landmark_or_one_face_is_removed() -> None:
    parts = remove_element(OFFICE, DOOR.name)
    assert element_names(parts) == element_names(OFFICE)
    assert [len(mark.edges) for part in parts for _, mark in part.landmarks if mark.name == DOOR.name] == [0]
    parts = remove_element(OFFICE, "allens-office/floor")
    assert element_names(OFFICE) - element_names(parts) == {"allens-office/floor"}
    assert all(one is other for one, other in zip(OFFICE, parts, strict=True) if one.neighbour is not None)
    with pytest.raises(ValueError, match="expected the name of a face or landmark of allens-office, hallway, got 'x'"):
        remove_element(OFFICE, "x")


@pytest.mark.filterwarnings("error")
def test_a_surface_of_unknown_colour_is_recorded_grey() -> None:
    shut = (*WORLD.faces, *build_shut_faces(DOOR, 0.0))
    ((_, mesh),) = _meshes(World(build_frames(WORLD.locales, WORLD.doorways, shut, WORLD.landmarks)))
    assert mesh is not None
