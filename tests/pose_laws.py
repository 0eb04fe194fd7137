"""What the laws of pose solvers share: the solvers, the scenes, and how far one pose is from another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from experiments.paper.pose_scenes import PoseScene, campus, corridor
from experiments.paper.pose_solvers import r_and_t, r_then_t, trunc_r_and_t
from knowledge_sources.methods.pose import PoseEstimate, med_r_and_t, r_and_t_ml
from world_models.frames import Pose

Solver = Callable[..., PoseEstimate]
ROBUST = [med_r_and_t, trunc_r_and_t]
SOLVERS = [r_then_t, r_and_t, r_and_t_ml, *ROBUST]
SCENES = [campus(), corridor()]
SIGMA_PX = 0.4

seeds = st.integers(0, 2**32 - 1)
scenes = st.sampled_from([0, 1]).map(SCENES.__getitem__)


def by_solver(solvers: Sequence[Solver]) -> Any:
    return pytest.mark.parametrize("solver", solvers, ids=lambda f: f.__name__)


def solve(solver: Solver, scene: PoseScene, segments: Any, prior: Pose, **more: Any) -> PoseEstimate:
    more.setdefault("landmark_ids", scene.landmark_ids)
    return solver(scene.lines_world, segments, scene.camera, prior, sigma_px=SIGMA_PX, **more)


def measure_error(found: Pose, truth: Pose) -> tuple[float, float]:
    """Rotation [rad] and translation [m] between two poses."""
    apart = found @ truth.inverse()
    return float(np.linalg.norm(apart.rotation_vector)), float(np.linalg.norm(apart.translation))
