"""What the documents show can be used as shown: commands with their options, TOML examples, files, pictures."""

from __future__ import annotations

import re
import shlex
import tomllib
from pathlib import Path

import pytest

from harvey.cli import parser
from sim.scenario import parse_scenario
from world_models.building.checks import check_world
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world

ROOT = Path(__file__).parents[3]
FOLDERS = (ROOT, ROOT / "knowledge_sources", ROOT / "world_models")
"""Where a file may be that a table names after another one of the same folder."""
MOST_BYTES = 400_000
SHEET_BYTES = 1_500_000
"""Of a sheet of ten pictures."""
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMAND = re.compile(r"^(?:\.venv/bin/)?harvey ([^#\n]+)|`harvey ([^`]+)`", re.MULTILINE)


def test_every_command_is_understood_with_all_its_options() -> None:
    shown = [line or inline for line, inline in COMMAND.findall(README)]
    parsed = [(line, *parser().parse_known_args(shlex.split(line))) for line in shown]
    assert len(shown) >= 12
    assert [(line, unknown) for line, args, unknown in parsed if unknown and not args.command.open_ended] == []


def test_every_toml_example_is_a_scenario_or_a_world_without_faults() -> None:
    examples = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    scenarios = [text for text in examples if "goal" in tomllib.loads(text)]
    worlds = [text for text in examples if text not in scenarios]
    assert scenarios
    assert worlds
    assert all(parse_scenario(text).world.is_file() for text in scenarios)
    assert [fault for text in worlds for fault in check_world(read_world(Source.parse(text, "README.md"), []))] == []


@pytest.mark.parametrize("document", ["README.md", "ARCHITECTURE.md"])
def test_every_file_that_is_named_is_there(document: str) -> None:
    text = (ROOT / document).read_text(encoding="utf-8")
    named = re.findall(r"`([a-z_]+(?:/[\w.-]+)*/?(?:\.py|\.toml|\.md|/))`", text)
    assert named
    assert [name for name in named if not any((folder / name).exists() for folder in FOLDERS)] == []


def test_pictures_are_small() -> None:
    pictures = sorted((ROOT / "docs").iterdir())
    assert pictures
    assert [p.name for p in pictures if p.stat().st_size > (SHEET_BYTES if p.match("moments-*") else MOST_BYTES)] == []
