"""The blackboard alone, from a wheel of its own, in a fresh environment that has nothing else."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import blackboard
from elsewhere import ROOT, build_wheel, install_elsewhere


@pytest.mark.parametrize(("example", "package"), [("greeter_py_trees", "py_trees"), ("greeter_clipspy", "clips")])
def test_the_same_program_written_for_another_system_greets_as_well(example: str, package: str) -> None:
    pytest.importorskip(package, reason=f"{package} is not installed here")
    program = ROOT / "examples" / "peers" / f"{example}.py"
    done = subprocess.run([sys.executable, program], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "hello, world\n"


def test_the_programs_of_its_readme_run_from_its_own_wheel(tmp_path: Path) -> None:
    source = shutil.copytree(ROOT / "blackboard", tmp_path / "blackboard", ignore=shutil.ignore_patterns("__pycache__"))
    wheel = build_wheel(source, tmp_path)
    assert wheel.name.startswith(f"harvey_board-{blackboard.__version__}-")
    assert "blackboard/py.typed" in zipfile.ZipFile(wheel).namelist()
    python = tmp_path / "venv" / "bin" / "python"
    install_elsewhere(tmp_path / "venv", wheel, with_needs=False)
    shutil.rmtree(source)
    readme = (ROOT / "blackboard/README.md").read_text(encoding="utf-8")
    hello, said, larger = re.findall(r"```(?:python)?\n(.*?)```", readme, re.DOTALL)[:3]
    assert sum(bool(line.strip()) for line in hello.splitlines()) == 9, "eight lines below the import"
    assert run_program(python, tmp_path / "hello.py", hello) == said
    assert larger.count("@rule") == 3
    told = run_program(python, tmp_path / "larger.py", larger)
    assert "Answer-1.0: Answer(text='yes, shut it') (by phone, cycle 2)\n" in told
    assert '"phone" -> "closer" [label="Answer x 1"]\n' in told and told.endswith("}\nNone\n")


def run_program(python: Path, file: Path, text: str) -> str:
    file.write_text(text, encoding="utf-8")
    return subprocess.run([python, file.name], cwd=file.parent, capture_output=True, text=True, check=True,
                          timeout=60).stdout
