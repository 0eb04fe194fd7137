"""Deciding code: a name for the program that decides, so that a run can say by which one it was decided.

The version stays the same while a program is worked on; what the files say does not. Counted are the mechanism, the
beliefs and the experts, and who of them sits round the board: a run is its observations and what these make of them.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

PACKAGES, WIRING = ("blackboard", "world_models", "knowledge_sources"), "harvey/wiring.py"
"""The packages and the file that decide."""

DIGITS = 16


@cache
def deciding_code() -> str:
    """The first digits of a SHA-256 of what decides; it takes some milliseconds, once a process."""
    return code_in(Path(__file__).parents[1])


def code_in(root: Path) -> str:
    """The same of a program elsewhere. Raises OSError."""
    return digest_of(root, [WIRING, *files_in(root, PACKAGES, (".py",))])


def digest_of(root: Path, names: Iterable[str]) -> str:
    """Of files' names and contents, in the order of their names and whatever the line ends. Raises OSError."""
    said = hashlib.sha256()
    for name in sorted(names):
        with open(f"{root}/{name}", "rb") as file:
            text = file.read().replace(b"\r\n", b"\n")
        said.update(f"{name} {len(text)}\n".encode() + text)
    return said.hexdigest()[:DIGITS]


def files_in(root: Path, packages: Iterable[str], endings: tuple[str, ...]) -> Iterator[str]:
    """Names relative to the root, with slashes on any system."""
    for package in packages:
        for folder, _, names in os.walk(f"{root}/{package}"):
            inside = folder[len(str(root)) + 1 :].replace(os.sep, "/")
            yield from (f"{inside}/{name}" for name in names if name.endswith(endings))
