"""The core has one budget of lines, which only falls: what is added has to make room for itself.

The numbers are the owner's, in ``../shared/budgets.toml``; where that is absent, those of the copy beside this file
hold. One room of the core may lend lines to another; the sum of the core may not grow. What is new and not the paper's
system is a package outside the core.
"""

from __future__ import annotations

import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[3]
COPY = Path(__file__).with_name("budgets.toml")
OWNERS = ROOT.parent / "shared" / "budgets.toml"


def read(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))


BUDGETS = read(OWNERS if OWNERS.exists() else COPY)
CORE = BUDGETS["core"]
BESIDE: dict[str, int] = {**{part: lines for part, lines in read(COPY)["beside"].items() if "/" in part},
                          **BUDGETS["beside"]}
"""Parts of a room have their ceilings from the owner, or else from their stage's issue: then the copy says it."""
OWN_CEILING = [room for room in BESIDE if "/" in room]


def list_python(*rooms: str) -> dict[Path, int]:
    """Lines of each tracked Python file of these rooms."""
    listed = subprocess.run(["git", "ls-files", *rooms], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("expected a git checkout, to know which files are the project's")
    paths = [ROOT / name for name in listed.stdout.splitlines() if name.endswith(".py")]
    return {path: path.read_bytes().count(b"\n") for path in paths if path.exists()}


def test_the_core_keeps_to_its_budget() -> None:
    lines = list_python(*CORE["rooms"])
    assert lines
    assert sum(lines.values()) <= CORE["lines"]
    assert len(lines) <= CORE["files"]


@pytest.mark.parametrize("room", sorted(BESIDE))
def test_what_stands_beside_the_core_keeps_to_its_budget(room: str) -> None:
    lines = list_python(room)
    parts = [ROOT / own for own in OWN_CEILING if own != room]
    counted = {path: count for path, count in lines.items() if not any(part in path.parents for part in parts)}
    assert sum(counted.values()) <= BESIDE[room]


@pytest.mark.parametrize("document", sorted(BUDGETS["bytes"]))
def test_a_document_is_short(document: str) -> None:
    assert len((ROOT / document).read_bytes()) <= BUDGETS["bytes"][document]


@pytest.mark.parametrize("document", sorted(BUDGETS["words"]))
def test_a_document_has_few_words(document: str) -> None:
    assert len((ROOT / document).read_text(encoding="utf-8").split()) <= BUDGETS["words"][document]


def test_the_copy_allows_no_more_than_the_owner() -> None:
    if not OWNERS.exists():
        pytest.skip("../shared/budgets.toml is absent: the copy stands alone")
    owners, copy = read(OWNERS), read(COPY)
    for part in ("core", "beside", "bytes", "words"):
        limits = {key: limit for key, limit in owners[part].items() if isinstance(limit, int)}
        assert {key: copy[part][key] for key in limits if copy[part].get(key, 0) > limits[key]} == {}
        assert {key for key in copy[part] if "/" not in key or key in owners[part]} == set(owners[part])
