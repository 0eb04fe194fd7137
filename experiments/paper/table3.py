"""Table 3: R and T against Med R and T with wrong matches (§6.2.4), and beyond half of the lines wrong."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.paper.pose_peer import NOT_INSTALLED, Peer
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
from experiments.paper.pose_solvers import r_and_t, trunc_r_and_t
from experiments.report import Cell, Report, format_triple
from experiments.trials import campaign_folder, run_trials
from knowledge_sources.methods.pose import PoseEstimate, med_r_and_t
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


Claims = list[tuple[str, bool]]


@dataclass(frozen=True, slots=True, eq=False)
class FrameResult:
    """Errors (trials, 3) by method, and the bound of each trial (trials,) [ft], for one frame."""

    errors: Errors
    bounds_ft: Array


PAPER: Mapping[Frame, tuple[tuple[float, ...], tuple[float, ...]]] = {
    Frame("Outdoor 1", "posts", 5): ((0.80, -0.23, 0.20), (2.90, 0.15, 1.10)),
    Frame("Outdoor 3", "posts, nearer", 3): ((-1.10, 0.14, 0.10), (34.74, 7.34, 2.30)),
    Frame("Indoor 1", "corridor", 8): ((0.20, 0.07, 0.10), (5.75, 0.40, 0.60)),
    Frame("Indoor 7", "hall", 8): ((0.20, 0.10, 0.10), (0.30, 0.10, 0.40)),
}
"""Errors of Med R and T and of R and T [ft], x y z."""
DRAWN = (Frame("any 17 of the campus", "campus", 5, drawn=17), Frame("any 17 of the campus", "campus", 3, drawn=17))
FRACTIONS: Mapping[float, float] = {0.45: 0.99, 0.6: 0.93, 0.7: 0.70}
"""Share of the 46 fragments that is wrong, and the smallest share of successes."""
MAX_ERROR_FT, MIN_MED_SHARE = 1.1, 0.99
FULL, QUICK = 1000, 20
BATCH = 10
NOTES = (
    "Our scenes (the paper's frames are not at hand), a fixed set of lines per row as in the paper. Outdoor 1: of Table"
    " 2's campus, lamp posts and telephone poles with their arms and the nearest building without its base; Outdoor 3:"
    f" the same from {AHEAD_M:g} m nearer. Indoor 1: a corridor's four long edges and five doors; Indoor 7: with both"
    " edges of the far wall and fourteen doors, but for two lines.",
    "Of seven outdoor sets it is the one in which, whichever 5 lines are wrong, the others determine the pose best: see"
    " 'bound', the largest standard deviation along an axis of the best unbiased estimate (Cramér-Rao). 'Any 17' are"
    " drawn for each trial; in some draws the height rests on one or two lines, so these rows have no claim.",
    "Wrong matches: whole landmarks, drawn for each trial and moved by 15 to 60 px in any direction, as when matched to"
    " a neighbour (the matcher searches within 30 px); of the last one only as many lines as the row says.",
    f"Ends with Gaussian noise of {SIGMA_PX} px across; prior off by up to {PRIOR_M} m and "
    f"{math.degrees(PRIOR_RAD):.1f} degrees on each camera axis.",
    f"Success: under {MAX_ERROR_FT} ft in every axis. The paper's figures are of one frame each; ours and the peer's"
    " are medians. Peer: PoseLib's LO-RANSAC with the prior, and its refinement from the prior with Cauchy loss.",
    "Landmark version, all subsets.",
)


def run(quick: bool, seed: int, samples: int | None = None) -> Report:
    """Compute the four rows, then the share of successes at 45, 60 and 70 % wrong lines with fragments."""
    count = samples or (QUICK if quick else FULL)
    shares = {Frame(f"{f:.0%} of 46 fragments wrong", "hall", round(46 * f), parts=True): f for f in FRACTIONS}
    frames = [*PAPER, *DRAWN, *shares]
    folder = campaign_folder("table3", seed, quick=quick)
    found = dict(zip(frames, _run_frames(frames, seed, count, folder), strict=True))
    rows: list[tuple[Cell, ...]] = []
    claims: Claims = []
    for frame in (*PAPER, *DRAWN):
        rows += _rows(frame, found[frame])
    for frame in PAPER:
        claims += _claims(frame, found[frame].errors)
    for frame, fraction in shares.items():
        rows += _rows_beyond(frame, found[frame].errors)
        claims += _claims_beyond(frame, found[frame].errors, FRACTIONS[fraction])
    columns = ("what", "paper x y z [ft]", "peer (PoseLib LO-RANSAC / CAUCHY)", "ours x y z [ft]")
    notes = (*NOTES, f"{count} trials a row, seed {seed}.")
    return Report("Table 3: translation errors with wrong matches", columns, tuple(rows), notes, tuple(claims))


def _run_frames(frames: Sequence[Frame], seed: int, count: int, folder: Path) -> list[FrameResult]:
    """Run ``count`` trials of each frame."""
    seeds = [[(seed, number, k) for k in range(count)] for number in range(len(frames))]
    jobs = [
        Trials(frame, tuple(seeds[number][k : k + BATCH]))
        for number, frame in enumerate(frames) for k in range(0, count, BATCH)
    ]
    done = run_trials(compute_errors, jobs, TrialErrors, folder, f"x {BATCH} trials")
    each = len(jobs) // len(frames)
    return [_join(done[i * each : (i + 1) * each]) for i in range(len(frames))]


def _join(parts: Sequence[TrialErrors]) -> FrameResult:
    names = parts[0].by_method
    errors = {name: np.concatenate([np.array(part.by_method[name]) for part in parts]) for name in names}
    return FrameResult(errors, np.concatenate([part.bounds_ft for part in parts]))


def _rows(frame: Frame, found: FrameResult) -> list[tuple[Cell, ...]]:
    errors = found.errors
    med, plain = (format_triple(paper) for paper in PAPER[frame]) if frame in PAPER else (None, None)
    label = _label(frame)
    bounds = f"{np.median(found.bounds_ft):.2f}  {found.bounds_ft.max():.2f}"
    rates = f"{_rate(errors, 'ransac')} / {_rate(errors, 'cauchy')}" if "ransac" in errors else NOT_INSTALLED
    return [
        (f"{label}: R and T", plain, None, _median(errors, "r_and_t")),
        (f"{label}: Med R and T", med, _median(errors, "ransac"), _median(errors, "med_r_and_t")),
        (f"{label}: Med R and T, successes", None, rates, _rate(errors, "med_r_and_t")),
        (f"{label}: Trunc R and T, successes", None, None, _rate(errors, "trunc_r_and_t")),
        (f"{label}: bound, median and worst", None, None, bounds),
    ]


def _claims(frame: Frame, errors: Errors) -> Claims:
    """Claim that Med R and T holds, and that R and T is off by feet where the paper's is."""
    share, label = _share(errors, "med_r_and_t"), _label(frame)
    claims = [(f"{label}: Med R and T under {MAX_ERROR_FT} ft in every axis in at least {MIN_MED_SHARE:.0%}",
               _reaches(share, MIN_MED_SHARE, len(errors["med_r_and_t"])))]
    if max(PAPER[frame][1]) > MAX_ERROR_FT:
        worst = float(np.median(errors["r_and_t"].max(axis=1)))
        claims.append((f"{label}: R and T is off by feet (median of the worst axis {worst:.1f} ft)",
                       worst > MAX_ERROR_FT))
    return claims


def _rows_beyond(frame: Frame, errors: Errors) -> list[tuple[Cell, ...]]:
    both = f"{_rate(errors, 'ransac')} / {_rate(errors, 'cauchy')}" if "ransac" in errors else NOT_INSTALLED
    return [
        (f"{frame.name}: Med R and T, successes", None, None, _rate(errors, "med_r_and_t")),
        (f"{frame.name}: Trunc R and T, successes", None, both, _rate(errors, "trunc_r_and_t")),
    ]


def _claims_beyond(frame: Frame, errors: Errors, least: float) -> Claims:
    ours = _share(errors, "trunc_r_and_t")
    claims = [(f"{frame.name}: Trunc R and T succeeds in at least {least:.0%}",
               _reaches(ours, least, len(errors["trunc_r_and_t"])))]
    for name, peer in (("ransac", "LO-RANSAC with the prior"), ("cauchy", "CAUCHY refinement from the prior")):
        if name in errors:
            claims.append((f"{frame.name}: Trunc R and T ahead of PoseLib's {peer}", ours > _share(errors, name)))
    return claims


def _label(frame: Frame) -> str:
    return f"{frame.name}: {frame.drawn or len(get_scene(frame.place))} lines, {frame.wrong} wrong"


def _share(errors: Errors, name: str) -> float:
    return float(np.mean(errors[name].max(axis=1) < MAX_ERROR_FT))


def _reaches(share: float, least: float, count: int) -> bool:
    """Whether a share of ``count`` trials is at least ``least``, rounded down to what so few trials can have."""
    return share * count >= math.floor(least * count + 1e-9) - 1e-9


def _rate(errors: Errors, name: str) -> str:
    return f"{_share(errors, name):.1%}"


def _median(errors: Errors, name: str) -> str:
    return format_triple(np.median(errors[name], axis=0)) if name in errors else NOT_INSTALLED
