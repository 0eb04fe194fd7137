"""A room of one colour in miniworld, and a camera; for the tests."""

from __future__ import annotations

import math

import pytest

from harvey.errors import BadInput
from harvey_miniworld.drawn_floor import load_miniworld
from harvey_miniworld.textured_floor import FloorRoom, StandingThing, TexturedFloor
from world_models.camera import Camera, CameraMount

CAMERA, MOUNT = Camera.from_field_of_view(math.radians(75.0), 320, 240), CameraMount(1.2, 0.05, math.radians(5.0), 0.0)


def needs_egl() -> None:
    try:
        load_miniworld()
    except BadInput as error:
        pytest.skip(str(error))


def plain_floor(*added: StandingThing) -> TexturedFloor:
    room = FloorRoom("corridor", (0.0, 6.0), (0.0, 4.0), "white", "concrete", "white", 2.6)
    return TexturedFloor(0, (room,), (), (), (), (), 0.2, added)
