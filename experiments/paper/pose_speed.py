"""Time of the pose solvers: least squares and combinatorial, beside PoseLib on the same data."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from experiments.paper.pose_peer import NOT_INSTALLED, Peer
from experiments.paper.pose_scenes import PoseScene, campus, draw_prior, end_noise, wrong_landmarks
from experiments.paper.pose_solvers import r_and_t, trunc_r_and_t
from experiments.report import Cell, Report
from knowledge_sources.methods.pose import med_r_and_t, r_and_t_ml
from world_models.frames import Pose

Array = NDArray[np.float64]
Call = Callable[[], object]

TRIALS, QUICK_TRIALS = 200, 20
ROUNDS, CALLS = 5, 4
"""Rounds per trial, in which the methods alternate, and calls per round; a method's time is its best call."""
LINES, LANDMARKS, WRONG = 17, (0, 1, 4, 5, 6, 7), 5
SIGMA_PX, PRIOR_M, PRIOR_RAD = 0.4, 0.6, 0.04
MAX_COMBINATORIAL_RATIO = 0.6
NOTES = (
    f"{LINES} lines of {len(LANDMARKS)} landmarks of the campus of Table 2: 20 subsets of three. {WRONG} lines wrong"
    " for the robust solvers, none for the others.",
    f"Ends with {SIGMA_PX} px of noise; prior off by up to {PRIOR_M} m and {PRIOR_RAD} rad on each axis.",
    "Whole calls from Python on both sides, checks and results included; ours also gives residuals, covariance and"
    " reasons. The inner loops of ours are compiled by numba, PoseLib is C++. The peer's pose object is made within its"
    " call.",
    f"Each figure: median over the trials of the best of {ROUNDS} rounds of {CALLS} calls, in alternation, so that"
    " other load on the machine meets both equally. The paper gives no times.",
)


def run(quick: bool, seed: int, trials: int | None = None) -> Report:
    """Measure medians [µs], and the ratio of ours to the peer's from the same rounds."""
    count, peer, rng = trials or (QUICK_TRIALS if quick else TRIALS), Peer.find(), np.random.default_rng(seed)
    scene = _scene()
    turns = tqdm(range(count + 1), unit="trial", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False)
    rounds = [_time_calls_s(_calls(scene, peer, rng)) for _ in turns][1:]  # the first one compiles
    us = {name: float(np.median([times[name] for times in rounds])) * 1e6 for name in rounds[0]}
    rows = (
        ("one pose, least squares in the image", _compare(us, "r_and_t_ml", "refine")),
        ("one pose, E1 of the paper", _compare(us, "r_and_t", "refine")),
        (f"{WRONG} of {LINES} wrong: Med R and T", _compare(us, "med_r_and_t", "ransac")),
        (f"{WRONG} of {LINES} wrong: Trunc R and T", _compare(us, "trunc_r_and_t", "ransac")),
    )
    claims: list[tuple[str, bool]] = []
    if peer:
        claims = [
            (f"Med R and T takes at most {MAX_COMBINATORIAL_RATIO:g} x the time of LO-RANSAC",
             us["med_r_and_t"] <= MAX_COMBINATORIAL_RATIO * us["ransac"]),
            (f"Trunc R and T takes at most {MAX_COMBINATORIAL_RATIO:g} x the time of LO-RANSAC",
             us["trunc_r_and_t"] <= MAX_COMBINATORIAL_RATIO * us["ransac"]),
        ]
    return Report(
        "Time for a pose from lines",
        ("what", "paper", "peer: PoseLib [µs]", "ours [µs]", "ours / peer"),
        tuple((what, None, *cells) for what, cells in rows),
        (*NOTES, f"{count} trials, seed {seed}."),
        tuple(claims),
    )


def _scene() -> PoseScene:
    """Select lines of four posts and two buildings of the campus."""
    scene = campus()
    return scene.take(np.flatnonzero(np.isin(scene.landmark_ids, LANDMARKS))[:LINES])


def _calls(scene: PoseScene, peer: Peer | None, rng: np.random.Generator) -> dict[str, Call]:
    lines, camera, ids = scene.lines_world, scene.camera, scene.landmark_ids
    clean = end_noise(scene.segments_px, SIGMA_PX, rng)
    mixed, _ = wrong_landmarks(scene, clean, WRONG, rng)
    prior: Pose = draw_prior(scene.camera_from_world, PRIOR_M, PRIOR_RAD, rng)
    calls: dict[str, Call] = {
        "r_and_t_ml": lambda: r_and_t_ml(lines, clean, camera, prior, sigma_px=SIGMA_PX),
        "r_and_t": lambda: r_and_t(lines, clean, camera, prior, sigma_px=SIGMA_PX),
        "med_r_and_t": lambda: med_r_and_t(lines, mixed, camera, prior, landmark_ids=ids, sigma_px=SIGMA_PX),
        "trunc_r_and_t": lambda: trunc_r_and_t(lines, mixed, camera, prior, landmark_ids=ids, sigma_px=SIGMA_PX),
    }
    if peer:
        calls["refine"] = lambda: peer.refine(lines, clean, camera, prior, loss="TRIVIAL")
        calls["ransac"] = lambda: peer.ransac(lines, mixed, camera, prior, max_residual_px=4.0 * SIGMA_PX)
    return calls


def _time_calls_s(calls: dict[str, Call]) -> dict[str, float]:
    best = dict.fromkeys(calls, float("inf"))
    for _ in range(ROUNDS):
        for name, call in calls.items():
            for _ in range(CALLS):
                began = time.perf_counter()
                call()
                best[name] = min(best[name], time.perf_counter() - began)
    return best


def _compare(us: dict[str, float], ours: str, peer: str) -> tuple[Cell, ...]:
    if peer not in us:
        return NOT_INSTALLED, us[ours], None
    return us[peer], us[ours], us[ours] / us[peer]
