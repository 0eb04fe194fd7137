"""Table 3: wrong matches. R and T against Med R and T (§6.2.4), and what holds beyond half of the lines wrong."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from harvey.experiments.pose_peer import NOT_INSTALLED, Peer
from harvey.experiments.pose_scenes import (
    PoseScene,
    campus,
    corridor,
    drawn_prior,
    end_noise,
    fragmented,
    position_error_ft,
    wrong_landmarks,
)
from harvey.experiments.report import Cell, Report
from knowledge_sources.methods.pose import PoseEstimate, med_r_and_t, r_and_t, trunc_r_and_t
from world_models.frames import Pose

Array = NDArray[np.float64]
Rates = dict[str, list[Array]]

PAPER = (
    ("Outdoor 1", "campus", 17, 5, (0.80, -0.23, 0.20), (2.90, 0.15, 1.10)),
    ("Outdoor 3", "campus", 17, 3, (-1.10, 0.14, 0.10), (34.74, 7.34, 2.30)),
    ("Indoor 1", "corridor", 19, 8, (0.20, 0.07, 0.10), (5.75, 0.40, 0.60)),
    ("Indoor 7", "halls", 46, 8, (0.20, 0.10, 0.10), (0.30, 0.10, 0.40)),
)
FRACTIONS = (0.45, 0.6, 0.7)
SIGMA_PX = 0.4
PRIOR_M, PRIOR_RAD = 0.6, 0.04
LIMIT_FT = 1.1
NOTES = (
    "Scenes ours (the paper's frames are not at hand): the campus of Table 2 and corridors with doors.",
    "Wrong matches are whole landmarks shifted by 15 to 60 px, as mismatches are: 5, 3, 8 and 8 lines of them.",
    f"Ends with Gaussian noise of {SIGMA_PX} px across; prior off by up to {PRIOR_M} m and "
    f"{math.degrees(PRIOR_RAD):.1f} degrees on each camera axis.",
    f"Success: under {LIMIT_FT} ft in every axis. Paper's figures are of one frame each; ours the median magnitude.",
    "Landmark version, every subset tried.",
)


def run(quick: bool, seed: int, samples: int | None = None) -> Report:
    """The four rows, then the share of successes at 45, 60 and 70 % wrong lines, fragmented segments."""
    count = samples or (20 if quick else 1000)
    rng, peer = np.random.default_rng(seed), Peer.found()
    scenes = {"campus": campus(), "corridor": corridor(), "halls": corridor(doors=14)}
    rows: list[tuple[Cell, ...]] = []
    claims = []
    for name, place, n, wrong, med, plain in PAPER:
        errors = _errors(scenes[place], n, wrong, False, count, rng, peer)
        label = f"{name}: {min(n, len(scenes[place]))} lines, {wrong} wrong"
        rows.append((f"{label}: R and T", _triple(plain), None, _median(errors["r_and_t"])))
        rows.append((f"{label}: Med R and T", _triple(med), _median(errors["ransac"]), _median(errors["med_r_and_t"])))
        share = _share(errors["med_r_and_t"])
        rows.append((f"{label}: Med R and T, successes", None, _rate(errors["ransac"]), f"{share:.1%}"))
        claims.append((f"{label}: Med R and T beats R and T", share > _share(errors["r_and_t"])))
    for fraction in FRACTIONS:
        errors = _errors(scenes["halls"], 46, round(46 * fraction), True, count, rng, peer)
        label = f"{fraction:.0%} of 46 fragments wrong"
        both = f"{_rate(errors['ransac'])} / {_rate(errors['cauchy'])}" if peer else NOT_INSTALLED
        rows.append((f"{label}: Med R and T", None, None, _rate(errors["med_r_and_t"])))
        rows.append((f"{label}: Trunc R and T", None, both, _rate(errors["trunc_r_and_t"])))
        better = _share(errors["trunc_r_and_t"]) >= _share(errors["med_r_and_t"])
        claims.append((f"{label}: Trunc R and T does not fall behind Med R and T", better))
    columns = ("what", "paper x y z [ft]", "peer (PoseLib LO-RANSAC / CAUCHY)", "ours x y z [ft]")
    notes = (*NOTES, f"{count} trials, seed {seed}.")
    return Report("Table 3: translation errors with wrong matches", columns, tuple(rows), notes, tuple(claims))


def _errors(
    scene: PoseScene, n: int, wrong: int, parts: bool, count: int, rng: np.random.Generator, peer: Peer | None
) -> Rates:
    """Errors (3,) [ft] of each method, trial by trial, on the same data."""
    found: Rates = {name: [] for name in ("r_and_t", "med_r_and_t", "trunc_r_and_t", "ransac", "cauchy")}
    for _ in range(count):
        part = scene.take(np.sort(rng.permutation(len(scene))[:n]))
        part = fragmented(part, rng) if parts else part
        segments, _ = wrong_landmarks(part, end_noise(part.segments_px, SIGMA_PX, rng), wrong, rng)
        prior = drawn_prior(part.camera_from_world, PRIOR_M, PRIOR_RAD, rng)
        for name, solve in _methods(part, segments, prior, peer).items():
            found[name].append(np.abs(position_error_ft(solve(), part.camera_from_world)))
    return found


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


def _share(errors: list[Array]) -> float:
    return float(np.mean([e.max() < LIMIT_FT for e in errors])) if errors else 0.0


def _rate(errors: list[Array]) -> str:
    return f"{_share(errors):.1%}" if errors else NOT_INSTALLED


def _median(errors: list[Array]) -> str:
    return _triple(np.median(errors, axis=0)) if errors else NOT_INSTALLED


def _triple(values: tuple[float, ...] | Array) -> str:
    return "  ".join(f"{v:.2f}" for v in values)
