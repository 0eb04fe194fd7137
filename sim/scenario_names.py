"""Which scenarios come with the project, known without reading what they are made of."""

from __future__ import annotations

import tomllib
from pathlib import Path

SCENARIOS = Path(__file__).resolve().parent / "scenarios"


def list_scenarios() -> tuple[str, ...]:
    """The names of the scenarios that come with the project."""
    return tuple(sorted(path.stem for path in SCENARIOS.glob("*.toml")))


def describe_scenario(name: str) -> str:
    """The description of one of them, from its file; "" where it has none."""
    return str(tomllib.loads((SCENARIOS / f"{name}.toml").read_text(encoding="utf-8")).get("description", ""))
