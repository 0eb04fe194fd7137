"""A thousand kidnaps: carried off to anywhere on a floor of forty rooms, does the robot find out where it is?

Each time it stands at a drawn place with a drawn heading, and believes to be at another. The line finder, the dead
reckoner, the relocalizer and the mission monitor sit round a board and have a simulated body; the goal level is in
doubt, and they go on until it is not, or until they give up. Corridors that look the same from both ends come beside:
there the only right answer is that the place is ambiguous.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from experiments.chart import OURS, PAPER, PEER, chart
from experiments.report import Cell, Report
from experiments.robustness.kidnap_trial import Found, Kidnap, floor_of, found_in, scenario_text
from experiments.trials import RESULTS, campaign_folder, run_trials

ROOMS, FLOORS, EACH = 40, 25, 40
TWIN_ROOMS, TWIN_FLOORS, TWIN_EACH = 12, 10, 20
QUICK = (8, 1, 3, 4, 1, 2)
"""Rooms, floors and kidnaps on each, and the same of the symmetric ones, in the small version."""
NEAR_M = 0.1
MOST_PROBES, MEDIAN_PROBES = 5, 2
WANTED = 0.99
WORST = 5
COLUMNS = ("floors", "kidnaps", "right", "ambiguous", "undecided", "wrong", "median probes", "<= 5 probes", "mean mm",
           "99 % mm", "mean CPU s", "most CPU s")


def run(quick: bool, seed: int) -> Report:
    """Floors are made with the seeds 1000 ``seed`` + 0, 1, ...; symmetric ones with 1000 ``seed`` + 500, ...."""
    rooms, floors, each, twin_rooms, twin_floors, twin_each = (
        QUICK if quick else (ROOMS, FLOORS, EACH, TWIN_ROOMS, TWIN_FLOORS, TWIN_EACH))
    anywhere = [Kidnap(1000 * seed + f, rooms, False, k) for f in range(floors) for k in range(each)]
    twins = [Kidnap(1000 * seed + 500 + f, twin_rooms, True, k) for f in range(twin_floors) for k in range(twin_each)]
    folder = campaign_folder("kidnap", seed, quick=quick)
    trials = [*anywhere, *twins]
    found = run_trials(found_in, trials, Found, folder, "kidnap")
    split = len(anywhere)
    pictures = [folder / "probes.png", folder / "errors.png", folder / "map.png"]
    _draw(found[:split], pictures)
    groups = ((f"{floors} of {rooms} rooms", found[:split]), (f"{twin_floors} symmetric corridors", found[split:]))
    report = Report(
        "Carried off to anywhere on a floor", COLUMNS, tuple(_row(name, group) for name, group in groups),
        notes=(
            f"Floors made with the seeds {trials[0].floor} to {trials[split - 1].floor}, symmetric ones with"
            f" {trials[split].floor} to {trials[-1].floor}; the robot is anywhere, with any heading.",
            f"right: it says where it is, in the right locale and within {NEAR_M} m; wrong: it says so and is not"
            " there; undecided: it stays lost, with one place left or none. A probe is a look, the first one too.",
            "The paper gives no figures for robots that are lost.",
            *_worst(trials, found, folder),
            f"Pictures: {', '.join(str(p) for p in pictures)}; every kidnap in a line: {folder / RESULTS}",
        ),
        claims=_claims(found[:split], found[split:]),
    )
    (folder / "table.txt").write_text(report.text() + "\n", encoding="utf-8")
    return report


def is_right(found: Found) -> bool:
    """Whether it says where it is, and is there."""
    return found.verdict == "found" and found.room == found.believed and found.error_m <= NEAR_M


def is_wrong(found: Found) -> bool:
    """Whether it says where it is, and is elsewhere."""
    return found.verdict == "found" and not is_right(found)


def _row(name: str, found: Sequence[Found]) -> tuple[Cell, ...]:
    right = [f for f in found if is_right(f)]
    errors_mm = np.array([1000.0 * f.error_m for f in right])
    return (
        name, len(found), len(right), sum(f.verdict == "ambiguous" for f in found),
        sum(f.verdict == "lost" for f in found), sum(is_wrong(f) for f in found),
        float(np.median([f.probes for f in found])), sum(f.probes <= MOST_PROBES for f in found),
        float(errors_mm.mean()) if len(right) else None,
        float(np.percentile(errors_mm, 99.0)) if len(right) else None,
        math.fsum(f.cpu_s for f in found) / len(found), max(f.cpu_s for f in found),
    )


def _claims(anywhere: Sequence[Found], twins: Sequence[Found]) -> tuple[tuple[str, bool], ...]:
    good = sum(is_right(f) and f.probes <= MOST_PROBES for f in anywhere)
    wrong = sum(is_wrong(f) for f in (*anywhere, *twins))
    return (
        (f"right locale and within {NEAR_M} m after at most {MOST_PROBES} probes in at least {WANTED:.0%}: {good} of"
         f" {len(anywhere)}", good >= WANTED * len(anywhere)),
        (f"half of them need no more than {MEDIAN_PROBES} probes",
         float(np.median([f.probes for f in anywhere])) <= MEDIAN_PROBES),
        (f"never wrong and confident: {wrong}", wrong == 0),
        ("ambiguous is said in every symmetric corridor", all(f.verdict == "ambiguous" for f in twins)),
    )


def _badness(trial: Kidnap, found: Found) -> tuple[bool, bool, int, float]:
    good = found.verdict == "ambiguous" if trial.symmetric else is_right(found)
    return is_wrong(found), not good, found.probes, 0.0 if trial.symmetric else found.error_m


def _worst(trials: Sequence[Kidnap], found: Sequence[Found], folder: Path) -> Iterator[str]:
    """The worst cases, each with a scenario that shows it."""
    order = sorted(range(len(trials)), key=lambda i: _badness(trials[i], found[i]), reverse=True)[:WORST]
    for i in order:
        trial, f = trials[i], found[i]
        floor_of(trial).write(folder)
        path = folder / f"kidnap-{trial.floor}-{trial.number}.toml"
        path.write_text(scenario_text(trial), encoding="utf-8")
        error = "" if math.isinf(f.error_m) else f", {1000.0 * f.error_m:.0f} mm off"
        yield (f"among the worst: floor {trial.floor}, kidnap {trial.number} to {f.room}: {f.verdict} after {f.probes}"
               f" probes{error}. See it: harvey run {path} --seed {trial.number}")


def _draw(found: Sequence[Found], pictures: Sequence[Path]) -> None:
    probes = np.array([f.probes for f in found])
    with chart(pictures[0], "How many looks it takes", "probes", "kidnaps") as axes:
        for label, keep, colour in (("right", True, OURS), ("otherwise", False, PEER)):
            chosen = probes[[is_right(f) == keep for f in found]]
            if len(chosen):
                axes.hist(chosen, bins=[n + 0.5 for n in range(9)], rwidth=0.8, color=colour, label=label)
    right = np.sort([1000.0 * f.error_m for f in found if is_right(f)])
    with chart(pictures[1], "How near", "true distance from where it says it is [mm]", "part below it") as axes:
        if len(right):
            axes.step(right, np.arange(1, len(right) + 1) / len(right), where="post", color=OURS)
        axes.axvline(1000.0 * NEAR_M, color=PAPER, linestyle="--", label="asked for")
        axes.set_xscale("log")
    _draw_map(found, pictures[2])


def _draw_map(found: Sequence[Found], path: Path) -> None:
    """The first floor with where the robot was put on it."""
    first = found[0].floor
    here = [f for f in found if f.floor == first]
    with chart(path, f"Floor {first}: where it was put, and how many looks it took", "east [m]", "north [m]",
               (9.0, 9.0)) as axes:
        world = floor_of(Kidnap(first, found[0].rooms, False, 0)).world
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
