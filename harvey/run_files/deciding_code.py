"""Deciding code: a name for the program that decides, so that a run can say by which one it was decided.

The version stays the same while a program is worked on; what the files say does not. Counted are the mechanism, the
models and the knowledge sources, and the wiring that chooses them: a run is its observations and what these do
with them.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import blackboard

DECIDING: Mapping[str, tuple[str, ...]] = {
    "blackboard": (".py",), "world_models": (".py",), "knowledge_sources": (".py", ".toml"),
}
"""The packages that decide, with the endings of their files; a run names its world's bytes itself."""
WIRING = "harvey/wiring.py"
"""The file that lists the knowledge sources."""

DIGITS = 16


@cache
def deciding_code() -> str:
    """The first digits of a SHA-256 of what decides; it takes some milliseconds, once a process."""
    return read_code_in(Path(__file__).parents[2], Path(blackboard.__file__).parents[1])


def read_code_in(root: Path, board: Path | None = None) -> str:
    """The same of a program elsewhere, whose board may be somewhere else again. Raises OSError."""
    files = {WIRING: f"{root}/{WIRING}"}
    for package, endings in DECIDING.items():
        files |= files_in(board if board and package == "blackboard" else root, package, endings)
    return digest_of(files)


def digest_of(files: Mapping[str, str]) -> str:
    """Of files' names and contents, in the order of their names and whatever the line ends. Raises OSError."""
    said = hashlib.sha256()
    for name, path in sorted(files.items()):
        with open(path, "rb") as file:
            text = file.read().replace(b"\r\n", b"\n")
        said.update(f"{name} {len(text)}\n".encode() + text)
    return said.hexdigest()[:DIGITS]


def files_in(root: Path, package: str, endings: tuple[str, ...]) -> dict[str, str]:
    """Where they are, by their names relative to the root, with slashes on any system."""
    paths = [f"{folder}/{name}" for folder, _, names in os.walk(f"{root}/{package}") for name in names]
    return {path[len(str(root)) + 1 :].replace(os.sep, "/"): path for path in paths if path.endswith(endings)}
