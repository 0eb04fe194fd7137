"""The tutorials can be followed: their files are written, and their commands run, in order, as a reader would.

A command whose line ends with a comment needs what the reader has (hardware, a file of his own, minutes): it is parsed.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from elsewhere import ROOT
from harvey.cli import parser

FAQ = ROOT / "docs" / "background" / "faq.md"
ASKED = re.compile(r"^```console\n\$ (harvey [^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PAGES = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
FILE = re.compile(r"^```\{code-block\} \w+\n:caption: (\S+)\n\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PLUGIN = "pip install ./examples/plugin"


def blocks_of(page: Path) -> list[tuple[str, str]]:
    """Language and text of each block that is not a file."""
    return BLOCK.findall(FILE.sub("", page.read_text(encoding="utf-8")))


def write_files(here: Path) -> Path:
    """The files of all pages, in an empty folder."""
    for page in PAGES:
        for name, text in FILE.findall(page.read_text(encoding="utf-8")):
            assert not (here / name).exists(), f"{name} is given twice"
            (here / name).write_text(text, encoding="utf-8")
    return here


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the reader works, from page to page."""
    here = write_files(tmp_path_factory.mktemp("reader"))
    (here / "docs").symlink_to(ROOT / "docs")
    return here


def run_line(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    if line == PLUGIN:
        package = ROOT / "examples" / "plugin"
        line = f"python -m pip install --quiet --no-deps --no-build-isolation --target site {package}"
    elif line.startswith("harvey "):
        line = f"python -m harvey.cli {line.removeprefix('harvey ')}"
    program, *words = shlex.split(line)
    assert program == "python", f"expected a command of harvey, python, or {PLUGIN}, got {line}"
    path = os.pathsep.join(map(str, (ROOT, folder / "site")))
    return subprocess.run([sys.executable, *words], cwd=folder, env={**os.environ, "PYTHONPATH": path},
                          capture_output=True, text=True, timeout=900)


def follow(line: str, folder: Path) -> None:
    done = run_line(line, folder)
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
    assert done.stdout or line.startswith(("python photograph.py", PLUGIN)), f"{line} says nothing"


@pytest.mark.parametrize(("page", "says"), [("README.md", r"reached, \d.*refuted.*the same decisions again: True"),
                                            ("docs/start.md", r"reached 0\.0")])
def test_the_python_of_a_first_page_runs(page: str, says: str, tmp_path: Path) -> None:
    blocks = [text for language, text in blocks_of(ROOT / page) if language == "python"]
    assert blocks
    (tmp_path / "start.py").write_text("\n".join(blocks), encoding="utf-8")
    done = run_line("python start.py", tmp_path)
    assert done.returncode == 0 and re.match(says, done.stdout, re.DOTALL), done.stdout + done.stderr


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_tutorial_can_be_followed(page: Path, folder: Path) -> None:
    commands = [line for _, block in blocks_of(page) for line in block.splitlines()]
    assert commands
    for line in commands:
        command, _, needs = line.partition("  #")
        if needs:
            assert parser().parse_args(shlex.split(command)[1:]), line
        else:
            follow(line, folder)


def test_an_entry_of_a_kind_of_ones_own_is_told_by_its_own_sentence(tmp_path: Path) -> None:
    done = run_line("python count_milestones.py", write_files(tmp_path))
    assert "Milestones verified so far: " in done.stdout and "[Progress-1." in done.stdout


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_tutorial_has_no_block_of_another_kind(page: Path) -> None:
    """Every block is a file or commands, so that none is left out above."""
    assert {language for language, _ in blocks_of(page)} == {""}


def test_the_errors_of_the_questions_are_what_is_printed(tmp_path: Path) -> None:
    """The reader has the files of the tutorials, with the mistakes that the names tell, and no run yet."""
    folder = write_files(tmp_path)
    cottage, mission = ((folder / name).read_text(encoding="utf-8") for name in ("cottage.toml", "to-the-parlour.toml"))
    (folder / "wide.toml").write_text(cottage.replace("along = 1.8, open", "along = 9.0, open"), encoding="utf-8")
    (folder / "typo.toml").write_text(mission.replace("heading_deg", "heading"), encoding="utf-8")
    (folder / "broken.toml").write_text("broken = [\n", encoding="utf-8")
    (folder / "empty").mkdir()
    asked = ASKED.findall(FAQ.read_text(encoding="utf-8"))
    assert len(asked) > 10
    for line, said in asked:
        done = run_line(line, folder)
        printed = [one for one in (done.stdout + done.stderr).splitlines() if not one.endswith("setting the stage")]
        assert (printed, done.returncode) == (said.splitlines(), 2), line
