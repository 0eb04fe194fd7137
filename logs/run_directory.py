"""A run directory.

``run.json`` tells how the run began, ``journal.jsonl`` what was decided, ``camera.mjpeg`` what the camera delivered:
from these three a run is decided again, goes on after a crash, is drawn again. ``recording.rrd`` is the drawing, and
``result.json`` tells how it ended.
"""

from __future__ import annotations

import difflib
import json
import sys
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from logs.disk import Appended, is_being_written, write_whole
from logs.run_errors import BadInput
from world_models.files.regular_files import read_regular

RUNS = Path("runs")
"""Where runs are kept without ``--out``."""
FILES = ("run.json", "journal.jsonl", "camera.mjpeg", "recording.rrd", "result.json", "camera.toml", "told.txt")
MOST_JSON_BYTES = 20_000_000
"""Of the files of a run that are read as a whole."""
JOURNAL_VERSION = 3
"""Of the names in journals; one that is older has other names of kinds and fields (CHANGELOG.md)."""
RESULT: Mapping[str, tuple[Any, str]] = {
    "scenario": (str, "a text"),
    "outcome": (str, "a text"),
    "seed": (int, "a number"),
    "milestones": (dict, "an object"),
    **dict.fromkeys(("decisions", "collisions", "replans", "relocalizations"), (int | None, "a number")),
    "contacts": (list, "a list"),
    "happened": (list | None, "a list"),
    "starved": (list, "a list"),
    **dict.fromkeys(("final_error_m", "sim_time_s", "path_length_m"), (int | float | None, "a number")),
}
"""Keys of ``result.json`` that others read, with the JSON types that they have; null is what nobody knows."""


@dataclass(frozen=True, slots=True)
class RunDirectory:
    """Where one run is recorded."""

    path: Path

    @property
    def recording(self) -> Path:
        return self.path / "recording.rrd"

    @property
    def journal(self) -> Path:
        return self.path / "journal.jsonl"

    @property
    def camera(self) -> Path:
        return self.path / "camera.mjpeg"

    @property
    def result(self) -> Path:
        return self.path / "result.json"

    def read_result(self) -> dict[str, Any]:
        """The result; empty where the run has none (it was cut off). Raises BadInput where it is malformed."""
        if not self.result.exists():
            return {}
        data = read_json(self.result)
        if not isinstance(data, dict):
            raise BadInput(f"{self.result}: expected a JSON object, got {type(data).__name__}")
        for key, (kind, named) in RESULT.items():
            if key in data and not isinstance(data[key], kind):
                raise BadInput(f"{self.result}: {key}: expected {named}, got {json.dumps(data[key])}")
        return data

    def write_camera(self, text: str) -> None:
        """Write ``camera.toml``: the camera at the end, where it differs from its nominal state. Raises OSError."""
        write_whole(self.path / "camera.toml", text)

    def write_result(self, record: Mapping[str, Any]) -> None:
        """Write ``result.json``; an older one stays as it is until the new one is whole. Raises OSError."""
        write_whole(self.result, json.dumps(record, indent=2) + "\n")


def check_version(folder: Path) -> None:
    """Raises BadInput where a run's journal is of another version; where nothing tells, it is read as it is."""
    if "world" in (head := read_head(folder)):
        refuse_version(folder, head.get("journal_version", 1))


def read_head(folder: Path) -> dict[str, Any]:
    """What ``run.json`` says; nothing where it cannot be read."""
    try:
        head = read_json(folder / "run.json")
    except BadInput:
        return {}
    return head if isinstance(head, dict) else {}


def read_json(path: Path, what: str = "a readable file") -> Any:
    """What a file of a run or a campaign says. Raises BadInput where it cannot be read, or is no JSON."""
    try:
        return json.loads(read_regular(path, MOST_JSON_BYTES))
    except OSError as error:
        raise BadInput(f"{path}: expected {what}, got: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{path}: expected JSON, got: {error}") from None


def refuse_version(folder: Path, version: object) -> None:
    """Raises BadInput for any version but this program's."""
    if version != JOURNAL_VERSION:
        raise BadInput(f"{folder}: expected a run whose journal is of version {JOURNAL_VERSION}, got version {version};"
                       " the program that made it reads it, and here the mission can be run again")


def check_vacant(path: Path) -> Path:
    """A place where a run may be written: nothing, or an older run. Raises BadInput where there is anything else."""
    try:
        here = next(p for p in (path, *path.parents) if p.exists())
        names = {p.name for p in here.iterdir()}
    except OSError as error:
        raise BadInput(f"--out {path}: expected a directory, got: {error.strerror}") from None
    others = sorted(names.difference(FILES))
    if others and here == path:
        raise BadInput(f"--out {path}: expected a new directory or an older run's, got one with {others[0]!r}")
    if "journal.jsonl" in names and here != path:
        raise BadInput(f"--out {path}: expected a directory outside of runs, got one in the run {here}")
    return path


def prepare_directory(path: Path, name: str, seed: int) -> tuple[Path, Path | None]:
    """Make room for a run of a scenario and seed.

    An older run of the same is deleted; one of another scenario or seed is moved aside, and so is any on hardware,
    which nobody can make again.

    Returns:
        where the run may be written, and where the older one is now, if it is kept.

    Raises BadInput where the directory cannot be used, or a run there goes on.
    """
    journal = path / "journal.jsonl"
    try:
        check_vacant(path).mkdir(parents=True, exist_ok=True)
        aside = None if _is_of(path, name, seed) else _free_beside(path)
        with closing(Appended(journal, "journal", keep=None)):  # nobody else writes it meanwhile: so it goes last
            if aside is not None:
                path.rename(aside)
                path.mkdir()
            for file in FILES:
                if file != journal.name:
                    (path / file).unlink(missing_ok=True)
            journal.unlink(missing_ok=True)
    except OSError as error:
        raise BadInput(f"--out {path}: expected a directory to write to, got: {error.strerror}") from None
    return path, aside


def make_room(out: Path, name: str, seed: int) -> Path:
    """As :func:`prepare_directory`; says so where a run of something else was moved aside. Raises BadInput."""
    path, aside = prepare_directory(out, name, seed)
    if aside is not None:
        print(f"--out {out}: the run that was there is of another scenario or seed; it is kept in {aside}",
              file=sys.stderr)
    return path


def _is_of(path: Path, name: str, seed: int) -> bool:
    """Whether what is there may be deleted: an older run of this scenario and seed, or no run at all."""
    if not (head := read_head(path)):
        return not (path / "journal.jsonl").exists()
    return head.get("kind") != "hardware" and (head.get("name"), head.get("seed")) == (name, seed)


def expect_unwritten(path: Path) -> Path:
    """The same; raises BadInput where a run there goes on, OSError where its journal cannot be read."""
    if is_being_written(path / "journal.jsonl"):
        raise BadInput(f"{path}: expected a run that has ended, got one that another process is writing")
    return path


def _free_beside(path: Path) -> Path:
    """The first unused name next to a directory: ``runs/try-older-1``."""
    there = path if path.name not in ("", "..") else path.resolve()
    return next(p for n in count(1) if not (p := there.with_name(f"{there.name}-older-{n}")).exists())


def open_run(text: str, needed: str = "journal.jsonl") -> RunDirectory:
    """The run that a user names: its directory, a file in it, or its name under ``runs/``.

    Raises BadInput where there is none (near ones are listed), it is of another version, or it lacks the needed file.
    """
    run = RunDirectory(find_directory(text))
    inner = sorted(str(p.parent) for p in run.path.glob("*/journal.jsonl"))
    if inner and not run.journal.exists():
        raise BadInput(f"expected one run, got {text!r}, which holds {len(inner)} of them, as {inner[0]}")
    check_version(run.path)
    if not (run.path / needed).is_file():
        raise BadInput(f"expected a run directory with a {needed}, got {text!r}, which has none")
    return run


def find_directory(text: str) -> Path:
    """The directory that a user names, as it is or under ``runs/``, or by a run's file in it. Raises BadInput."""
    path = next((p for p in (Path(text), RUNS / text) if p.exists()), None)
    if path is None:
        raise BadInput(f"expected a run directory{_near(text)}, got {text!r}, which does not exist")
    if not path.is_dir() and path.name not in FILES:
        raise BadInput(f"expected a run directory or a file of one ({', '.join(FILES)}), got {text!r}")
    return path if path.is_dir() else path.parent


def _near(text: str) -> str:
    known = [str(p.parent) for p in (*RUNS.glob("*/journal.jsonl"), *RUNS.glob("*/*/journal.jsonl"))]
    near = difflib.get_close_matches(text, sorted(known), n=4, cutoff=0.5) or sorted(known)[:4]
    return f" as {', '.join(near)}" if near else " (harvey run makes them under runs/)"
