"""Trials of Table 3: sets of matched lines with wrong matches, and all methods on the same data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from experiments.paper.pose_peer import Peer
from experiments.paper.pose_scenes import (
    PoseScene,
    campus,
    compute_position_bound_ft,
    compute_position_error_ft,
    corridor,
    draw_prior,
    end_noise,
    fragment,
    wrong_landmarks,
)
from knowledge_sources.methods.pose import PoseEstimate, med_r_and_t, r_and_t, trunc_r_and_t
from world_models.frames import Pose

Array = NDArray[np.float64]
Errors = dict[str, Array]
"""Errors [ft] by method, x up, y to the left, z ahead."""

SIGMA_PX = 0.4
PRIOR_M, PRIOR_RAD = 0.6, 0.04
AHEAD_M = 2.0
"""Advance of the camera from Outdoor 1 to Outdoor 3."""
POSTS_AND_HALL = np.array([*range(12), 12, 13, 14, 16, 17])
"""Of the campus: lamp posts and telephone poles with their arms, and the nearest building without its base."""
LONG_EDGES_AND_DOORS = np.array([*range(4), *range(6, 21)])
"""Of the corridor: its four long edges and five doors."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One row: lines, number of wrong matches, and what is varied.

    Attributes:
        drawn: number of lines drawn for each trial; 0: the set is fixed.
        parts: whether only fragments of the segments are seen.
    """

    name: str
    place: str
    wrong: int
    drawn: int = 0
    parts: bool = False


@dataclass(frozen=True, slots=True)
class Trials:
    """Trials of a frame, each with its own seed."""

    frame: Frame
    seeds: tuple[tuple[int, ...], ...]


@dataclass(frozen=True, slots=True)
class TrialErrors:
    """Results of some trials.

    Attributes:
        by_method: for each trial the error [ft], x up, y to the left, z ahead.
        bounds_ft: for each trial the largest Cramér-Rao bound along an axis from the right lines.
    """

    by_method: dict[str, list[list[float]]]
    bounds_ft: list[float]


def compute_errors(trials: Trials) -> TrialErrors:
    """Compute the errors of all methods on the same data."""
    results = [_run_trial(trials.frame, np.random.default_rng(seed)) for seed in trials.seeds]
    by_method = {name: [errors[name].tolist() for errors, _ in results] for name in results[0][0]}
    return TrialErrors(by_method, [bound for _, bound in results])


@cache
def get_scene(place: str) -> PoseScene:
    """Get the lines of a place, without noise."""
    makers: Mapping[str, Callable[[], PoseScene]] = {
        "campus": campus,
        "posts": lambda: campus().take(POSTS_AND_HALL),
        "posts, nearer": lambda: campus(ahead_m=AHEAD_M).take(POSTS_AND_HALL),
        "corridor": lambda: corridor(doors=5).take(LONG_EDGES_AND_DOORS),
        "hall": lambda: corridor(doors=14).take(np.arange(46)),
    }
    return makers[place]()


def _run_trial(frame: Frame, rng: np.random.Generator) -> tuple[Errors, float]:
    scene = get_scene(frame.place)
    if frame.drawn:
        scene = scene.take(np.sort(rng.permutation(len(scene))[: frame.drawn]))
    if frame.parts:
        scene = fragment(scene, rng)
    segments, wrong = wrong_landmarks(scene, end_noise(scene.segments_px, SIGMA_PX, rng), frame.wrong, rng)
    prior = draw_prior(scene.camera_from_world, PRIOR_M, PRIOR_RAD, rng)
    methods = _methods(scene, segments, prior, Peer.find())
    errors = {name: np.abs(compute_position_error_ft(solve(), scene.camera_from_world))
              for name, solve in methods.items()}
    return errors, float(compute_position_bound_ft(scene.take(~wrong), SIGMA_PX).max())


def _methods(scene: PoseScene, segments: Array, prior: Pose, peer: Peer | None) -> dict[str, Callable[[], Pose]]:
    lines, camera, ids = scene.lines_world, scene.camera, scene.landmark_ids
    out: dict[str, Callable[[], Pose]] = {
        "r_and_t": lambda: r_and_t(lines, segments, camera, prior).camera_from_world
    }
    for solver in (med_r_and_t, trunc_r_and_t):
        solve = partial(solver, lines, segments, camera, prior, landmark_ids=ids, sigma_px=SIGMA_PX)
        out[solver.__name__] = partial(_get_pose, solve)
    if peer:
        out["ransac"] = lambda: peer.ransac(lines, segments, camera, prior, max_residual_px=4.0 * SIGMA_PX)
        out["cauchy"] = lambda: peer.refine(lines, segments, camera, prior, loss="CAUCHY", scale_px=2.0 * SIGMA_PX)
    return out


def _get_pose(solve: Callable[[], PoseEstimate]) -> Pose:
    return solve().camera_from_world
