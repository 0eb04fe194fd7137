"""The trials of Table 3: fixed sets of matched lines, some of them wrong, and every method on the same data."""

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
    corridor,
    drawn_prior,
    end_noise,
    fragmented,
    position_error_ft,
    position_limit_ft,
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
"""By so much the camera has come nearer from Outdoor 1 to Outdoor 3."""
POSTS_AND_HALL = np.array([*range(12), 12, 13, 14, 16, 17])
"""Of the campus: the lamp posts and telephone poles with their arms, and the nearest building without its foot."""
LONG_EDGES_AND_DOORS = np.array([*range(4), *range(6, 21)])
"""Of the corridor: its four long edges and five doors."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One row: which lines, how many of them wrong, and what is varied.

    Attributes:
        drawn: so many lines drawn anew for each trial; 0: the set is fixed.
        parts: only fragments of the segments are seen.
    """

    name: str
    place: str
    wrong: int
    drawn: int = 0
    parts: bool = False


@dataclass(frozen=True, slots=True)
class Trials:
    """Some trials of a frame; each has its own seed."""

    frame: Frame
    seeds: tuple[tuple[int, ...], ...]


@dataclass(frozen=True, slots=True)
class TrialErrors:
    """What some trials found.

    Attributes:
        by_method: for each trial the error [ft], x up, y to the left, z ahead.
        limits_ft: for each trial the greatest deviation along an axis that the right lines allow (Cramér-Rao).
    """

    by_method: dict[str, list[list[float]]]
    limits_ft: list[float]


def errors_of(trials: Trials) -> TrialErrors:
    """Of every method, on the same data."""
    found = [_trial(trials.frame, np.random.default_rng(seed)) for seed in trials.seeds]
    by_method = {name: [errors[name].tolist() for errors, _ in found] for name in found[0][0]}
    return TrialErrors(by_method, [limit for _, limit in found])


@cache
def scene_of(place: str) -> PoseScene:
    """The lines of a place, without noise."""
    makers: Mapping[str, Callable[[], PoseScene]] = {
        "campus": campus,
        "posts": lambda: campus().take(POSTS_AND_HALL),
        "posts, nearer": lambda: campus(ahead_m=AHEAD_M).take(POSTS_AND_HALL),
        "corridor": lambda: corridor(doors=5).take(LONG_EDGES_AND_DOORS),
        "hall": lambda: corridor(doors=14).take(np.arange(46)),
    }
    return makers[place]()


def _trial(frame: Frame, rng: np.random.Generator) -> tuple[Errors, float]:
    scene = scene_of(frame.place)
    if frame.drawn:
        scene = scene.take(np.sort(rng.permutation(len(scene))[: frame.drawn]))
    if frame.parts:
        scene = fragmented(scene, rng)
    segments, wrong = wrong_landmarks(scene, end_noise(scene.segments_px, SIGMA_PX, rng), frame.wrong, rng)
    prior = drawn_prior(scene.camera_from_world, PRIOR_M, PRIOR_RAD, rng)
    methods = _methods(scene, segments, prior, Peer.found())
    errors = {name: np.abs(position_error_ft(solve(), scene.camera_from_world)) for name, solve in methods.items()}
    return errors, float(position_limit_ft(scene.take(~wrong), SIGMA_PX).max())


def _methods(scene: PoseScene, segments: Array, prior: Pose, peer: Peer | None) -> dict[str, Callable[[], Pose]]:
    lines, camera, ids = scene.lines_world, scene.camera, scene.landmark_ids
    out: dict[str, Callable[[], Pose]] = {
        "r_and_t": lambda: r_and_t(lines, segments, camera, prior).camera_from_world
    }
    for solver in (med_r_and_t, trunc_r_and_t):
        found = partial(solver, lines, segments, camera, prior, landmark_ids=ids, sigma_px=SIGMA_PX)
        out[solver.__name__] = partial(_pose_of, found)
    if peer:
        out["ransac"] = lambda: peer.ransac(lines, segments, camera, prior, limit_px=4.0 * SIGMA_PX)
        out["cauchy"] = lambda: peer.refined(lines, segments, camera, prior, loss="CAUCHY", scale_px=2.0 * SIGMA_PX)
    return out


def _pose_of(found: Callable[[], PoseEstimate]) -> Pose:
    return found().camera_from_world
