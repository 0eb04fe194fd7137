"""Which scenarios come with the project, known without reading what they are made of."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path

from world_models.plugins import load_plugins

SCENARIOS = Path(__file__).resolve().parent / "scenarios"


def list_scenarios() -> tuple[str, ...]:
    """The names of the scenarios that come with the project."""
    return tuple(sorted(path.stem for path in SCENARIOS.glob("*.toml")))


def find_scenarios() -> Mapping[str, Path]:
    """The files of these and of those that installed packages add, by name in order; the project's own name wins."""
    folders = [*load_plugins("harvey.scenarios", Path).values(), SCENARIOS]
    return dict(sorted({path.stem: path for folder in folders for path in folder.glob("*.toml")}.items()))


def describe_scenario(path: Path) -> str:
    """The description of one of them, from its file; "" where it has none."""
    return str(tomllib.loads(path.read_text(encoding="utf-8")).get("description", ""))
