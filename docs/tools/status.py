"""Tables of what was driven: what each experiment found last, four seeds, the way out of a kidnap.

``harvey experiment NAME --out docs/results/NAME.json`` writes what an experiment found; ``python -m docs.tools.status``
drives the seeds and the kidnap, and writes ``docs/results/seeds/``. ``python -m docs.tools.fill`` makes the tables.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import harvey
from docs.tools.site.markdown import escape, table
from experiments import EXPERIMENTS
from experiments.report import format_cell
from experiments.results import STALE_AFTER, Result, find_commit, is_stale, read_results
from world_models.words import count

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "docs" / "results"
SCENARIO, SEEDS = "lab-to-allens-office", range(4)
SEEDS_FILE = RESULTS / "seeds" / f"{SCENARIO}.json"
KIDNAP = "hallway-kidnap"
LADDER_FILE = SEEDS_FILE.with_name(f"{KIDNAP}.json")
FIGURES: Mapping[str, str] = {
    "outcome": "outcome", "error_mm": "error mm", "milestones": "milestones", "wrong": "accepted wrongly",
    "collisions": "collisions", "path_m": "path m", "robot_s": "robot s", "cycles": "cycles",
}
"""Of a mission, with their columns. None depends on the machine."""


def describe_experiments() -> str:
    """A row for each claim of each experiment, those that were not driven too."""
    found = {result.experiment: result for result in read_results(RESULTS)}
    rows = [row for folder in EXPERIMENTS.values() for name, asked in folder.items()
            for row in _rows(name, asked, found.get(name))]
    counted = Counter(word for result in found.values() for _, word in result.claims)
    every, small = sum(map(len, EXPERIMENTS.values())), sum(1 for result in found.values() if result.options)
    total = (f"Of {every} experiments {len(found) - small} were driven whole and {small} in a smaller version."
             f" Of {count(counted.total(), 'claim')} {counted['proved']} are proved, {counted['not contradicted']} are"
             f" not contradicted, {counted['fails']} fail.")
    return "\n".join([total, *table(("experiment", "what", "found", "driven"), rows)])


def _rows(name: str, asked: str, result: Result | None) -> Iterator[tuple[str, ...]]:
    if result is None:
        yield (f"`{name}`", escape(asked), "not driven", "")
        return
    how = " ".join(filter(None, (result.options, f"--seed {result.seed}" if result.seed else "")))
    driven = ", ".join(filter(None, (f"`{how}`" if how else "whole", result.date[:10], result.commit)))
    driven += f"; **stale**: more than {STALE_AFTER} commits ago" if is_stale(result) else ""
    if not result.claims:
        yield (f"`{name}`", f"{escape(asked)} (claims nothing)", "", driven)
    for claim, word in result.claims:
        yield (f"`{name}`", escape(claim), "**fails**" if word == "fails" else word, driven)


def describe_rows(name: str, wanted: str = "") -> str:
    """The table of an experiment's last result, or those of its rows that begin with a text."""
    result = next(result for result in read_results(RESULTS) if result.experiment == name)
    rows = [[escape(format_cell(cell)) for cell in row] for row in result.rows if str(row[0]).startswith(wanted)]
    how = " ".join(filter(None, (f"harvey experiment {name}", result.options)))
    return "\n".join([f"`{how}`, {result.date[:10]}, commit {result.commit}:",
                      *table([escape(column) for column in result.columns], rows)])


def describe_seeds() -> str:
    """The missions of four seeds, by which commit."""
    found = json.loads(SEEDS_FILE.read_text(encoding="utf-8"))
    rows = [(str(seed), *(str(row[name]) for name in FIGURES)) for seed, row in found["missions"].items()]
    return "\n".join([f"`harvey run {SCENARIO} --seed 0..{SEEDS[-1]}`, commit {found['commit']}:",
                      *table(("seed", *FIGURES.values()), rows)])


def drive_seed(seed: int) -> dict[str, Any]:
    """The figures of one mission."""
    result = harvey.run(SCENARIO, seed=seed)
    return {
        "outcome": result.outcome, "error_mm": round(1000 * result.error_m, 1),
        "milestones": result.milestones["verified"], "wrong": result.milestones["false_accepts"],
        "collisions": result.collisions,
        "path_m": round(result.path_length_m, 1), "robot_s": round(result.sim_time_s), "cycles": result.decisions}


def drive_ladder() -> list[list[str]]:
    """Of each cycle from the kidnap to the plan that follows it: focus, who acted, woken by what, what was written."""
    with TemporaryDirectory() as folder:
        harvey.run(KIDNAP, seed=0, out=Path(folder) / "run")
        decisions = list(harvey.open_run(Path(folder) / "run").decisions())
    acts = [(d, d.chosen) for d in decisions if d.chosen and d.made]
    raised = next(k for k, (_, act) in enumerate(acts) if act.source == "discrepancy_raiser")
    first = max(k for k in range(raised) if acts[k][1].source == "motor")
    last = next(k for k in range(raised, len(acts)) if acts[k][1].source == "goal_sketcher")
    return [[str(d.cycle), d.focus, act.source, act.trigger, ", ".join(
        e.ref if e.is_new else f"{e.ref} ({e.change.lower()})" for e in d.made)] for d, act in acts[first:last + 1]]


def describe_ladder() -> str:
    """The cycles of :func:`drive_ladder`."""
    found = json.loads(LADDER_FILE.read_text(encoding="utf-8"))
    return "\n".join([f"`harvey run {KIDNAP} --seed 0`, commit {found['commit']}:",
                      *table(("cycle", "focus", "who acts", "woken by", "what is written"), found["rows"])])


def describe_moments() -> str:
    """The command that takes pictures of four moments of the kidnap: it drives, doubts, is lost, is found."""
    rows = json.loads(LADDER_FILE.read_text(encoding="utf-8"))["rows"]
    raised = [int(row[0]) for row in rows if row[2] == "discrepancy_raiser"]
    found = next(row[0] for row in rows if row[2] == "pose_adopter")
    return (f"```\npython -m docs.tools.look runs/{KIDNAP}-0/recording.rrd pictures"
            f" {rows[0][0]} {raised[0]} {raised[1] - 1} {found}\n```")


def main() -> int:
    """Drive the seeds and the kidnap, and keep what came."""
    commit = find_commit()
    missions = {seed: drive_seed(seed) for seed in SEEDS}
    SEEDS_FILE.parent.mkdir(parents=True, exist_ok=True)
    for file, found in ((SEEDS_FILE, {"missions": missions}), (LADDER_FILE, {"rows": drive_ladder()})):
        file.write_text(json.dumps({"commit": commit, **found}, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
