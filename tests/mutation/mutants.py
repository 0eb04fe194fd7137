"""Mutation testing by room with cosmic-ray: how many small faults put into the code are noticed by the tests?

``make mutants ROOM=pose SAMPLE=50`` puts a sample of faults into a copy of the project, one at a time, and runs against
each the tests that run its line (``covering_tests.py``, ``run_tests.py``). First it measures which these are: some
minutes, once, and again when a source has changed. Run again, it goes on where it stopped; ``--report`` only tells how
far it is. The copy has a numba cache of its own. Rooms and equivalent mutants are in ``rooms.toml``.

It runs in an environment that has harvey with the extra ``mutants``, and the tests with the interpreter ``--python``.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import os
import random
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

from cosmic_ray.work_db import WorkDB
from cosmic_ray.work_item import TestOutcome, WorkerOutcome, WorkItem, WorkResult
from covering_tests import measure_coverage
from run_tests import NO_TEST, TIMED_OUT, TIMEOUT_S

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
FATES = (
    "caught by a test",
    "caught: its tests do not end",
    "caught: it does not even start",
    "equivalent",
    "survives its tests",
    f"survives: {NO_TEST}",
)
TABLE = tomllib.loads((HERE / "rooms.toml").read_text("utf-8"))


def main() -> int:
    parser = argparse.ArgumentParser(description="Mutation testing of one room.")
    parser.add_argument("room", choices=list(TABLE["rooms"]))
    parser.add_argument("--sample", type=int, default=60, help="how many mutants are drawn; 0: all of them")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--python", default=sys.executable, help="interpreter that runs the tests")
    parser.add_argument("--report", action="store_true", help="only tell what was found so far")
    asked = parser.parse_args()
    home = ROOT / ".mutants" / asked.room
    folder = home / f"{asked.sample or 'all'}-{asked.seed}"
    session = folder / "session.sqlite"
    if not asked.report:
        tree, config, python = home / "tree", folder / "config.toml", Path(asked.python).absolute()
        _prepare(home, asked.room, python)
        _copy_project(tree)
        folder.mkdir(exist_ok=True)
        _write_config(config, home, asked.room, python)
        if not session.exists():
            begun = session.with_suffix(".begun")  # drawn as a whole, or again: an interruption leaves no half of it
            begun.unlink(missing_ok=True)
            _call("init", config, begun, tree)
            _skip_all_but(begun, tree, asked.sample, asked.seed)
            begun.rename(session)
        _call("exec", config, session, tree)
    if not session.exists():
        print(f"{asked.room}: nothing was run yet")
        return 1
    return _report(session, asked.room)


def _prepare(home: Path, room: str, python: Path) -> None:
    """A copy of the project without mutants, and which tests of a room run which line; again when a file has changed.

    Measured where the mutants are put: numba keeps what it compiled by the place of the file.
    """
    pristine, measured, stamp = home / "pristine", home / "measured", hashlib.sha256()
    for name in _list_files():
        if name.endswith(".py") and (ROOT / name).parent != HERE:
            stamp.update(name.encode() + (ROOT / name).read_bytes())
    mark = home / "sources.sha256"
    if mark.exists() and mark.read_text() == stamp.hexdigest():
        return
    shutil.rmtree(home, ignore_errors=True)
    measured.mkdir(parents=True)
    for copy in (pristine, home / "tree"):
        _copy_project(copy)
    print("measuring which tests run which line", flush=True)
    table = TABLE["rooms"][room]
    found = measure_coverage(home / "tree", measured, python, table["files"], table["tests"])
    if not found:
        raise SystemExit(f"no test passes without a mutant: {measured / 'tests.log'}")
    print(f"{found} tests pass without a mutant", flush=True)
    mark.write_text(stamp.hexdigest())


def _copy_project(tree: Path) -> None:
    """A fresh copy of the tracked files: an interrupted run may have left a mutant."""
    shutil.rmtree(tree, ignore_errors=True)
    for name in _list_files():
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, tree / name)


def _list_files() -> list[str]:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True).stdout.decode()
    return [name for name in listed.split("\0") if name and (ROOT / name).is_file()]


def _write_config(config: Path, home: Path, room: str, python: Path) -> None:
    command = f"{sys.executable} {HERE / 'run_tests.py'} {home} {room} {python}"
    config.write_text(
        f"[cosmic-ray]\nmodule-path = {TABLE['rooms'][room]['files']!r}\ntimeout = {2.0 * TIMEOUT_S}\n"
        f'excluded-modules = []\ntest-command = "{command}"\n[cosmic-ray.distributor]\nname = "local"\n'
    )


def _call(command: str, config: Path, session: Path, tree: Path) -> None:
    """A command of cosmic-ray on the copy."""
    own = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    ray = Path(sys.executable).with_name("cosmic-ray")
    subprocess.run([ray, command, config, session], cwd=tree, check=True, env=os.environ | own)


def _skip_all_but(session: Path, tree: Path, sample: int, seed: int) -> None:
    """Mark as skipped what is not drawn, what is in annotations, and comparisons by identity.

    Annotations are not run; and whether equal numbers are one object is the interpreter's affair.
    """
    database = WorkDB(session, WorkDB.Mode.open)
    items = sorted(database.work_items, key=lambda item: str(item.mutations))
    notes = {path: _find_annotations(tree / path) for path in {item.mutations[0].module_path for item in items}}
    real = [
        item
        for item in items
        if not _is_within(item, notes[item.mutations[0].module_path])
        and not item.mutations[0].operator_name.endswith(("_Is", "_IsNot"))
    ]
    drawn = real if not sample else random.Random(seed).sample(real, min(sample, len(real)))
    kept = {item.job_id for item in drawn}
    skipped = [item.job_id for item in items if item.job_id not in kept]
    database.set_multiple_results(skipped, WorkResult(WorkerOutcome.SKIPPED))
    database.close()
    print(f"{len(drawn)} of {len(real)} mutants are drawn, with seed {seed}")


def _find_annotations(path: Path) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Where the annotations of a file begin and end: (line, column)."""
    out = []
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        for found in (getattr(node, "annotation", None), getattr(node, "returns", None)):
            if isinstance(found, ast.expr):
                out.append(((found.lineno, found.col_offset), (found.end_lineno or 0, found.end_col_offset or 0)))
    return out


def _is_within(item: WorkItem, notes: list[tuple[tuple[int, int], tuple[int, int]]]) -> bool:
    at = tuple(item.mutations[0].start_pos)
    return any(begins <= at < ends for begins, ends in notes)


def _report(session: Path, room: str) -> int:
    """Caught, equivalent and surviving mutants by file, and the difference that each survivor makes."""
    database = WorkDB(session, WorkDB.Mode.open)
    files: dict[str, Counter[str]] = {}
    survivors: list[str] = []
    for item, result in database.completed_work_items:
        if result.worker_outcome == WorkerOutcome.SKIPPED:
            continue
        mutation, diff, told = item.mutations[0], result.diff or "", result.output or ""
        name = str(mutation.module_path)
        fate = _name_fate(result, name, diff, told)
        files.setdefault(name, Counter())[fate] += 1
        if fate.startswith("survives"):
            survivors.append(f"{name}:{mutation.start_pos[0]} {mutation.operator_name}, {fate}\n{diff}")
    pending = len(database.pending_work_items)
    database.close()
    print("\n".join([*survivors, ""]))
    for name, fates in sorted(files.items()):
        good = sum(count for fate, count in fates.items() if not fate.startswith("survives"))
        print(f"{good:4} of {fates.total():4}  {name}")
    total = sum(files.values(), Counter[str]())
    for fate in FATES:
        print(f"{total[fate]:4}  {fate}")
    good = sum(total[fate] for fate in FATES if not fate.startswith("survives"))
    print(f"{room}: {good} of {total.total()} mutants are caught or equivalent, {pending} are still to be run")
    return 0


def _name_fate(result: WorkResult, name: str, diff: str, told: str) -> str:
    if result.worker_outcome != WorkerOutcome.NORMAL or result.test_outcome == TestOutcome.INCOMPETENT:
        return FATES[2]
    if result.test_outcome == TestOutcome.KILLED:
        return FATES[1] if told.rstrip().endswith(TIMED_OUT) else FATES[0]
    if _is_equivalent(name, diff):
        return FATES[3]
    return FATES[5] if NO_TEST in told else FATES[4]


def _is_equivalent(name: str, diff: str) -> bool:
    """Whether a difference is in the list of those that no test can notice."""
    lines = [line for line in diff.splitlines() if not line.startswith(("---", "+++"))]
    gone, new = ([line[1:].strip() for line in lines if line.startswith(sign)] for sign in "-+")
    for known in TABLE.get("equivalents", ()):
        file, _, part = known["at"].partition(": ")
        is_there = file == name and any(part in line for line in gone)
        if is_there and any(known.get("becomes", "") in line for line in new):
            return True
    return False


if __name__ == "__main__":
    raise SystemExit(main())
