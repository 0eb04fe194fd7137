"""Real photographs of a corridor: are its lines found, and is the pose found again from a wrong one, or known lost?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.paper.pose_peer import NOT_INSTALLED, Peer
from experiments.perception.corridor_data import SHOWN, Corridor, load_corridor
from experiments.perception.corridor_pictures import draw_attempt
from experiments.perception.corridor_trials import (
    BACK_RAD,
    BACK_STEPS,
    Attempt,
    Disturbance,
    Trial,
    in_view,
    tried,
)
from experiments.report import Cell, Report
from experiments.trials import campaign_folder, found_by_all
from knowledge_sources.methods.features.lines import find_lines
from knowledge_sources.methods.localization.locate_camera import LEAST_LENGTH_PX
from knowledge_sources.methods.verification.agreement import compute_coverage

Array = NDArray[np.float64]

TITLE = "Real photographs of a corridor: lines, and poses from wrong ones"
COLUMNS = ("what", "paper's way", "peer", "ours")
COVER_PX, COVER_RAD = 1.5, 0.12
BESIDE_PX = 8.0
LEAST_COVERED, LEAST_BACK, MOST_SILENT = 0.95, 0.95, 0.005
DISTURBANCES = (
    Disturbance("off by up to 0.5 step and 3 deg", 1.0, True, 100, 2),
    Disturbance("off by 0.5 step and 3 deg", 1.0, False, 50, 1),
    Disturbance("off by 1 step and 6 deg", 2.0, False, 25, 1),
)
"""The first is the test; the others are harder than any that is asked for."""
MOST_SILENT_SHOWN = 3


def run(quick: bool, seed: int, seeds: int | None = None) -> Report:
    """Coverage of the lines, then trials from disturbed poses; ``seeds`` a frame instead of each test's own."""
    data = load_corridor()
    if data is None:
        note = f"The photographs are not there ({SHOWN} from the repository's root): nothing was measured."
        return Report(TITLE, COLUMNS, (), (note,))
    covered = _coverages(data)
    rows: list[tuple[Cell, ...]] = [
        ("model length covered, edges sought round it", None, covered["given"], covered["focused"]),
        ("model length covered, whole picture", None, covered["given"], covered["whole"]),
        (f"the same, model {BESIDE_PX:.0f} px beside (chance)", None, covered["given beside"], covered["beside"]),
    ]
    claims = [("own segments cover at least 95 % of the model's length", covered["focused"] >= LEAST_COVERED)]
    folder = campaign_folder("corridor", seed, quick=quick)
    attempts = [
        Attempt(test, frame, (seed, number, frame, k))
        for number, test in enumerate(DISTURBANCES) for frame in range(len(data.frames))
        for k in range(seeds or (test.quick_seeds if quick else test.seeds))
    ]
    found = list(zip(attempts, found_by_all(tried, attempts, Trial, folder), strict=True))
    for test in DISTURBANCES:
        trials = [trial for attempt, trial in found if attempt.test == test]
        rows += _rows(test, trials)
        if test.scale <= 1.0:
            claims.append((f"{test.name}: at least 95 % come back", _share([t.back for t in trials]) >= LEAST_BACK))
        silent = _share([t.is_silent for t in trials])
        claims.append((f"{test.name}: at most 0.5 % silently wrong", silent <= MOST_SILENT))
    _draw(data, found, folder)
    return Report(TITLE, COLUMNS, tuple(rows), _notes(data, seed, folder), tuple(claims))


def _draw(data: Corridor, found: Sequence[tuple[Attempt, Trial]], folder: Path) -> None:
    """Each frame's first attempt, and the first that were silently wrong."""
    for number in range(len(data.frames)):
        first = next(attempt for attempt, _ in found if attempt.frame == number)
        draw_attempt(data, first, folder / f"frame-{number}.png")
    silent = [attempt for attempt, trial in found if trial.is_silent][:MOST_SILENT_SHOWN]
    for number, attempt in enumerate(silent):
        draw_attempt(data, attempt, folder / f"silently-wrong-{number}.png")


def _coverages(data: Corridor) -> dict[str, float]:
    """Share of the model's length in view that has segments within 1.5 px, over all frames."""
    shares: dict[str, list[float]] = {name: [] for name in ("focused", "whole", "beside", "given", "given beside")}
    for frame in data.frames:
        model = in_view(data.model_lines, frame, frame.camera_from_world)[1]
        span = model[:, 1] - model[:, 0]
        across = np.stack([-span[:, 1], span[:, 0]], axis=1) / np.linalg.norm(span, axis=1, keepdims=True)
        beside = model + BESIDE_PX * across[:, None]
        focused = find_lines(frame.image, model).segments_px
        shares["focused"].append(_covered(model, focused))
        shares["whole"].append(_covered(model, find_lines(frame.image).segments_px))
        shares["beside"].append(_covered(beside, focused))
        shares["given"].append(_covered(model, frame.segments_px))
        shares["given beside"].append(_covered(beside, frame.segments_px))
    return {name: float(np.mean(values)) for name, values in shares.items()}


def _covered(model: Array, segments: Array) -> float:
    lengths = np.linalg.norm(model[:, 1] - model[:, 0], axis=1)
    return float(np.sum(compute_coverage(model, segments, COVER_PX, COVER_RAD) * lengths) / np.sum(lengths))


def _rows(test: Disturbance, trials: Sequence[Trial]) -> list[tuple[Cell, ...]]:
    back = [t for t in trials if t.back]
    theirs = f"{_share([t.peer_back for t in trials]):.1%}" if Peer.found() else NOT_INSTALLED
    papers = f"{_share([t.paper_back for t in trials]):.1%}"
    median = tuple(float(np.median([getattr(t, name) for t in trials])) for name in ("shift_steps", "turn_rad"))
    known = f"{len(trials) - len(back) - sum(1 for t in trials if t.is_silent)} of {len(trials) - len(back)}"
    return [
        (f"{test.name}: back", papers, theirs, f"{len(back) / len(trials):.1%} of {len(trials)}"),
        (f"{test.name}: median error", None, None, f"{median[0]:.4f} step, {math.degrees(median[1]):.3f} deg"),
        (f"{test.name}: back and verified", None, None,
         f"{_share([t.back and t.is_verified for t in trials]):.1%}"),
        (f"{test.name}: failures known as failures", None, None, known),
        (f"{test.name}: silently wrong", None, None, f"{_share([t.is_silent for t in trials]):.2%}"),
    ]


def _share(held: Sequence[bool]) -> float:
    return sum(1 for h in held if h) / len(held)


def _notes(data: Corridor, seed: int, folder: Path) -> tuple[str, ...]:
    return (
        f"{len(data.frames)} frames of the Oxford VGG corridor, {len(data.model_lines)} model lines; a step is"
        f" {data.step:.3f} of the survey's units. Seed {seed}. Directions of shift and turn are uniform on the sphere,"
        " sizes uniform where it says 'up to'. The reference poses are the publishers' own, and have errors too.",
        f"Covered: a segment within {COVER_PX} px and {COVER_RAD} rad of a projected model line of"
        f" {LEAST_LENGTH_PX:.0f} px or more, at the reference pose. Peer there: the publishers' own segments.",
        f"Back: within {BACK_STEPS} step and {math.degrees(BACK_RAD):.1f} degrees. All from our own segments; the prior"
        " is believed to half of 0.5 step and 3 degrees (a deviation an axis), in the harder tests too.",
        "Ours: match in six unknowns, truncated R and T, project again, look in bands of 6 px, match, Med R and T; then"
        " all of it again from the pose found, which has to come out again or gives way to one of which more is seen."
        " Verified: agreement of the whole picture's segments that is not by chance (a contrario), two thirds of the"
        " length in view, and 3 deviations of the pose within the bounds.",
        "The two thirds were set after a wrong pose was verified at half, 1.5 steps and 9 degrees off, on these same"
        " frames with other seeds; the whole picture's segments cover about 80 % at the right pose. That the residuals'"
        " own deviation scales the covariance was also decided here: the assumed one called right poses not testable."
        " That a pose has to come out again was decided after one of 150 in the hardest test was silently wrong.",
        "Paper's way: §6 once through, rigid 2D match at 30 px and 0.3 rad, Med R and T. Peer for poses: PoseLib's"
        " LO-RANSAC on the pairs that we matched; it says nothing about being right. Silently wrong: verified,"
        " but not back.",
        f"The model over the photographs, as believed and as found: {folder}/frame-*.png.",
    )
