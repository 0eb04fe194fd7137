"""Origin: by which program and arithmetic results were found; others' are not mixed with them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from logs.decided_by import arithmetic, digest_of, files_in

PACKAGES = ("blackboard", "world_models", "knowledge_sources", "sim", "logs", "harvey")


def origin() -> dict[str, str]:
    """Code and processor that compute the results."""
    return {"code": code_digest(), "arithmetic": arithmetic()}


@cache
def code_digest() -> str:
    """Digest of the code that results follow from."""
    root = Path(__file__).resolve().parents[2]
    files = [files_in(root, package, (".py", ".toml")) for package in PACKAGES]
    return digest_of({name: path for package in files for name, path in package.items()})
