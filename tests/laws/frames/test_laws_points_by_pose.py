"""Laws of points moved by a pose on the floor."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from world_models.frames import Pose2

POSES = st.builds(Pose2, st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.floats(-7.0, 7.0))
POINTS = st.lists(st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0)), min_size=1, max_size=6)


@given(POSES, POINTS)
def test_points_go_where_the_pose_in_space_takes_them_and_come_back(pose: Pose2, points: list[tuple[float, float]]
                                                                     ) -> None:
    moved = pose.apply(points)
    there = pose.lifted(0.7).apply(np.column_stack([points, np.zeros(len(points))]))[:, :2]
    assert np.allclose(moved, there, atol=1e-9)
    assert np.allclose(pose.inverse().apply(moved), points, atol=1e-9)
