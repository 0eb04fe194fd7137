"""``harvey completion``: what a shell completes is what the parsers know."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from experiments import list_names
from harvey.cli import main
from harvey.commands import MODULES, find_added_commands
from sim.scenario_names import find_scenarios

COMPLETE = """
source "$1"; shift
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMP_LINE="$*"; COMP_POINT=${#COMP_LINE}
_shtab_harvey harvey "${@: -1}"
printf '%s\\n' "${COMPREPLY[@]}"
"""
"""What bash does when Tab is pressed behind these words."""


@pytest.fixture
def script(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    assert main(["completion", "bash"]) == 0
    (tmp_path / "harvey.bash").write_text(capsys.readouterr().out, encoding="utf-8")
    return tmp_path / "harvey.bash"


@pytest.mark.skipif(shutil.which("bash") is None, reason="expected bash, got none")
@pytest.mark.parametrize(("words", "expected"), [
    ([""], {*MODULES, *(command.name for command in find_added_commands())}),
    (["run", ""], {*find_scenarios(), "mine.toml"}),
    (["run", "hallway"], {"hallway-kidnap"}),
    (["experiment", ""], {*list_names(), "mine.toml"}),
    (["why", ""], {"mine.toml"}),
    (["world", ""], {"new", "edit", "check", "show", "compile", "import", "export", "ledger"}),
    (["world", "show", "--o"], {"--out"}),
    (["run", "bump", "--see"], {"--seed"}),
    (["completion", ""], {"bash", "zsh"}),
])
def test_bash_completes(script: Path, tmp_path: Path, words: list[str], expected: set[str]) -> None:
    here = tmp_path / "here"
    here.mkdir()
    (here / "mine.toml").touch()
    done = subprocess.run(["bash", "-c", COMPLETE, "bash", script, "harvey", *words], cwd=here, capture_output=True,
                          text=True, check=True)
    assert set(done.stdout.split()) - {"-h", "--help", "--version"} == expected


@pytest.mark.skipif(shutil.which("zsh") is None, reason="expected zsh, got none")
def test_zsh_reads_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "zsh"]) == 0
    (tmp_path / "_harvey").write_text(capsys.readouterr().out, encoding="utf-8")
    subprocess.run(["zsh", "-n", tmp_path / "_harvey"], check=True)


def test_zsh_knows_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "zsh"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("#compdef harvey")
    assert [name for name in MODULES if f"{name}:'" not in said] == []


def test_another_shell_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "fish"]) == 2
    assert "invalid choice: 'fish'" in capsys.readouterr().err
