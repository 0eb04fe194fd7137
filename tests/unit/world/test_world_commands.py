"""Commands in plain words: what is meant, and how it is refused."""

import numpy as np
import pytest

from world_models.building.geometry.outlines import distance_to_border, inside_polygon
from world_models.commands import check_command, find_open_point, find_room, parse_command
from world_models.files.world_files import WORLDS, load_world

WORLD = load_world(WORLDS / "research_center.toml")


@pytest.mark.parametrize("text", [
    "Go from the laboratory to Allen's office", "please drive from the robot laboratory to allens-office.",
    "Bring this from the laboratory to Allen",
])
def test_a_sentence_means_two_rooms(text: str) -> None:
    check_command(text)
    origin, destination = parse_command(text, WORLD)
    assert (origin.locale, destination.locale) == ("robot-laboratory", "allens-office")


def test_a_ptrans_is_read_as_ever() -> None:
    origin, destination = parse_command("(ptrans (hallway (4,4,0)) (library (5,6,0)))", WORLD)
    assert (origin.locale, destination.locale, origin.x_m) == ("hallway", "library", pytest.approx(4 * 0.3048))


@pytest.mark.parametrize(("text", "message"), [
    ("Go from the laboratory to an office", r"seven rooms answer to 'an office': allens-office, .* and 1 more"),
    ("Go from the laboratory to the moon", "no room of research-center answers to 'the moon'"),
    ("Go from the laboratory to the", "no room of research-center answers to 'the'"),
    ("Go to the library", "expected 'from' and the room where the robot stands"),
    ("Fetch the book", "expected a goal like"),
    ("Sing", "expected a goal like .* 'Go from ROOM to ROOM'"),
    ("(ptrans (moon (4,4,0)) (library (5,6,0)))", "expected a locale of research-center .*got 'moon'"),
])
def test_what_is_not_understood_is_refused_with_its_reason(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parse_command(text, WORLD)


@pytest.mark.parametrize("room", WORLD.rooms)
def test_the_middle_of_a_room_is_free(room: str) -> None:
    place = find_open_point(WORLD, room)
    point = np.array(place.in_world(WORLD).position)
    assert inside_polygon(point, WORLD.outline(room))
    assert min(distance_to_border(point, border) for border in (WORLD.outline(room), *WORLD.obstacles(room))) > 0.6


def test_a_full_name_is_preferred_to_words() -> None:
    assert find_room("Mail room", WORLD) == "mail-room"
