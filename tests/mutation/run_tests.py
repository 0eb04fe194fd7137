"""What cosmic-ray calls for each mutant: find the line that it changed, and run the tests that can notice it.

``run_tests.py HOME ROOM PYTHON`` is run in the copy of the project that has the mutant. ``HOME/pristine`` is the same
without it, ``HOME/measured`` tells which tests run which line, and has what numba compiled of the copy.
"""

from __future__ import annotations

import ast
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import tomllib
from difflib import SequenceMatcher
from pathlib import Path

from covering_tests import CoveringTests

LIMIT_S = 30.0
"""So long take the tests of one mutant together, by what they took without it."""
TIMEOUT_S = 200.0
"""A mutant whose tests take longer is caught: it does not end."""
NO_TEST, TIMED_OUT = "no test runs this line", "timed out"


def main() -> int:
    home, room, python = Path(sys.argv[1]), sys.argv[2], sys.argv[3]
    tree, table = Path.cwd(), tomllib.loads((Path(__file__).parent / "rooms.toml").read_text("utf-8"))["rooms"][room]
    file, lines = _find_change(tree, home / "pristine", table["files"])
    source, users = home / "pristine" / file, _list_users(tree, file)
    tests = CoveringTests(home / "measured").choose(source, file, lines, users, LIMIT_S)
    if not tests:
        print(f"{file}, lines {sorted(lines)}: {NO_TEST}", flush=True)
        return 0
    print(f"{file}, lines {sorted(lines)}: {len(tests)} tests", flush=True)
    cache = _copy_cache(home / "measured" / "numba", tree, users)
    try:
        return _run(python, tests, tree, cache)
    finally:
        shutil.rmtree(cache, ignore_errors=True)


def _run(python: str, tests: list[str], tree: Path, cache: Path) -> int:
    """Run the tests until the first fails; with all that they started, they end after the time limit."""
    own = {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [
        python, "-B", "-m", "pytest", "-x", "-q", "--tb=line", "-p", "no:cacheprovider",
        "--hypothesis-profile=mutants", *tests]
    started = subprocess.Popen(command, env=os.environ | own, start_new_session=True)
    try:
        return started.wait(TIMEOUT_S)
    except subprocess.TimeoutExpired:
        print(TIMED_OUT, flush=True)
        return 1
    finally:
        if started.poll() is None:
            os.killpg(started.pid, signal.SIGKILL)
            started.wait()


def _find_change(tree: Path, pristine: Path, files: list[str]) -> tuple[str, set[int]]:
    """The file that has a mutant, and its lines in the file without it.

    All others get back the time of their last change, or numba would compile again what had a mutant before.
    """
    found: tuple[str, set[int]] | None = None
    for part in files:
        for path in sorted((pristine / part).rglob("*.py")) if (pristine / part).is_dir() else [pristine / part]:
            name = path.relative_to(pristine)
            old, new = path.read_text("utf-8"), (tree / name).read_text("utf-8")
            if old == new:
                shutil.copystat(path, tree / name)
                continue
            matcher = SequenceMatcher(None, old.splitlines(), new.splitlines(), autojunk=False)
            found = (
                str(name),
                {1 + i for tag, a, b, _, _ in matcher.get_opcodes() if tag != "equal" for i in range(a, max(b, a + 1))},
            )
    if found is None:
        raise SystemExit("no file differs from the one without a mutant")
    return found


def _copy_cache(cache: Path, tree: Path, users: set[str]) -> Path:
    """A copy of numba's cache without what was compiled from the file that has a mutant, or from one that uses it.

    numba does not see that a function was compiled from another file that has changed since.
    """
    copy = Path(tempfile.mkdtemp(prefix="numba-", dir=cache.parent))
    cache.mkdir(exist_ok=True)
    shutil.copytree(cache, copy, dirs_exist_ok=True, copy_function=os.link)
    for user in users:
        for old in copy.rglob(f"{Path(user).stem}.*"):
            old.unlink()
    return copy


def _list_users(tree: Path, file: str) -> set[str]:
    """A file and all files that import it, directly or by others."""
    used: dict[str, set[str]] = {}
    for package in ("world_models", "knowledge_sources", "sim"):
        for path in (tree / package).rglob("*.py"):
            names = {
                str(node.module).replace(".", "/")
                for node in ast.walk(ast.parse(path.read_text("utf-8")))
                if isinstance(node, ast.ImportFrom)
            }
            used[str(path.relative_to(tree))] = {f"{name}.py" for name in names}
    users, ahead = {file}, [file]
    while ahead:
        name = ahead.pop()
        found = {user for user, names in used.items() if name in names} - users
        users |= found
        ahead += sorted(found)
    return users


if __name__ == "__main__":
    raise SystemExit(main())
