"""Many trials over all cores, kept as they are done: a campaign that is broken off goes on where it was.

A trial is told by its place in the list alone, and its result follows from it alone; so neither the number of workers
nor a break changes what a campaign finds. What other code than today's found, or another kind of processor, is found
anew.
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
from harvey.campaign.worker_pool import by_workers
from harvey.run_files.deciding_code import digest_of, files_in
from harvey.run_files.run_directory import RUNS

T = TypeVar("T")
R = TypeVar("R")

PACKAGES = ("blackboard", "world_models", "knowledge_sources", "sim", "logs", "harvey")


def campaign_folder(name: str, seed: int, *, quick: bool) -> Path:
    """Where a campaign keeps what it finds, its table and its pictures: ``runs/experiments/...``."""
    folder = RUNS / "experiments" / name / f"{'quick' if quick else 'full'}-{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def found_by_all(work: Callable[[T], R], trials: Sequence[T], kind: type[R], folder: Path, unit: str = "trial",
                 ) -> list[R]:
    """What ``work`` finds in each trial, in their order; what ``folder`` has of them already is not done again.

    Args:
        work: a function of a module, called in worker processes, one a core.
        kind: the dataclass of what it finds, of plain JSON types.

    Raises:
        BadInput: a worker was killed from outside.
    """
    if not is_dataclass(kind):
        raise ValueError(f"expected a dataclass of what is found, got {kind}")
    path = folder / "found.jsonl"
    known: dict[int, R] = dict(_kept(path, len(trials), kind))
    part = path.with_suffix(".part")
    part.write_text("".join([_line(_finder()), *(_found_line(*kept) for kept in known.items())]), "utf-8")
    part.replace(path)
    with (
        path.open("a", encoding="utf-8") as out,
        tqdm(total=len(trials), initial=len(known), unit=unit, file=sys.stderr, disable=not sys.stderr.isatty(),
             leave=False) as bar,
    ):
        todo = [number for number in range(len(trials)) if number not in known]
        for place, found in by_workers(work, [trials[number] for number in todo]):
            known[todo[place]] = found
            out.write(_found_line(todo[place], found))
            out.flush()
            bar.update()
    return [known[number] for number in range(len(trials))]


def _found_line(number: int, found: Any) -> str:
    return _line({"number": number, "found": asdict(found)})


def _line(record: dict[str, Any]) -> str:
    return f"{json.dumps(record)}\n"


def _finder() -> dict[str, str]:
    """Who finds here: a campaign's first line."""
    return {"code": code_digest(), "arithmetic": arithmetic()}


@cache
def code_digest() -> str:
    """The code that decides, as a digest of its files."""
    root = Path(__file__).resolve().parents[1]
    files = [files_in(root, package, (".py", ".toml")) for package in PACKAGES]
    return digest_of({name: path for found in files for name, path in found.items()})


def _kept(path: Path, trials: int, kind: type[R]) -> Iterator[tuple[int, R]]:
    """What an earlier process of the same code found likewise; a line that was cut off is left out."""
    lines = path.read_text(encoding="utf-8").split("\n")[:-1] if path.is_file() else []
    if not lines or json.loads(lines[0]) != _finder():
        return
    for record in map(json.loads, lines[1:]):
        if record["number"] < trials:
            yield record["number"], kind(**record["found"])
