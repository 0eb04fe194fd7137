"""Floors that nobody drew: the same for the same seed, sound, and symmetric where that is asked for."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from experiments.generated.floors import generated_floor
from sim.render.renderer import Renderer
from sim.scenario import CameraSettings
from world_models.building.checks import check_world
from world_models.files.world_files import load_world
from world_models.frames import Pose2


def test_the_same_seed_gives_the_same_floor_and_another_another() -> None:
    one, again, other = generated_floor(5, 4), generated_floor(5, 4), generated_floor(6, 4)
    assert (one.text, one.details) == (again.text, again.details)
    assert one.text != other.text


def test_it_has_the_rooms_that_were_asked_for_and_its_doors_fit() -> None:
    floor = generated_floor(1, 6, open_share=1.0)
    assert len(floor.rooms) == 6 and len(floor.world.doorways) == 6
    assert check_world(floor.world) == []
    assert len(floor.building.things) > len(floor.world.things)
    assert len(floor.altered(0.3).things) < len(floor.building.things)


def test_many_rooms_are_joined_by_a_gallery() -> None:
    floor = generated_floor(2, 16, open_share=1.0)
    assert floor.corridors == ("corridor-0", "corridor-1", "gallery")
    assert floor.world.route(floor.rooms[0], floor.rooms[-1]) is not None


def test_a_symmetric_corridor_looks_the_same_from_both_ends() -> None:
    def seen(symmetric: bool) -> tuple[np.ndarray, np.ndarray]:
        floor, settings = generated_floor(3, 4, symmetric=symmetric), CameraSettings()
        renderer = Renderer.of_faces(floor.world.faces, 4)
        corners = floor.world.outline("corridor-0")
        (west, south), (east, north) = corners.min(axis=0), corners.max(axis=0)
        here = Pose2(west + 2.0, south + 1.0, 0.1)
        alias = Pose2(west + east - here.x_m, south + north - here.y_m, math.pi + 0.1)
        one, other = (renderer.image(settings.camera, settings.mount.camera_from_robot @ pose.lifted().inverse())
                      for pose in (here, alias))
        return one.astype(float), other.astype(float)

    one, other = seen(True)
    assert np.abs(one - other).mean() < 4.0
    one, other = seen(False)
    assert np.abs(one - other).mean() > 10.0


def test_its_files_can_be_loaded(tmp_path: Path) -> None:
    floor = generated_floor(7, 2)
    world, details = floor.write(tmp_path)
    assert len(load_world(world, details=[details]).things) == len(floor.building.things)


def test_impossible_floors_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 2 rooms"):
        generated_floor(0, 1)
