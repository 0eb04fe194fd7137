"""The law of visibility: model and renderer agree on what is hidden in made-up houses.

A pixel's ray meets several surfaces, of which the renderer draws one. The model decides whether the point on a surface
picked from them is hidden. The two share no code: the renderer has its own projection and a depth buffer; the model
clips by planes and passes through doorways.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from box_rooms import find_hidden, generate_house
from sim.render.mesh import Pinhole, build_mesh, project_mesh
from sim.render.rasterizer import find_visible_patches, sample_offsets
from world_models.building.checks import check_world
from world_models.building.geometry.outlines import inside_polygon
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frames import Pose, Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0), 256, 256)
MOUNT = CameraMount(1.0, 0.1)
MIN_AGREEMENT = 0.999
ROBOT_M = 0.35
"""Radius of the robot that carries the camera."""
SAMPLES = 4
POINTS = 4_000
"""In all: enough that a part of a thousandth is several points."""


def count_agreement(rng: np.random.Generator, views: int, rays: int, frame: str) -> tuple[int, int]:
    """Count the points on which model and renderer agree, and all points, in one generated house."""
    text = generate_house(rng).replace('frame = "plain"', f'frame = "{frame}"')
    world = read_world(Source.parse(text, "house.toml"))
    mesh, lens, same, asked = build_mesh(world.faces), Pinhole.of(CAMERA), 0, 0
    for _ in range(views):
        pose = MOUNT.camera_from_robot @ draw_pose(world, rng).lifted().inverse()
        seen = find_visible_patches(mesh, project_mesh(mesh, lens, pose.rotation, pose.translation), lens, SAMPLES)
        points, drawn = sample_points(world, pose, seen, rng, rays)
        same += int(np.sum(find_hidden(world, CAMERA, pose, points) == ~drawn))
        asked += len(points)
    return same, asked


def draw_pose(world: World, rng: np.random.Generator) -> Pose2:
    """Draw a pose at which a robot can stand; a camera nearer to a surface would see into it."""
    while True:
        room = str(rng.choice(world.rooms))
        outline = world.outline(room)
        point = rng.uniform(outline.min(axis=0) + ROBOT_M, outline.max(axis=0) - ROBOT_M)
        if not any(inside_polygon(point, footprint, ROBOT_M) for footprint in world.obstacles(room)):
            return Pose2(float(point[0]), float(point[1]), float(rng.uniform(-math.pi, math.pi)))


def sample_points(
    world: World, pose: Pose, seen: NDArray[np.int16], rng: np.random.Generator, rays: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Points (n, 3) where rays meet surfaces, and whether the renderer draws that surface there (n,)."""
    scene, eye = world.scene, pose.inverse().translation
    points, drawn = [], []
    for row, part, column in rng.integers((CAMERA.height, SAMPLES, CAMERA.width), size=(rays, 3)):
        pixel = column + sample_offsets(SAMPLES)[part], row + (part + 0.5) / SAMPLES - 0.5
        ray = pose.rotation.T @ CAMERA.rays(np.array([pixel]))[0]
        met = intersect(scene.polygons_world, scene.planes_world, eye, ray)
        if len(met):
            surface = int(rng.choice(met)) if rng.random() < 0.7 else int(seen[row, part, column])
            if surface in met:
                plane = scene.planes_world[surface]
                points.append(eye + ray * ((plane[3] - plane[:3] @ eye) / (plane[:3] @ ray)))
                drawn.append(surface == seen[row, part, column])
    return np.array(points).reshape(-1, 3), np.array(drawn, bool)


def intersect(polygons: NDArray[np.float64], planes: NDArray[np.float64], eye: NDArray[np.float64],
              ray: NDArray[np.float64]) -> NDArray[np.int64]:
    """Indices of the surfaces whose front a ray meets."""
    spokes = polygons - eye
    inside = np.all(np.cross(spokes, np.roll(spokes, -1, axis=1)) @ ray <= 0.0, axis=1)
    return np.flatnonzero(inside & (planes[:, :3] @ ray < -1e-9) & (planes[:, :3] @ eye > planes[:, 3]))


@pytest.mark.parametrize("frame", ["plain", "none"])
def test_the_model_agrees_with_the_renderer_on_what_is_hidden(frame: str) -> None:
    same = asked = 0
    for number in range(5):
        more = count_agreement(np.random.default_rng([7, number]), views=5, rays=220, frame=frame)
        same, asked = same + more[0], asked + more[1]
    assert asked > POINTS
    assert same >= MIN_AGREEMENT * asked, f"{asked - same} of {asked} points"


@settings(deadline=None, max_examples=6)
@given(st.integers(0, 10_000))
def test_made_up_houses_are_sound_but_for_things_that_stand_through_walls(seed: int) -> None:
    faults = check_world(read_world(Source.parse(generate_house(np.random.default_rng(seed)), "house.toml")))
    assert all("expected it inside" in fault.what for fault in faults), faults
