"""Law of the compiled chamfer scores: value by value those of plain projection, with random maps, points and poses."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_sources.methods.localization import pose_candidates
from knowledge_sources.methods.localization.pose_candidates import ChamferMaps, compute_chamfer_scores
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

CAMERA = Camera(310.0, 290.0, 170.0, 110.0, 322, 241)
STEP_M = 1e-6


@given(seed=st.integers(0, 2**32 - 1), pitch=st.floats(-0.4, 0.4), stride=st.integers(1, 3))
@settings(max_examples=40, deadline=None)
def test_compiled_scores_are_those_of_plain_projection(seed: int, pitch: float, stride: int) -> None:
    """The direction of a line in the picture is that in which a point moves which moves a little along the line."""
    rng = np.random.default_rng(seed)
    mount = CameraMount(1.1, pitch, 0.3).camera_from_robot
    height, width = (-(-pixels // pose_candidates.CHAMFER_SHRINK) for pixels in (CAMERA.height, CAMERA.width))
    size = pose_candidates.CHAMFER_DIRECTIONS, height, width
    maps = ChamferMaps(rng.random(size, np.float32), rng.random(size[0], np.float32))
    points = rng.uniform([-4.0, -4.0, 0.0], [4.0, 4.0, 2.5], (150, 3))
    along = rng.normal(size=points.shape)
    along /= np.linalg.norm(along, axis=1)[:, None]
    poses = np.column_stack([rng.uniform(-2.0, 2.0, (6, 2)), rng.uniform(-math.pi, math.pi, 6)])
    first, cell = np.array([0, 40, 40, 120]), rng.integers(0, 3, len(poses))
    visible = rng.permutation(len(points))[:120]
    found = compute_chamfer_scores(maps, CAMERA, mount, poses, points, along, first, visible, cell, stride)
    seen = 0.0
    for pose, c, (near, chance, count) in zip(poses, cell, found, strict=True):
        camera_from_world = mount @ Pose2(*pose).lifted().inverse()
        total = by_chance = number = 0.0
        for k in visible[first[c] : first[c + 1] : stride]:
            at = camera_from_world.apply(points[k])
            if at[2] < pose_candidates.MIN_POINT_DEPTH_M:
                continue
            u, v = CAMERA.project(at)
            if not (0.0 <= u < CAMERA.width and 0.0 <= v < CAMERA.height):
                continue
            moved = CAMERA.project(camera_from_world.apply(points[k] + STEP_M * along[k])) - (u, v)
            layer = round(math.atan2(moved[1], moved[0]) / math.pi * size[0]) % size[0]
            shrink = pose_candidates.CHAMFER_SHRINK
            row, column = (min(n - 1, round(x / shrink)) for n, x in zip(size[1:], (v, u), strict=True))
            total, by_chance, number = total + maps.near[layer, row, column], by_chance + maps.chance[layer], number + 1
        assert count == number
        np.testing.assert_allclose((near, chance), (total, by_chance), rtol=1e-5)
        seen += number
    assert seen > 0 or not np.any(cell != 1)
