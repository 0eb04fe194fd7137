"""What an experiment found, kept as a file: by which commit, when, with which options, and each claim."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from experiments.report import Cell, Finding, Report
from harvey.errors import BadInput

ROOT = Path(__file__).parents[1]
CODE = ("blackboard", "world_models", "knowledge_sources", "sim", "harvey", "experiments", "extras")
"""What may change what an experiment finds."""
STALE_AFTER = 150
"""A result is stale when more commits than this have changed the code since it was found."""


@dataclass(frozen=True, slots=True)
class Result:
    """The last result of an experiment.

    Attributes:
        experiment: its name; title: of its report.
        options: as they were given: ``--quick``, ``--missions 12``; seed: of all random numbers.
        date: when it ended, in UTC; seconds: how long it took.
        commit: as by :func:`find_commit`.
        claims: each with one of the three words of a finding.
        columns, rows: of its table.
    """

    experiment: str
    title: str
    options: str
    seed: int
    date: str
    seconds: float
    commit: str
    claims: tuple[tuple[str, Finding], ...]
    columns: tuple[str, ...] = ()
    rows: tuple[tuple[Cell, ...], ...] = ()


def build_result(name: str, report: Report, options: str, seed: int, seconds: float) -> Result:
    """The result of a report that has just been made."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return Result(name, report.title, options, seed, now, round(seconds, 1), find_commit(), report.findings,
                  report.columns, report.rows)


def write_result(result: Result, path: Path) -> None:
    """Write it as JSON. Raises BadInput where it cannot be written."""
    try:
        path.write_text(json.dumps(asdict(result), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise BadInput(f"--out {path}: expected a file to write to, got: {error.strerror}") from None


def read_results(folder: Path) -> Iterator[Result]:
    """The results that a folder has, by the names of their files."""
    for path in sorted(folder.glob("*.json")):
        given = json.loads(path.read_text(encoding="utf-8"))
        yield Result(**{name: _frozen(value) for name, value in given.items()})


def _frozen(value: Any) -> Any:
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


def find_commit() -> str:
    """The commit of this copy of the project, the newest that others have; "" where nobody knows.

    With a + where the code has been changed since.
    """
    commit = _git("merge-base", "HEAD", "@{upstream}") or _git("rev-parse", "HEAD")
    if not commit:
        return ""
    return commit[:8] + "+" * bool(_git("diff", "--name-only", commit, "--", *CODE))


def count_commits_since(date: str) -> int | None:
    """How many commits have changed the code since a date; None where that is not known."""
    count = _git("rev-list", "--count", f"--since={date}", "HEAD", "--", *CODE)
    return int(count) if count else None


def is_stale(result: Result) -> bool:
    """Whether the code has changed so much since that the result tells little of it."""
    commits = count_commits_since(result.date)
    return commits is not None and commits > STALE_AFTER


def _git(*words: str) -> str | None:
    """What git says of this copy; None where there is no git, or no history."""
    try:
        done = subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()
