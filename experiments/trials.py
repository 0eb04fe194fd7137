"""Run many trials on all cores and keep each result, so that an interrupted campaign continues where it was.

A result depends on its trial alone, so neither the number of workers nor an interruption changes what a campaign
finds. Results of other code than today's, or of another kind of processor, are computed again.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from tqdm import tqdm

from harvey.arithmetic import arithmetic
from harvey.campaign.worker_pool import map_over_workers
from harvey.run_files.deciding_code import digest_of, files_in
from harvey.run_files.run_directory import RUNS

T = TypeVar("T")
R = TypeVar("R")

RESULTS = "results.jsonl"
PACKAGES = ("blackboard", "world_models", "knowledge_sources", "sim", "logs", "harvey")


def campaign_folder(name: str, seed: int, *, quick: bool) -> Path:
    """Make the folder of a campaign's results, table and pictures: ``runs/experiments/NAME/...``."""
    folder = RUNS / "experiments" / name / f"{'quick' if quick else 'full'}-{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def run_trials(work: Callable[[T], R], trials: Sequence[T], kind: type[R], folder: Path, unit: str = "trial",
               ) -> list[R]:
    """Return the result of each trial, in order; results that ``folder`` has already are not computed again.

    Args:
        work: a function of a module, called in worker processes, one per core.
        kind: the dataclass of a result, of plain JSON types.

    Raises:
        BadInput: a worker was killed from outside.
    """
    if not is_dataclass(kind):
        raise ValueError(f"expected a dataclass of results, got {kind}")
    path = folder / RESULTS
    known: dict[int, R] = dict(_read_results(path, len(trials), kind))
    part = path.with_suffix(".part")
    part.write_text("".join([_to_line(_origin()), *(_result_line(*item) for item in known.items())]), "utf-8")
    part.replace(path)
    with (
        path.open("a", encoding="utf-8") as out,
        tqdm(total=len(trials), initial=len(known), unit=unit, file=sys.stderr, disable=not sys.stderr.isatty(),
             leave=False) as bar,
    ):
        todo = [number for number in range(len(trials)) if number not in known]
        for place, result in map_over_workers(work, [trials[number] for number in todo]):
            known[todo[place]] = result
            out.write(_result_line(todo[place], result))
            out.flush()
            bar.update()
    return [known[number] for number in range(len(trials))]


def _result_line(number: int, result: Any) -> str:
    return _to_line({"number": number, "result": asdict(result)})


def _to_line(record: dict[str, Any]) -> str:
    return f"{json.dumps(record)}\n"


def _origin() -> dict[str, str]:
    """Code and processor that compute the results: a campaign's first line."""
    return {"code": code_digest(), "arithmetic": arithmetic()}


@cache
def code_digest() -> str:
    """Digest of the code that decides."""
    root = Path(__file__).resolve().parents[1]
    files = [files_in(root, package, (".py", ".toml")) for package in PACKAGES]
    return digest_of({name: path for package in files for name, path in package.items()})


def _read_results(path: Path, trials: int, kind: type[R]) -> Iterator[tuple[int, R]]:
    """Read the results of an earlier process of the same code; a line that was cut off is left out."""
    lines = path.read_text(encoding="utf-8").split("\n")[:-1] if path.is_file() else []
    if not lines or json.loads(lines[0]) != _origin():
        return
    for record in map(json.loads, lines[1:]):
        if record["number"] < trials:
            yield record["number"], kind(**record["result"])
