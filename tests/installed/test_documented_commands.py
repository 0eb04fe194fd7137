"""Every command of the documents is run as it stands there; the tutorials and the questions have tests of their own.

What needs hardware, a window, the network or hours is parsed only (``unit/house``); each such command has its reason
here. Where a command names a run, that is driven first; where it names a file of the reader's, one is made by another
command. Many seeds are made few.
"""

from __future__ import annotations

import os
import re
import select
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from docs.tools.fill import MARKED
from elsewhere import ROOT
from harvey.runner.result import UNFINISHED

TOLD_ELSEWHERE = ("tutorials", "faq.md", "course")
"""Documents whose commands other tests of this folder run."""
DOCUMENTS = sorted(path for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("extras/*/*.md"))
                   if not any(part in path.parts for part in TOLD_ELSEWHERE))
BLOCK = re.compile(r"^```(?:console|sh)?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NOT_RUN = {
    r"harvey experiment (?!figure12)(?!.*--quick)": "minutes to hours",
    r"--cluster|campaign worker": "other machines; the tests of harvey-cluster start a cluster here",
    r"harvey drive mission.toml(?!.*--dry-run)|--base create2:/dev|harvey calibrate|open_base": "a robot or a camera",
    r"docs.tools.(contact_sheet|look|pictures)": "a viewer with a graphics driver, or minutes",
    r"^(\.venv/bin/)?pip install": "the environment, which the tests do not change",
    r"^(make|cd|cp) ": "a shell; the targets of make are looked for",
    r"\.(ifc|gml)\b": "a building by others; the tests of harvey-buildings make some",
    r"harvey follow (BAG|ros2:|drive.mp4|pictures)": "a robot, or a recording; the tests of harvey-ros2 make some",
    r"harvey tell runs/": "a run that goes on; the tests of what is told start one",
    r"traced_paths": "the path tracer",
    r"harvey explore |survey --(world|out)|runs/\*": "minutes; the tests of harvey-survey do it",
    r"harvey experiment (explore|people) ": "minutes; the tests of both packages drive missions of theirs",
    r"harvey serve runs/": "a run that another command is driving; the tests of harvey-serve drive one",
    r"--go-on": "a campaign that was cut off; the laws of campaigns cut many off",
}
ENDLESS = re.compile(r"harvey (serve|emulate)|--live$")
"""Goes on until Ctrl-C."""
FEW_SEEDS = "--seed 0..1"
FILES = {
    "map.yaml": "world export research_center --to map.yaml --resolution 0.1",
    "unit.geojson": "world export research_center --to unit.geojson",
    "campus.geojson": "world export campus --to campus.geojson",
    "second-floor.toml": "world new second-floor --rooms office,kitchen,lab",
}
"""Files of the reader's, and what makes them here."""
DAYS = ("monday", "tuesday", "wednesday")
"""Runs in the floor of the reader's."""
DAYS_MISSION = """world = "floor.toml"
goal = "Go from the office to the lab"
[start]
heading_deg = 270.0
"""
MAY_FAIL = r"servo.plan=off|rough-day|light.lamps_off|experiment|harvey diff"
"""A mission may end otherwise than reached, a claim of an experiment fail, two runs differ."""


def commands() -> Iterator[str]:
    """Every command that stands in a block of a document, without its comment."""
    for document in DOCUMENTS:
        text = MARKED.sub("", document.read_text(encoding="utf-8"))
        for line in "".join(BLOCK.findall(text)).splitlines():
            command = re.split(r"\s+# ", line.removeprefix("$ "))[0].strip()
            if re.match(r"(\.venv/bin/)?(harvey|python|pip|make|cd|cp) ", command):
                yield command


COMMANDS = sorted(set(commands()))
NEEDS = {command: reason for command in COMMANDS for words, reason in NOT_RUN.items() if re.search(words, command)}


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the reader works: a copy of the flat, and of the files that are named by their place in the project."""
    folder = tmp_path_factory.mktemp("reader")
    shutil.copytree(ROOT / "docs" / "flat", folder, dirs_exist_ok=True)
    for name in ("docs/flat", "world_models/worlds", "examples"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).symlink_to(ROOT / name)
    return folder


def start(command: str, here: Path) -> subprocess.Popen[str]:
    """The command as a process of its own, without a screen."""
    program, *words = shlex.split(command.removeprefix(".venv/bin/"))
    assert program in ("harvey", "python"), command
    module = ["-m", "harvey.cli"] if program == "harvey" else []
    without = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return subprocess.Popen([sys.executable, "-u", *module, *words], cwd=here, text=True, stdout=subprocess.PIPE,
                            stderr=subprocess.STDOUT, env={**without, "PYTHONPATH": str(ROOT)})


def run(command: str, here: Path) -> tuple[int, str]:
    """Its exit code and what it says."""
    process = start(command, here)
    said, _ = process.communicate(timeout=900)
    return process.returncode, said


def prepare(command: str, here: Path) -> None:
    """What the command names is there: runs, campaigns, files."""
    for name, made_by in FILES.items():
        if name in command and made_by not in command and not (here / name).exists():
            make(made_by, here)
    for folder in re.findall(r"(?<!--out )\bruns/[\w./-]+", command):
        if is_whole(here / folder):
            continue
        name, _, seed = folder.removeprefix("runs/").rpartition("-")
        if folder == "runs/cluttered":
            make("run cluttered-hallway --out runs/cluttered", here)
        elif seed.isdigit():
            make(f"run {name} --seed {seed}", here)
        elif seed in DAYS:
            if not (here / "floor.toml").exists():
                make("world new floor --rooms office,kitchen,lab", here)
                (here / "floor-mission.toml").write_text(DAYS_MISSION, encoding="utf-8")
            make(f"run floor-mission.toml --seed {DAYS.index(seed)} --out {folder}", here)
        elif folder in ("runs/before", "runs/after"):
            make(f"run forty-foot-hallway {FEW_SEEDS} --out {folder}", here)
        else:
            make(f"run {folder.removeprefix('runs/')} {FEW_SEEDS}", here)


def find_folder(command: str, here: Path) -> Path:
    """Where a command is run: those that survey by runs have a floor of their own, as importers write one too."""
    folder = here / "surveyed" if any(f"runs/{day}" in command for day in DAYS) else here
    folder.mkdir(exist_ok=True)
    return folder


def is_whole(folder: Path) -> bool:
    """Whether it is a run with its outcome, or a campaign."""
    result = folder / "result.json"
    return (folder / "results.jsonl").is_file() or (result.is_file() and UNFINISHED not in result.read_text("utf-8"))


def make(command: str, here: Path) -> None:
    """Run a command of harvey that another one needs."""
    code, said = run(f"harvey {command}", here)
    assert code == 0, said


def fewer(command: str) -> str:
    """The command with few seeds, for those that drive a thousand."""
    return re.sub(r"--seed 0\.\.\d+", FEW_SEEDS, command)


@pytest.mark.parametrize("command", [one for one in COMMANDS if one not in NEEDS and not ENDLESS.search(one)])
def test_a_command_runs(command: str, here: Path) -> None:
    here = find_folder(command, here)
    prepare(command, here)
    code, said = run(fewer(command), here)
    assert "Traceback" not in said and said.strip(), said
    if command.startswith("harvey view") and "--picture" not in command:
        assert code == 1 and "no screen here" in said, said
    elif "--dry-run" in command:
        assert code == 2 and "nothing was moved" in said, said  # there is no robot here
    elif re.search(MAY_FAIL, command):
        assert code in (0, 1), said
    else:
        assert code == 0, said


@pytest.mark.parametrize("command", [one for one in COMMANDS if one not in NEEDS and ENDLESS.search(one)])
def test_a_command_that_goes_on_says_where_it_is_and_ends_at_ctrl_c(command: str, here: Path) -> None:
    prepare(command, here)
    process = start(command, here)
    try:
        said = read_until(process, r"http://|/dev/pts|tcp/|\.html")
        process.send_signal(signal.SIGINT)
        more, _ = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode in (0, 130) and "Traceback" not in said + more, said + more


def read_until(process: subprocess.Popen[str], words: str, most_s: float = 300.0) -> str:
    """What it says up to some words."""
    assert process.stdout is not None
    said, until_s = "", time.monotonic() + most_s
    while not re.search(words, said):
        assert process.poll() is None and time.monotonic() < until_s, said
        if select.select([process.stdout], [], [], 1.0)[0]:
            said += process.stdout.readline()
    return said


def test_most_commands_are_run() -> None:
    assert len(COMMANDS) > 100
    assert len(NEEDS) < 0.4 * len(COMMANDS)
    assert [words for words in NOT_RUN if not any(re.search(words, command) for command in COMMANDS)] == []


def test_the_targets_of_make_are_there() -> None:
    rules = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    shown = {command.split()[1] for command in COMMANDS if command.startswith("make ")}
    assert shown and shown <= set(rules)
