"""Packages: Harvey's are six of the top level; another package of the same name must not hide one of them."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

MARKS: Mapping[str, str] = {
    "blackboard": "scheduler", "world_models": "robot", "knowledge_sources": "priority", "sim": "stage",
    "logs": "journal_file",
}
"""Each package that harvey imports, and a module by which it is recognized."""


def check_packages() -> None:
    """Raises ImportError where another package is found in place of one of ours; names its folder."""
    for name, module in MARKS.items():
        spec = find_spec(name)
        folders = list(spec.submodule_search_locations or ()) if spec is not None else []
        if not any(path for folder in folders for path in Path(folder).glob(f"{module}.*")):
            there = next(iter(folders), spec.origin if spec is not None else None)
            raise ImportError(
                _describe_conflict(name, there) if there else f"harvey: expected its package {name!r}, got none")


def _describe_conflict(name: str, there: str) -> str:
    return (f"harvey: its package {name!r} is hidden by {there}, which Python finds first; rename that one, or start "
            "Python in another folder")
