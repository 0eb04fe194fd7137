"""The board compiled: its mechanism as machine code, made of the same source by mypyc where a C compiler is at hand.

No mission needs it: most of a cycle is the experts' there, ``harvey experiment agenda`` says how much. It is for boards
with many small, fast experts. ``make compiled`` writes a package that stands in for ``blackboard`` wherever its folder
comes first on Python's path::

    PYTHONPATH=build/compiled harvey run lab-to-allens-office

The laws of the board hold for it too, and its journals are the same to the byte
(tests/missions/test_missions_compiled.py). It is made of the source as it was; ``run.json`` names the code that
decided, so a stale one shows.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

SOURCE = Path(__file__).parents[1] / "blackboard"
MECHANISM = ("agenda", "board", "effect", "encoding", "journal", "scheduler", "shelf")
"""The modules through which every cycle goes; what experts and diaries derive from stays as it is."""
GLUE = "*__mypyc*"
"""What mypyc puts beside the package: the code that its modules share."""


class CannotCompileError(Exception):
    """Says what is missing, or what the compiler said last."""


def compile_board(into: Path) -> None:
    """Write the compiled package ``blackboard`` into a folder, in place of one that is there; takes some 15 seconds.

    Raises:
        CannotCompileError: mypyc, setuptools, a C compiler or Python's headers are not here; or the folder has
            something else in it.
        OSError: the folder cannot be written.
    """
    old = [*into.glob("blackboard"), *into.glob(GLUE)] if [*into.glob("blackboard/scheduler.*.so")] else []
    if into.is_dir() and (others := sorted(path.name for path in into.iterdir() if path not in old)):
        raise CannotCompileError(f"{into}: expected a folder of its own, but {others[0]} is in it")
    absent = [name for name in ("mypyc", "setuptools") if find_spec(name) is None]
    if absent:
        raise CannotCompileError(f"without {' and '.join(absent)}; .venv/bin/pip install '.[compiled]' brings them")
    with TemporaryDirectory() as bench:
        work = Path(bench)
        (work / "blackboard").mkdir()
        for module in SOURCE.glob("*.py"):
            shutil.copy(module, work / "blackboard")
        made = subprocess.run(
            [sys.executable, "-m", "mypyc", *(f"blackboard/{name}.py" for name in MECHANISM)],
            cwd=work, env={**os.environ, "MYPYC_OPT_LEVEL": "3", "PYTHONPATH": ""}, capture_output=True, text=True,
            check=False,
        )
        if made.returncode:
            last = (made.stderr.strip() or made.stdout.strip()).splitlines()[-3:]
            raise CannotCompileError(" | ".join(["mypyc or the C compiler gave up", *last]))
        into.mkdir(parents=True, exist_ok=True)
        for path in old:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        for path in (work / "blackboard", *work.glob(GLUE)):
            shutil.move(path, into)


def main(arguments: list[str]) -> int:
    """``python -m harvey.compiled FOLDER``: 0 done, 2 it cannot be."""
    if len(arguments) != 1 or arguments[0].startswith("-"):
        print("usage: python -m harvey.compiled FOLDER", file=sys.stderr)
        return 2
    try:
        compile_board(Path(arguments[0]))
    except (CannotCompileError, OSError) as error:
        print(f"harvey.compiled: {error}", file=sys.stderr)
        return 2
    print(f"Compiled. Use it with: PYTHONPATH={arguments[0]} harvey ...")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
