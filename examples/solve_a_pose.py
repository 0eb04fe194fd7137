"""Solve for the pose of a camera from matched lines, a third of them matched wrongly (§6.2.4)."""

import math

import harvey  # before numpy: it settles how the libraries calculate

# isort: split
import numpy as np

rng = np.random.default_rng(7)
camera = harvey.Camera.from_field_of_view(math.radians(65.0))
truth = harvey.Pose.from_rotation_vector([0.02, -0.15, 0.01], [0.3, 0.1, -0.2])

# thirty edges of a room in front of the camera: (n, 2, 3), world frame [m]
starts = np.column_stack([rng.uniform(-2, 2, 30), rng.uniform(-1, 1, 30), rng.uniform(4, 9, 30)])
lines = np.stack([starts, starts + rng.uniform(-1.0, 1.0, (30, 3))], axis=1)
segments, _ = camera.project_segments(lines, truth)
segments = segments + rng.normal(0.0, 0.5, segments.shape)  # half a pixel of noise at each end
segments[:10] += rng.uniform(20.0, 60.0, (10, 1, 2))  # ten wrong matches

found = harvey.med_r_and_t(lines, segments, camera, prior=harvey.Pose.identity(), sigma_px=0.5)

error_mm = 1000.0 * np.linalg.norm(found.camera_from_world.translation - truth.translation)
print(f"ok: {found.ok}, {int(found.inliers.sum())} of {len(lines)} lines agree, {error_mm:.1f} mm off")
print(f"line 0 was rejected: {found.rejected[0]}")
