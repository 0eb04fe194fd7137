"""Which tests run a line: only they can notice a fault in it. Measured by pytest-cov, room by room.

What numba compiles is not seen by the measurement, nor what runs in a process of its own, as the reading of IFC: for a
line of a compiled function, or of a file of which nothing was seen, all tests that run a line of its file, or of a file
that imports it, are asked. A test that fails without any mutant is never asked.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path

from coverage import CoverageData

DURATION = re.compile(r"^\s*([0-9.]+)s (?:setup|call|teardown)\s+(\S.*?)\s*$", re.MULTILINE)
COMPILED = re.compile("jit|compiled")
"""The decorators of what numba compiles."""
PASSED = re.compile(r"^PASSED (\S.*?)\s*$", re.MULTILINE)


def measure_coverage(tree: Path, home: Path, python: Path, files: Sequence[str], tests: Sequence[str]) -> int:
    """Run tests in a copy of the project: ``home`` gets ``coverage`` and the durations of the tests that pass.

    ``files``: files and folders of which it is measured which lines run.

    Returns how many these are.
    """
    settings = home / "settings.ini"  # not coverage.*: pytest-cov removes such files before it measures
    included = "".join(f"\n    {file}" + "/*" * (not file.endswith(".py")) for file in files)
    settings.write_text(f"[run]\nrelative_files = true\ninclude ={included}\n")
    own = {
        "PYTHONPATH": str(tree),
        "COVERAGE_FILE": str(home / "coverage"),
        "NUMBA_CACHE_DIR": str(home / "numba"),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    command = [
        python, "-m", "pytest", "-n", "2", "-q", "-p", "no:cacheprovider", "--durations=0", "--durations-min=0",
        "-rpfE", "--tb=no", "--cov", f"--cov-config={settings}", "--cov-context=test", "--cov-report=", *tests]
    with (home / "tests.log").open("w") as log:
        subprocess.run([str(part) for part in command], cwd=tree, env=os.environ | own, stdout=log, check=False)
    told = (home / "tests.log").read_text("utf-8")
    durations_s = dict.fromkeys(PASSED.findall(told), 0.0)
    for seconds, name in DURATION.findall(told):
        if name in durations_s:
            durations_s[name] += float(seconds)
    (home / "durations.txt").write_text("".join(f"{s:.3f} {name}\n" for name, s in durations_s.items()))
    return len(durations_s)


class CoveringTests:
    """The tests that run each line, and how long each takes."""

    def __init__(self, home: Path) -> None:
        self._data = CoverageData(str(home / "coverage"))
        self._data.read()
        split = [line.partition(" ") for line in (home / "durations.txt").read_text("utf-8").splitlines()]
        self._durations_s = {name: float(seconds) for seconds, _, name in split}

    def choose(self, source: Path, file: str, lines: Iterable[int], users: Iterable[str], limit_s: float) -> list[str]:
        """Tests that can notice a fault in these lines: the laws of the file first, then the quickest.

        So many that they take ``limit_s`` together. Of a line that is run on import, as a constant, every test of the
        file is asked. Empty where no test runs the line: none can notice.
        """
        by_line = self._data.contexts_by_lineno(file)
        statements = _find_statements(ast.parse(source.read_text("utf-8")), set(lines))
        tests = self._get_tests(name for line in statements.lines for name in by_line.get(line, ()))
        of_file = self._get_tests(name for found in by_line.values() for name in found)
        if not tests and (statements.is_compiled or not of_file):
            tests = self._get_tests(
                name
                for user in {file, *users}
                for found in self._data.contexts_by_lineno(user).values()
                for name in found
            )
        elif not tests and any(line in by_line for line in statements.lines):
            tests = of_file
        own = f"/test_laws_{source.stem}.py::"
        ordered = sorted(tests, key=lambda name: (own not in name, self._durations_s[name], name))
        chosen: list[str] = []
        left_s = limit_s
        for name in ordered:
            if self._durations_s[name] <= left_s or not chosen:
                left_s -= self._durations_s[name]
                chosen.append(name)
        return chosen

    def _get_tests(self, contexts: Iterable[str]) -> set[str]:
        """From ``name|run`` to names; what is run on import has no name."""
        return {context.rpartition("|")[0] for context in set(contexts)} & self._durations_s.keys()


class _Statements(ast.NodeVisitor):
    """The lines of the statements that hold some lines, and whether one is in a function that numba compiles."""

    def __init__(self, asked: set[int]) -> None:
        self.lines = set(asked)
        self.is_compiled = False
        self._asked = asked
        self._compiled = 0

    def visit(self, node: ast.AST) -> None:
        names = node.decorator_list if isinstance(node, ast.FunctionDef) else []
        compiled = any(COMPILED.search(ast.unparse(name)) for name in names)
        self._compiled += compiled
        if isinstance(node, ast.stmt):
            body = getattr(node, "body", None)
            end = max(node.lineno, body[0].lineno - 1) if body else node.end_lineno or node.lineno
            own = set(range(node.lineno, end + 1))
            if own & self._asked:
                self.lines |= own
                self.is_compiled |= self._compiled > 0
        self.generic_visit(node)
        self._compiled -= compiled


def _find_statements(module: ast.Module, asked: set[int]) -> _Statements:
    visitor = _Statements(asked)
    visitor.visit(module)
    return visitor
