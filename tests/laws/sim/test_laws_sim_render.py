"""Laws of the renderer, against projections and rays computed here by other means."""

from __future__ import annotations

import math

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from box_rooms import box_faces, box_room
from experiments.generated.scenes import Patch, PatchFace
from sim.render.mesh import Mesh, Pinhole, build_mesh, project_mesh
from sim.render.pieces import split_pieces
from sim.render.rasterizer import find_visible_patches, sample_offsets
from sim.render.renderer import Renderer
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose, Pose2

CAMERA = Camera.from_field_of_view(math.radians(65.0), 256, 256)
MOUNT = CameraMount(1.0, 0.1)
FLAT = 1e6
"""A texture scale at which "plain" is one colour."""


def opencv_projection(points_world: NDArray[np.float64], camera_from_world: Pose) -> NDArray[np.float64]:
    """(n, 2) pixels of points (n, 3), by OpenCV."""
    turn, _ = cv2.Rodrigues(np.array(camera_from_world.rotation))
    pixels, _ = cv2.projectPoints(points_world, turn, np.array(camera_from_world.translation), CAMERA.matrix, None)
    return np.asarray(pixels, float).reshape(-1, 2)


def card(corners_world: NDArray[np.float64]) -> tuple[PatchFace, ...]:
    """A bright card before a dark wall."""
    wall = np.array([(9.0, 40.0, -40.0), (9.0, -40.0, -40.0), (9.0, -40.0, 40.0), (9.0, 40.0, 40.0)])
    return (
        PatchFace((Patch("wall", wall, (0.1, 0.1, 0.1), "plain", FLAT),)),
        PatchFace((Patch("card", corners_world, (0.9, 0.9, 0.9), "plain", FLAT),)),
    )


def edge_errors_px(image: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
    """Measured minus projected place of an edge, along the image axis that crosses it, at each row or column.

    A box-filtered edge moves the sum of a profile by exactly the brightness step for each pixel that it moves.
    """
    if abs(ends[1, 1] - ends[0, 1]) < abs(ends[1, 0] - ends[0, 0]):
        image, ends = image.T, ends[:, ::-1]
    a, b = ends[np.argsort(ends[:, 1])]
    slope = (b[0] - a[0]) / (b[1] - a[1])
    errors = []
    for row in range(math.ceil(max(a[1], 0) + 8), math.floor(min(b[1], image.shape[0] - 1) - 8)):
        x = a[0] + slope * (row - a[1])
        first, last = round(x) - 5, round(x) + 5
        if first < 0 or last >= image.shape[1]:
            continue
        profile = image[row, first : last + 1]
        covered = float(np.sum((profile - profile[-1]) / (profile[0] - profile[-1])))
        errors.append(first - 0.5 + covered - x)
    return np.array(errors)


@st.composite
def cards(draw: st.DrawFn) -> NDArray[np.float64]:
    """A square card some metres ahead, turned in all ways, counter-clockwise to the camera; often exactly upright."""
    number = st.floats(-1.0, 1.0)
    yaw, pitch, roll = (0.5 * draw(number), 0.4 * draw(number), draw(st.sampled_from([0.0, 0.0, draw(number)])))
    if draw(st.booleans()):
        pitch = roll = 0.0
    square = np.array([(0, 1, -1), (0, -1, -1), (0, -1, 1), (0, 1, 1)], float) * draw(st.floats(0.6, 0.9))
    turned = Pose.from_rotation_vector([roll, pitch, yaw], [4.0, 0.3 * draw(number), 1.0 + 0.3 * draw(number)])
    return turned.apply(square)


@settings(deadline=None, max_examples=40)
@given(cards())
def test_edges_lie_where_they_project_to_a_tenth_of_a_pixel(corners: NDArray[np.float64]) -> None:
    camera_from_world = MOUNT.camera_from_robot @ Pose2(0.0, 0.0, 0.0).lifted().inverse()
    image = Renderer.of_faces(card(corners)).radiance(CAMERA, camera_from_world)[..., 1].astype(float)
    pixels = opencv_projection(corners, camera_from_world)
    edges = [pixels[[i, (i + 1) % 4]] for i in range(4)]
    errors = [edge_errors_px(image, ends) for ends in edges]
    assert min(len(e) for e in errors) > 20
    assert math.sqrt(float(np.mean(np.concatenate(errors) ** 2))) < 0.1
    for ends, found in zip(edges, errors, strict=True):
        if abs(ends[1, 0] - ends[0, 0]) < 1e-6:
            assert np.abs(found).max() < 0.5 / 8 + 1e-3, "an upright edge is placed to half a step of eight samples"


def rays_hit(
    mesh: Mesh, camera_from_world: Pose, pixels: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """The nearest one-sided patch on the ray of each pixel (n, 2), by trying all, and where that is beyond doubt."""
    back = camera_from_world.inverse()
    rays = CAMERA.rays(pixels) @ back.rotation.T
    depth = np.full((len(mesh), len(pixels)), np.inf)
    doubtful = np.zeros(len(pixels), bool)
    for p in range(len(mesh)):
        polygon, normal = mesh.vertices_world[mesh.first[p] : mesh.first[p + 1]], mesh.planes_world[p, :3]
        height = float(normal @ (back.translation - polygon[0]))
        falling = rays @ normal
        if height <= 0:
            continue
        reach = np.where(falling < 0, -height / np.where(falling < 0, falling, -1.0), np.inf)
        points = back.translation + np.where(np.isfinite(reach), reach, 0.0)[:, None] * rays
        sides = np.roll(polygon, -1, axis=0) - polygon
        inward = np.cross(normal, sides / np.linalg.norm(sides, axis=1)[:, None])
        margin = np.min([(points - polygon[k]) @ inward[k] for k in range(len(polygon))], axis=0)
        hit = np.isfinite(reach) & (reach > 0.02)
        doubtful |= hit & (np.abs(margin) < 1e-6)
        depth[p] = np.where(hit & (margin > 0), reach, np.inf)
    order = np.sort(depth, axis=0)
    doubtful |= np.isfinite(order[1]) & (order[1] < 1.00001 * order[0])
    return np.where(np.isfinite(order[0]), np.argmin(depth, axis=0), -1), ~doubtful


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6), st.floats(0.2, 5.8), st.floats(0.2, 3.8), st.floats(-3.2, 3.2), st.floats(-0.4, 0.4))
def test_the_nearest_face_wins(seed: int, x: float, y: float, heading: float, tilt: float) -> None:
    rng = np.random.default_rng(seed)
    lows = rng.uniform((0.5, 0.5, 0.0), (5.0, 3.0, 1.5), (6, 3))
    clutter = [f for i, low in enumerate(lows) for f in box_faces(low, low + rng.uniform(0.1, 0.9, 3), f"box{i}")]
    mesh = build_mesh([*(f for f in box_room() if len(f.front) == 1), *clutter])
    camera_from_world = CameraMount(1.0, 0.1, tilt).camera_from_robot @ Pose2(x, y, heading).lifted().inverse()
    lens = Pinhole.of(CAMERA)
    view = project_mesh(mesh, lens, camera_from_world.rotation, camera_from_world.translation)
    seen = find_visible_patches(mesh, view, lens, 4)
    rows, subs, columns = rng.integers(0, 256, 400), rng.integers(0, 4, 400), rng.integers(0, 256, 400)
    pixels = np.stack([columns + sample_offsets(4)[subs], rows - 0.5 + (subs + 0.5) / 4], axis=1)
    expected, certain = rays_hit(mesh, camera_from_world, pixels)
    assert certain.sum() > 300
    np.testing.assert_array_equal(seen[rows, subs, columns][certain], expected[certain])


@settings(deadline=None, max_examples=10)
@given(st.floats(0.5, 5.5), st.floats(0.5, 3.5), st.floats(-3.2, 3.2))
def test_a_closed_room_has_no_holes_and_the_same_pose_gives_the_same_bytes(x: float, y: float, heading: float) -> None:
    pose = MOUNT.camera_from_robot @ Pose2(x, y, heading).lifted().inverse()
    mesh = build_mesh(box_room())
    lens = Pinhole.of(CAMERA)
    seen = find_visible_patches(mesh, project_mesh(mesh, lens, pose.rotation, pose.translation), lens, 8)
    assert seen.min() >= 0
    first, second = (Renderer.of_faces(box_room()).image(CAMERA, pose).tobytes() for _ in range(2))
    assert first == second


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10**6), st.integers(1, 4))
def test_the_pieces_make_up_what_is_seen(seed: int, patches: int) -> None:
    rng = np.random.default_rng(seed)
    coarse = rng.integers(-1, patches, (6, 1, 5)).astype(np.int16)
    seen = np.repeat(np.repeat(coarse, 4, axis=1), 7, axis=2)
    scattered = rng.random(seen.shape) < 0.03
    seen[scattered] = rng.integers(-1, patches, int(scattered.sum()))
    pieces = split_pieces(seen, sample_offsets(4), patches)
    parts = np.zeros((patches, 6, 35))
    for patch in range(patches):
        for i in pieces.order[pieces.first[patch] : pieces.first[patch + 1]]:
            assert pieces.patch[i] == patch
            columns = slice(pieces.column[i], pieces.column[i] + pieces.length[i])
            parts[patch, pieces.row[i], columns] += pieces.weight[i]
            samples = np.flatnonzero(seen[pieces.row[i], :, pieces.column[i]] == patch)
            amid = pieces.column[i] + sample_offsets(4)[samples].mean(), pieces.row[i] + (samples.mean() - 1.5) / 4
            assert np.allclose((pieces.u[i], pieces.v[i]), amid)
    np.testing.assert_array_equal(parts, [(seen == patch).mean(axis=1) for patch in range(patches)])
    np.testing.assert_array_equal(pieces.bare, (seen < 0).mean(axis=1))
