"""What the documents show can be used as shown: commands with their options, TOML examples, files, pictures."""

from __future__ import annotations

import re
import shlex
import tomllib
from dataclasses import fields
from pathlib import Path

import pytest

from docs.tools.fill import MARKED
from harvey.cli import parser
from sim.scenario import load_scenario, parse_scenario
from world_models import plugins
from world_models.building.checks import check_world
from world_models.files.toml.mission import Telling
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world

ROOT = Path(__file__).parents[3]
DOCUMENTS = ("README.md", "ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md", "tests/README.md",
             *sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md")))
ROOMS = ("blackboard", "world_models", "knowledge_sources", "sim", "logs", "harvey", "experiments")
NOT_OF_ONE_FOLDER = ("__init__.py",)
"""Named as what any folder has."""
MOST_BYTES = 400_000
SHEET_BYTES = 1_500_000
"""Of a sheet of ten pictures."""
ARCHITECTURE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
HOW_TO = ROOT / "docs" / "how-to"
COMMAND = re.compile(r"^(?:\.venv/bin/)?harvey ([^#\n]+)|`harvey ([^`]+)`", re.MULTILINE)


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_command_is_understood_with_all_its_options(document: str) -> None:
    text = MARKED.sub("", (ROOT / document).read_text(encoding="utf-8"))
    shown = [line or " ".join(inline.split()) for line, inline in COMMAND.findall(text)]
    assert [name for name in shown if " " not in name and name not in parser().format_help()] == []
    shown = [line for line in shown if " " in line and "--help" not in line]
    parsed = [(line, *parser().parse_known_args(shlex.split(line))) for line in shown]
    assert [(line, unknown) for line, args, unknown in parsed if unknown and not args.open_ended] == []


def test_every_toml_example_is_a_scenario_or_a_world_without_faults() -> None:
    text = (ROOT / "docs/missions.md").read_text(encoding="utf-8")
    examples = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    scenarios = [text for text in examples if "goal" in tomllib.loads(text)]
    worlds = [text for text in examples if text not in scenarios]
    assert scenarios
    assert worlds
    assert all(parse_scenario(text).world.is_file() for text in scenarios)
    assert [fault for text in worlds for fault in check_world(read_world(Source.parse(text, "missions.md"), []))] == []


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_file_that_is_named_is_there(document: str) -> None:
    """Relative to the repository, or to the document's own folder; runs and what a reader makes are not checked."""
    text = (ROOT / document).read_text(encoding="utf-8")
    named = re.findall(r"`([\w.-]+(?:/[\w.-]+)*/?(?:\.py|\.toml|\.md|\.svg|/))`", text)
    folders = (ROOT, (ROOT / document).parent)
    made = {*NOT_OF_ONE_FOLDER, *re.findall(r"(?:--out |:caption: )(\S+)", text)}
    shipped = [name for name in named if not name.startswith("runs/") and name not in made]
    assert [name for name in shipped if not any((folder / name).exists() for folder in folders)] == []


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_module_that_is_run_is_there(document: str) -> None:
    text = (ROOT / document).read_text(encoding="utf-8")
    modules, rooms = re.findall(r"python -m ([\w.]+)", text), (ROOT, *ROOT.glob("extras/*"))
    files = {name: f"{name.replace('.', '/')}.py" for name in modules}
    assert [name for name, file in files.items() if not any((room / file).exists() for room in rooms)] == []


def test_architecture_names_every_folder_of_two_levels() -> None:
    """What a newcomer sees with ``ls`` is in the table, each with its question."""
    folders = {f"{path.parent.relative_to(ROOT)}/" for room in ROOMS for path in (ROOT / room).glob("*/__init__.py")}
    missing = [name for name in sorted(folders | {f"{room}/" for room in (*ROOMS, "examples", "tests", "docs")})
               if f"`{name}`" not in ARCHITECTURE]
    assert missing == []


def test_the_example_of_a_knowledge_source_is_the_one_in_the_package() -> None:
    example = (ROOT / "examples/plugin/harvey_timekeeper/timekeeper.py").read_text(encoding="utf-8")
    recipe = (HOW_TO / "knowledge-source.md").read_text(encoding="utf-8")
    shown = re.findall(r"```python\n(.*?)```", recipe, re.DOTALL)
    assert shown
    lines = [line for text in shown for line in text.splitlines() if "RunningShort.\"" not in line]
    assert [line for line in lines if line.strip(' "') not in example] == []


def test_the_example_of_locale_frames_is_the_one_that_is_run() -> None:
    text = (ROOT / "docs/locale-frames.md").read_text(encoding="utf-8")
    example = (ROOT / "examples/revise_a_frame.py").read_text(encoding="utf-8")
    shown = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert shown
    assert [one for one in shown if one not in example] == []


def test_what_is_told_in_the_document_of_locale_frames_is_told() -> None:
    text = (ROOT / "docs/locale-frames.md").read_text(encoding="utf-8")
    told, = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    mission = parse_scenario(f'world = "two_ways"\ngoal = "(ptrans (reception (9,8,0)) (archive (9,6,0)))"\n{told}')
    assert mission.told == load_scenario("shut-door").told
    assert {field.name for field in fields(Telling)} == {*tomllib.loads(told)["told"][0], "goal", "task"}
    assert "`goal = " in text


def test_entry_points_are_those_of_the_plugins_table() -> None:
    groups = set(re.findall(r"``(harvey\.\w+)``", plugins.__doc__ or ""))
    packages = [ROOT / "examples/plugin/pyproject.toml", *(ROOT / "extras").glob("*/pyproject.toml")]
    projects = [tomllib.loads(path.read_text(encoding="utf-8"))["project"] for path in packages]
    assert groups == {group for project in projects for group in project.get("entry-points", ())}
    recipes = (HOW_TO / "README.md").read_text(encoding="utf-8")
    assert [group for group in sorted(groups) if f"`{group}`" not in recipes] == []


def test_pictures_are_small() -> None:
    endings = (".png", ".jpg", ".webp", ".svg")
    pictures = sorted(path for path in (ROOT / "docs").rglob("*") if path.suffix in endings)
    assert len(pictures) > 10
    assert [p.name for p in pictures if p.stat().st_size > (SHEET_BYTES if p.match("moments-*") else MOST_BYTES)] == []
