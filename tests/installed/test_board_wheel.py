"""The blackboard alone, from a wheel of its own, in a fresh environment that has nothing else."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import venv
from pathlib import Path

import pytest

from elsewhere import ROOT


@pytest.mark.parametrize(("example", "package"), [("greeter_py_trees", "py_trees"), ("greeter_clipspy", "clips")])
def test_the_same_program_written_for_another_system_greets_as_well(example: str, package: str) -> None:
    pytest.importorskip(package, reason=f"{package} is not installed here")
    program = ROOT / "examples" / "peers" / f"{example}.py"
    done = subprocess.run([sys.executable, program], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "hello, world\n"


def test_the_hello_world_of_its_readme_runs_from_its_own_wheel(tmp_path: Path) -> None:
    source = shutil.copytree(ROOT / "blackboard", tmp_path / "blackboard", ignore=shutil.ignore_patterns("__pycache__"))
    subprocess.run([sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation",
                    "--wheel-dir", tmp_path, source], check=True, capture_output=True, timeout=300)
    (wheel,) = tmp_path.glob("harvey_board-*.whl")
    venv.create(tmp_path / "venv", with_pip=False)
    python = tmp_path / "venv" / "bin" / "python"
    subprocess.run([sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--no-index",
                    wheel], check=True, capture_output=True, timeout=300)
    shutil.rmtree(source)
    program, said = re.findall(r"```(?:python)?\n(.*?)```", (ROOT / "blackboard/README.md").read_text(), re.DOTALL)[:2]
    assert sum(bool(line.strip()) for line in program.splitlines()) <= 12
    (tmp_path / "hello.py").write_text(program, encoding="utf-8")
    done = subprocess.run([python, "hello.py"], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == said
