"""Laws of the rays that are cast into the model: what lies outside the rectangle round the rays changes nothing."""

import math

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from knowledge_sources.methods.verification import cast_rays
from world_models.building.geometry.outlines import inside_polygon
from world_models.camera import Camera, CameraMount
from world_models.files.world_files import WORLDS, load_world
from world_models.frames import Pose2
from world_models.visibility.culling import image_window

CAMERA = Camera.from_field_of_view(math.radians(65.0))
MOUNT = CameraMount(1.2, 0.05)
WORLD = load_world(WORLDS / "research_center.toml")
ROOMS = sorted(locale for locale in WORLD.locales if WORLD.is_room(locale))
SIZE = 12


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(ROOMS), st.floats(0.1, 0.9), st.floats(0.1, 0.9), st.floats(-3.1, 3.1), st.floats(0.05, 0.4))
def test_a_part_of_the_picture_is_met_as_in_the_whole(
    room: str, across: float, along: float, heading_rad: float, part: float
) -> None:
    """The same rays with their own rectangle round them, and with one that leaves nothing out."""
    outline = WORLD.outline(room)
    low, high = outline.min(axis=0), outline.max(axis=0)
    x, y = low + np.array([across, along]) * (high - low)
    assume(inside_polygon(np.array([x, y]), outline))
    camera_from_world = MOUNT.camera_from_robot @ Pose2(x, y, heading_rad).lifted().inverse()
    u, v = np.meshgrid(np.linspace(part, part + 0.3, SIZE) - 0.5, np.linspace(part, part + 0.3, SIZE) - 0.5)
    rays = np.ascontiguousarray(np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3))
    own = np.concatenate([rays[:, :2].min(axis=0), rays[:, :2].max(axis=0)])
    every = np.array([-np.inf, -np.inf, np.inf, np.inf])
    window = image_window(CAMERA)
    _, normals, surface, depth = cast_rays(WORLD, camera_from_world, rays, own, window, SIZE, 1)
    _, all_normals, all_surface, all_depth = cast_rays(WORLD, camera_from_world, rays, every, window, SIZE, 1)
    np.testing.assert_array_equal(depth, all_depth)
    met = surface >= 0
    np.testing.assert_array_equal(met, all_surface >= 0)
    np.testing.assert_array_equal(normals[surface[met]], all_normals[all_surface[met]])
    towards = rays[met] @ camera_from_world.rotation  # in the world
    assert np.all(np.sum(towards * normals[surface[met]], axis=1) < 0.0)  # only fronts are met
    assert np.mean(met) > 0.5
