"""1,000 kidnaps to anywhere on floors of forty rooms: does the robot find where it is?

Each time it stands at a random pose and believes to be at another. Line finder, dead reckoner, relocalizer and mission
monitor share a board with a simulated body; the goal level is in doubt, and they act until it is not, or until they
give up. In addition there are corridors that look the same from both ends, where the only right answer is that the
place is ambiguous.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from experiments.chart import OURS, PAPER, PEER, chart
from experiments.report import Cell, Report
from experiments.robustness.kidnap_trial import Kidnap, KidnapResult, format_scenario, get_floor, run_kidnap
from experiments.trials import RESULTS, campaign_folder, run_trials

ROOMS, FLOORS, EACH = 40, 25, 40
SYMMETRIC_ROOMS, SYMMETRIC_FLOORS, SYMMETRIC_EACH = 12, 10, 20
QUICK = (8, 1, 3, 4, 1, 2)
"""Rooms, floors and kidnaps on each, and the same of the symmetric ones, with --quick."""
MAX_ERROR_M = 0.1
MAX_PROBES, MAX_MEDIAN_PROBES = 5, 2
MIN_RIGHT_SHARE = 0.99
WORST_SHOWN = 5
COLUMNS = ("floors", "kidnaps", "right", "ambiguous", "undecided", "wrong", "median probes", "<= 5 probes", "mean mm",
           "99 % mm", "mean CPU s", "max CPU s")


def run(quick: bool, seed: int) -> Report:
    """Kidnap on floors with seeds 1000 ``seed`` + 0, 1, ...; symmetric ones with 1000 ``seed`` + 500, ...."""
    rooms, floors, each, symmetric_rooms, symmetric_floors, symmetric_each = (
        QUICK if quick else (ROOMS, FLOORS, EACH, SYMMETRIC_ROOMS, SYMMETRIC_FLOORS, SYMMETRIC_EACH))
    anywhere = [Kidnap(1000 * seed + f, rooms, False, k) for f in range(floors) for k in range(each)]
    symmetric = [Kidnap(1000 * seed + 500 + f, symmetric_rooms, True, k)
                 for f in range(symmetric_floors) for k in range(symmetric_each)]
    folder = campaign_folder("kidnap", seed, quick=quick)
    trials = [*anywhere, *symmetric]
    found = run_trials(run_kidnap, trials, KidnapResult, folder, "kidnap")
    split = len(anywhere)
    pictures = [folder / "probes.png", folder / "errors.png", folder / "map.png"]
    _draw(found[:split], pictures)
    groups = ((f"{floors} of {rooms} rooms", found[:split]), (f"{symmetric_floors} symmetric corridors", found[split:]))
    report = Report(
        "Kidnaps to anywhere on a floor", COLUMNS, tuple(_row(name, group) for name, group in groups),
        notes=(
            f"Floors of seeds {trials[0].floor} to {trials[split - 1].floor}, symmetric ones of"
            f" {trials[split].floor} to {trials[-1].floor}; the robot is anywhere, with any heading.",
            f"right: it reports a pose in the right locale and within {MAX_ERROR_M} m; wrong: it reports another one;"
            " undecided: it stays lost, with one pose candidate or none. A probe is a look, the first one included.",
            "The paper gives no figures for lost robots.",
            *_worst(trials, found, folder),
            f"Pictures: {', '.join(str(p) for p in pictures)}; one line per kidnap: {folder / RESULTS}",
        ),
        claims=_claims(found[:split], found[split:]),
    )
    (folder / "table.txt").write_text(report.text() + "\n", encoding="utf-8")
    return report


def is_right(result: KidnapResult) -> bool:
    """Whether it reports a pose, and the right one."""
    return result.verdict == "found" and result.room == result.believed and result.error_m <= MAX_ERROR_M


def is_wrong(result: KidnapResult) -> bool:
    """Whether it reports a pose, and a wrong one."""
    return result.verdict == "found" and not is_right(result)


def _row(name: str, found: Sequence[KidnapResult]) -> tuple[Cell, ...]:
    right = [f for f in found if is_right(f)]
    errors_mm = np.array([1000.0 * f.error_m for f in right])
    return (
        name, len(found), len(right), sum(f.verdict == "ambiguous" for f in found),
        sum(f.verdict == "lost" for f in found), sum(is_wrong(f) for f in found),
        float(np.median([f.probes for f in found])), sum(f.probes <= MAX_PROBES for f in found),
        float(errors_mm.mean()) if len(right) else None,
        float(np.percentile(errors_mm, 99.0)) if len(right) else None,
        math.fsum(f.cpu_s for f in found) / len(found), max(f.cpu_s for f in found),
    )


def _claims(anywhere: Sequence[KidnapResult], symmetric: Sequence[KidnapResult]) -> tuple[tuple[str, bool], ...]:
    good = sum(is_right(f) and f.probes <= MAX_PROBES for f in anywhere)
    wrong = sum(is_wrong(f) for f in (*anywhere, *symmetric))
    return (
        (f"right locale and within {MAX_ERROR_M} m after at most {MAX_PROBES} probes in at least"
         f" {MIN_RIGHT_SHARE:.0%}: {good} of {len(anywhere)}", good >= MIN_RIGHT_SHARE * len(anywhere)),
        (f"median number of probes at most {MAX_MEDIAN_PROBES}",
         float(np.median([f.probes for f in anywhere])) <= MAX_MEDIAN_PROBES),
        (f"never wrong: {wrong}", wrong == 0),
        ("every symmetric corridor is reported as ambiguous", all(f.verdict == "ambiguous" for f in symmetric)),
    )


def _badness(trial: Kidnap, result: KidnapResult) -> tuple[bool, bool, int, float]:
    good = result.verdict == "ambiguous" if trial.symmetric else is_right(result)
    return is_wrong(result), not good, result.probes, 0.0 if trial.symmetric else result.error_m


def _worst(trials: Sequence[Kidnap], found: Sequence[KidnapResult], folder: Path) -> Iterator[str]:
    """Describe the worst cases, each with a scenario file that shows it."""
    order = sorted(range(len(trials)), key=lambda i: _badness(trials[i], found[i]), reverse=True)[:WORST_SHOWN]
    for i in order:
        trial, f = trials[i], found[i]
        get_floor(trial).write(folder)
        path = folder / f"kidnap-{trial.floor}-{trial.number}.toml"
        path.write_text(format_scenario(trial), encoding="utf-8")
        error = "" if math.isinf(f.error_m) else f", {1000.0 * f.error_m:.0f} mm off"
        yield (f"among the worst: floor {trial.floor}, kidnap {trial.number} to {f.room}: {f.verdict} after {f.probes}"
               f" probes{error}. See it: harvey run {path} --seed {trial.number}")


def _draw(found: Sequence[KidnapResult], pictures: Sequence[Path]) -> None:
    probes = np.array([f.probes for f in found])
    with chart(pictures[0], "Number of probes", "probes", "kidnaps") as axes:
        for label, keep, colour in (("right", True, OURS), ("otherwise", False, PEER)):
            chosen = probes[[is_right(f) == keep for f in found]]
            if len(chosen):
                axes.hist(chosen, bins=[n + 0.5 for n in range(9)], rwidth=0.8, color=colour, label=label)
    right = np.sort([1000.0 * f.error_m for f in found if is_right(f)])
    with chart(pictures[1], "Errors", "true distance from the reported pose [mm]", "share below it") as axes:
        if len(right):
            axes.step(right, np.arange(1, len(right) + 1) / len(right), where="post", color=OURS)
        axes.axvline(1000.0 * MAX_ERROR_M, color=PAPER, linestyle="--", label="required")
        axes.set_xscale("log")
    _draw_map(found, pictures[2])


def _draw_map(found: Sequence[KidnapResult], path: Path) -> None:
    """Draw the first floor with the true poses of the robot."""
    first = found[0].floor
    here = [f for f in found if f.floor == first]
    with chart(path, f"Floor {first}: true poses and number of probes", "east [m]", "north [m]",
               (9.0, 9.0)) as axes:
        world = get_floor(Kidnap(first, found[0].rooms, False, 0)).world
        for name in world.rooms:
            x, y = np.vstack([world.outline(name), world.outline(name)[:1]]).T
            axes.plot(x, y, color=PAPER, linewidth=0.8)
        for keep, colour, label in ((True, OURS, "right"), (False, PEER, "otherwise")):
            chosen = [f for f in here if is_right(f) == keep]
            if chosen:
                axes.quiver([f.x_m for f in chosen], [f.y_m for f in chosen],
                            [math.cos(f.heading_rad) for f in chosen], [math.sin(f.heading_rad) for f in chosen],
                            color=colour, angles="xy", scale=35.0, width=0.003, label=label)
            for f in chosen:
                axes.annotate(str(f.probes), (f.x_m, f.y_m), fontsize=8)
        axes.set_aspect("equal")
