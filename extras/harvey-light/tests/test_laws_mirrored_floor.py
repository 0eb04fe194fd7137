"""A shiny floor is a mirror: the lamps that are seen in it do not stand on it."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from box_rooms import box_faces
from experiments.generated.scenes import Patch, PatchFace
from harvey_light.baked import BAKED
from knowledge_sources.methods.floor.model_floor import STEP_PX, ModelFloor, build_floor_grid
from knowledge_sources.methods.floor.relief import TwoPictures, find_relief
from knowledge_sources.methods.floor.see_floor import GREY, find_unlike
from knowledge_sources.methods.floor.standing_regions import compute_parallax_odds, find_regions
from sim.render.lighting import Lighting
from sim.render.lights import Room
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

CAMERA, MOUNT = Camera.from_field_of_view(math.radians(65.0), 512, 512), CameraMount(1.0, 0.1)


def views(gloss: float, thing: bool) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], Pose2]:
    """Grey pictures now and before, reduced, what is unlike floor now, and the pose now in that before."""
    faces = [f for f in box_faces((0, 0, 0), (9, 4, 2.6), "room", inside=True, texture="plain", texture_scale_m=1e6,
                                  colour=(0.7, 0.7, 0.7)) if f.front[0].name != "room-bottom"]
    faces.append(PatchFace((Patch("floor", [(0, 0, 0), (9, 0, 0), (9, 4, 0), (0, 4, 0)], (0.4, 0.39, 0.37), "carpet",
                                  0.05, 3),)))
    if thing:
        faces += box_faces((3.6, 1.8, 0.0), (3.9, 2.2, 0.4), "box", texture="plain", texture_scale_m=1e6,
                           colour=(0.1, 0.1, 0.1))
    room = Room(np.array([(0.0, 0.0), (9.0, 0.0), (9.0, 4.0), (0.0, 4.0)]), 0.0, 2.6)
    lighting = Lighting(flat=0.6 if thing else 0.0, lamps=0.0 if thing else 0.8, floor_gloss=gloss, lamp_spacing_m=2.6)
    renderer = BAKED.build(faces, lighting, [room])
    before, now = Pose2(0.5, 2.0, 0.0), Pose2(1.1, 2.0, 0.0)
    pictures = []
    for pose in (now, before):
        image = renderer.image(CAMERA, MOUNT.camera_from_robot @ pose.lifted().inverse())
        pictures.append(cv2.resize(image, (256, 256), interpolation=cv2.INTER_AREA))
    grid = build_floor_grid(CAMERA, MOUNT, 1.0, 9.0)
    assert grid is not None
    all_floor, nowhere = np.ones(grid.shape, bool), np.full(grid.shape, np.inf, np.float32)
    model = ModelFloor(np.zeros(grid.shape, np.int64), np.array([(0.4, 0.39, 0.37)]), all_floor, nowhere, nowhere)
    unlike, _, _ = find_unlike(pictures[0][grid.top :], model)
    grey = [picture.astype(np.float32) @ GREY for picture in pictures]
    return grey[0], grey[1], unlike, before.inverse() @ now


@pytest.mark.parametrize(("gloss", "thing"), [(1.0, False), (0.0, True)])
def test_mirrored_lamps_do_not_stand_on_the_floor_and_a_box_does(gloss: float, thing: bool) -> None:
    now, before, unlike, moved = views(gloss, thing)
    grid = build_floor_grid(CAMERA, MOUNT, 1.0, 9.0)
    assert grid is not None and now.shape == (512 // STEP_PX, 512 // STEP_PX)
    near = (grid.ranges_m < 7.0) & (np.abs(grid.points_robot[..., 1]) < 1.8)
    regions = find_regions(unlike & near, near, grid)
    relief = find_relief(TwoPictures(grid, now, before, moved, CAMERA, MOUNT), near & ~unlike)
    assert regions and relief is not None
    odds = [compute_parallax_odds(region, relief, grid) for region in regions]
    if thing:
        assert max(odds) > 1.0
    else:
        assert min(odds) < 1.0 and max(odds) <= 1.0
