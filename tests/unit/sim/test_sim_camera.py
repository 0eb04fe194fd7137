"""Mesh, textures, light and sensor of the simulated camera."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from box_rooms import box_room
from experiments.generated.scenes import Patch, PatchFace
from sim.render.mesh import build_mesh
from sim.render.rasterizer import sample_offsets
from sim.render.renderer import Renderer, illumination
from sim.render.sensor import SensorParameters, compress_jpeg, expose
from sim.render.textures import TEXTURES, texture_code
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0), 128, 128)
WALL = np.array([(4.0, 60.0, -60.0), (4.0, -60.0, -60.0), (4.0, -60.0, 60.0), (4.0, 60.0, 60.0)])
SQUARE = np.array([(4.0, 1.0, 0.0), (4.0, -1.0, 0.0), (4.0, -1.0, 2.0), (4.0, 1.0, 2.0)])


def seen(*patches: Patch, x: float = 0.0) -> NDArray[np.float32]:
    pose = CameraMount(1.0).camera_from_robot @ Pose2(x, 0.0, 0.0).lifted().inverse()
    return Renderer.of_faces([PatchFace(patches)]).radiance(CAMERA, pose)


def test_a_later_region_of_a_face_covers_an_earlier_one() -> None:
    white, black = (0.9, 0.9, 0.9), (0.0, 0.0, 0.0)
    small = SQUARE * (1.0, 0.5, 0.5) + (0.0, 0.0, 0.5)
    assert seen(Patch("wall", SQUARE, white), Patch("patch", small, black))[64, 64].max() == 0.0
    assert seen(Patch("patch", small, black), Patch("wall", SQUARE, white))[64, 64].min() > 0.4


@pytest.mark.parametrize("name", TEXTURES)
def test_textures_vary_a_little_up_close_and_are_calm_far_away(name: str) -> None:
    near = seen(Patch("wall", WALL, (0.7, 0.7, 0.7), name, 0.2, 3), x=3.0)[..., 1]
    far = seen(Patch("wall", WALL, (0.7, 0.7, 0.7), name, 0.002, 3), x=0.0)[32:96, 32:96, 1]
    loud = 0.4 if name == "poster" else 0.07
    assert 0.0005 < near.std() / near.mean() < loud
    assert far.std() / far.mean() < 0.012


def test_faces_that_meet_in_a_crease_differ_in_brightness() -> None:
    normals = np.array([(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], float)
    light = illumination(normals)
    creases = [(i, j) for i in range(6) for j in range(i) if abs(normals[i] @ normals[j]) < 0.5]
    assert min(abs(light[i] - light[j]) / max(light[i], light[j]) for i, j in creases) > 0.008
    walls = np.sort(light[:4])
    assert np.diff(walls).min() > 0.04


def test_samples_are_as_many_rooks() -> None:
    for count in (1, 4, 8, 16):
        assert np.allclose(np.sort(sample_offsets(count)), (np.arange(count) + 0.5) / count - 0.5)
    with pytest.raises(ValueError, match="1, 4, 8, 16 samples"):
        sample_offsets(3)


@pytest.mark.parametrize(("change", "message"), [
    ({"polygon_world": SQUARE[:2]}, "at least 3"),
    ({"polygon_world": SQUARE[[0, 1, 3, 2]]}, "convex|area"),
    ({"polygon_world": SQUARE + np.eye(4, 3) * (0.1, 0.0, 0.0)}, "flat"),
    ({"colour": (0.5, 0.5, 2.0)}, "0..1"),
    ({"texture": "velvet"}, "expected a texture of plain"),
    ({"texture_scale_m": 0.0}, "> 0"),
])
def test_regions_that_cannot_be_drawn_are_refused(change: dict[str, Any], message: str) -> None:
    wall = replace(Patch("wall", SQUARE), **change)
    with pytest.raises(ValueError, match=message):
        build_mesh([PatchFace((wall,))])


def test_texture_codes_follow_the_list() -> None:
    assert [texture_code(name) for name in TEXTURES] == list(range(len(TEXTURES)))


def test_noise_grows_with_light_as_stated_and_is_gaussian_enough() -> None:
    parameters = SensorParameters(gain=1.0, gain_sigma=0.0, blur_px=0.0, read_noise=2.0, shot_noise=0.05)
    for level in (50.0, 200.0):
        flat = np.full((256, 256, 3), level / 255.0, np.float32)
        image = expose(flat, parameters, np.random.default_rng(7)).astype(float)
        assert image.mean() == pytest.approx(level, abs=0.1)
        assert image.var() == pytest.approx(4.0 + 0.05 * level + 1.0 / 12.0, rel=0.03)
        centred = (image - image.mean()).ravel()
        assert abs(np.mean(centred**3)) / image.std() ** 3 < 0.05
        assert abs(np.mean(centred[1:] * centred[:-1])) / image.var() < 0.02


def test_a_frame_is_the_same_for_the_same_generator_and_another_for_another() -> None:
    radiance = Renderer.of_faces(box_room()).radiance(CAMERA, CameraMount(1.0).camera_from_robot @
                                                      Pose2(1.0, 2.0, 0.0).lifted().inverse())
    frames = [compress_jpeg(expose(radiance, SensorParameters(), np.random.default_rng(s)), 92) for s in (1, 1, 2)]
    assert frames[0] == frames[1] != frames[2]
    decoded = cv2.imdecode(np.frombuffer(frames[0], np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    assert np.abs(decoded[..., ::-1].astype(float) - np.clip(radiance * 255 * 1.25, 0, 255)).mean() < 6.0


def test_it_is_dark_with_the_lights_off() -> None:
    flat = np.full((32, 32, 3), 0.8, np.float32)
    assert expose(flat, SensorParameters(), np.random.default_rng(0), lights_on=False).mean() < 10.0


@pytest.mark.parametrize("bad", [{"gain": -1.0}, {"jpeg_quality": 0}, {"read_noise": math.nan}])
def test_impossible_sensors_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"expected .* got"):
        replace(SensorParameters(), **bad)
