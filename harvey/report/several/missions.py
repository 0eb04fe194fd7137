"""The missions of a report: those of a campaign, or of runs that are named one by one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from harvey.campaign.results_file import RESULTS
from harvey.campaign.show import find_campaign, read_progress
from harvey.errors import BadInput
from harvey.run_files.run_directory import RunDirectory, find_directory, open_run
from harvey.runner.result import UNFINISHED
from harvey.story.head import run_name

GIVEN_UP = "given up"
"""The outcome of a case whose workers were killed again and again."""


@dataclass(frozen=True, slots=True)
class Mission:
    """One mission, or one case of an experiment.

    Attributes:
        name: ``hallway-kidnap, seed 3``, or ``case 3``.
        run: its run directory, where that was kept.
        result: what came of it, as JSON types.
    """

    name: str
    run: RunDirectory | None
    result: Mapping[str, Any]


def find_runs(text: str) -> Path | Sequence[RunDirectory]:
    """What a user names: the folder of a campaign, or the runs that it stands for, often one.

    Raises:
        BadInput: it is neither, or a run that lacks its journal.
    """
    if not (Path(text) / "journal.jsonl").is_file():
        try:
            return find_campaign(text)
        except BadInput:
            pass
    path = find_directory(text)
    inner = [] if (path / "journal.jsonl").is_file() else sorted(path.glob("*/journal.jsonl"))
    return [RunDirectory(journal.parent) for journal in inner] or [open_run(text)]


def read_missions(found: Sequence[Path | Sequence[RunDirectory]]) -> list[Mission]:
    """Each mission once. Raises BadInput where a result cannot be read, or where there is none."""
    missions: dict[Path | tuple[Path, str], Mission] = {}
    for one in found:
        for mission in _of_campaign(one) if isinstance(one, Path) else map(_of_run, one):
            key = mission.run.path.resolve() if mission.run is not None else (Path(str(one)).resolve(), mission.name)
            missions.setdefault(key, mission)
    if not missions:
        where = ", ".join(str(one / RESULTS) for one in found if isinstance(one, Path))
        raise BadInput(f"{where}: expected at least one mission that has ended, got none")
    return list(missions.values())


def _of_campaign(folder: Path) -> Iterator[Mission]:
    progress = read_progress(folder)
    cases = progress.results | {case: {"outcome": GIVEN_UP} for case in progress.given_up}
    for case in sorted(cases):
        result, run = cases[case], RunDirectory(folder / str(case))
        if not isinstance(result, dict):
            raise BadInput(f"{folder / RESULTS}: case {case}: expected a JSON object as result, got {result!r}")
        scenario, seed = result.get("scenario"), result.get("seed")
        name = f"{scenario}, seed {seed}" if isinstance(scenario, str) and seed is not None else f"case {case}"
        yield Mission(name, run if run.journal.is_file() else None, result)


def _of_run(run: RunDirectory) -> Mission:
    return Mission(run_name(run), run, {"outcome": UNFINISHED, **run.read_result()})
