"""Mutation testing by room with cosmic-ray: how many small faults put into the code are noticed by the tests?

``make mutants ROOM=pose SAMPLE=50`` puts a sample of faults into a copy of the project, one at a time, and runs the
room's tests against each. Run again, it goes on where it stopped; ``--report`` only tells how far it is. The copy has
a numba cache of its own. Rooms and equivalent mutants are in ``mutants.toml``.

It runs in an environment that has cosmic-ray (the extra ``mutants``), and the tests with the interpreter ``--python``.
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
from typing import Any

from cosmic_ray.work_db import WorkDB
from cosmic_ray.work_item import TestOutcome, WorkerOutcome, WorkItem, WorkResult

ROOT = Path(__file__).resolve().parents[1]
HOME = ROOT / ".mutants"
TABLE = tomllib.loads((ROOT / "tests" / "mutants.toml").read_text("utf-8"))
TIMEOUT_S = 300.0
"""A mutant whose tests take longer is caught: it does not end."""


def main() -> int:
    parser = argparse.ArgumentParser(description="Mutation testing of one room.")
    parser.add_argument("room", choices=list(TABLE["rooms"]))
    parser.add_argument("--sample", type=int, default=60, help="how many mutants are drawn; 0: all of them")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--python", default=sys.executable, help="interpreter that runs the tests")
    parser.add_argument("--report", action="store_true", help="only tell what was found so far")
    asked = parser.parse_args()
    folder = HOME / f"{asked.room}-{asked.sample or 'all'}-{asked.seed}"
    session = folder / "session.sqlite"
    if not asked.report:
        tree, config = folder / "tree", folder / "config.toml"
        _copy_project(tree, session)
        _write_config(config, TABLE["rooms"][asked.room], asked.python)
        if not session.exists():
            _call("init", config, session, tree)
            _skip_all_but(session, tree, asked.sample, asked.seed)
        _call("exec", config, session, tree)
    if not session.exists():
        print(f"{asked.room}: nothing was run yet")
        return 1
    return _report(session, asked.room)


def _copy_project(tree: Path, session: Path) -> None:
    """A fresh copy of the tracked files: an interrupted run may have left a mutant. What changed begins anew."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True).stdout.decode()
    names = [name for name in listed.split("\0") if name and (ROOT / name).is_file()]
    stamp, mark = hashlib.sha256(), tree.parent / "sources.sha256"
    for name in names:
        stamp.update(name.encode() + (ROOT / name).read_bytes())
    if not mark.exists() or mark.read_text() != stamp.hexdigest():
        session.unlink(missing_ok=True)
    shutil.rmtree(tree, ignore_errors=True)
    for name in names:
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, tree / name)
    mark.write_text(stamp.hexdigest())


def _write_config(config: Path, room: dict[str, Any], python: str) -> None:
    tests = " ".join(room["tests"])
    command = f"{Path(python).absolute()} -B -m pytest -x -q -p no:cacheprovider {tests}"
    config.write_text(
        f"[cosmic-ray]\nmodule-path = {room['files']!r}\ntimeout = {TIMEOUT_S}\nexcluded-modules = []\n"
        f'test-command = "{command}"\n[cosmic-ray.distributor]\nname = "local"\n')


def _call(command: str, config: Path, session: Path, tree: Path) -> None:
    """A command of cosmic-ray on the copy."""
    own = {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_CACHE_DIR": str(tree.parent / "numba"),
           "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    ray = Path(sys.executable).with_name("cosmic-ray")
    subprocess.run([ray, command, config, session], cwd=tree, check=True, env=os.environ | own)


def _skip_all_but(session: Path, tree: Path, sample: int, seed: int) -> None:
    """Mark as skipped what is not drawn, what is in annotations, and comparisons by identity.

    Annotations are not run; and whether equal numbers are one object is the interpreter's affair.
    """
    database = WorkDB(session, WorkDB.Mode.open)
    items = sorted(database.work_items, key=lambda item: str(item.mutations))
    notes = {path: _find_annotations(tree / path) for path in {item.mutations[0].module_path for item in items}}
    real = [item for item in items if not _is_within(item, notes[item.mutations[0].module_path])
            and not item.mutations[0].operator_name.endswith(("_Is", "_IsNot"))]
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
    caught: Counter[str] = Counter()
    all_of: Counter[str] = Counter()
    survivors: list[str] = []
    for item, result in database.completed_work_items:
        if result.worker_outcome == WorkerOutcome.SKIPPED:
            continue
        name = str(item.mutations[0].module_path)
        all_of[name] += 1
        if result.test_outcome != TestOutcome.SURVIVED or _is_equivalent(name, result.diff or ""):
            caught[name] += 1
        else:
            mutation = item.mutations[0]
            survivors.append(f"{name}:{mutation.start_pos[0]} {mutation.operator_name}\n{result.diff}")
    pending = len(database.pending_work_items)
    database.close()
    for name, count in sorted(all_of.items()):
        print(f"{caught[name]:4} of {count:4}  {name}")
    total = sum(all_of.values())
    print("\n".join(["", *survivors]))
    print(f"{room}: {sum(caught.values())} of {total} mutants are caught or equivalent, {pending} are still to be run")
    return 0


def _is_equivalent(name: str, diff: str) -> bool:
    """Whether a difference is in the list of those that no test can notice."""
    gone = [line[1:].strip() for line in diff.splitlines() if line.startswith("-") and not line.startswith("---")]
    return any(known["at"].partition(": ")[0] == name and any(known["at"].partition(": ")[2] in line for line in gone)
               for known in TABLE.get("equivalents", ()))


if __name__ == "__main__":
    raise SystemExit(main())
