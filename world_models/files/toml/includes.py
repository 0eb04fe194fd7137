"""Files that a world file names: shared finishes and parts to include, and worlds to copy a part from."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

from world_models.files.toml.source import Node, Source, WorldError

WORLDS = Path(__file__).parents[2] / "worlds"
"""Folder of the worlds that come with the project; ``parts`` in it holds what they share."""
MAX_DEPTH = 8
"""Longest chain of files that name each other."""


def read_included(root: Node) -> Iterator[Source]:
    """The files that ``include`` lists. Raises WorldError."""
    if "include" not in root:
        return
    for item in root["include"].items():
        source = find_named_file(item, WORLDS / "parts")
        if source.depth > MAX_DEPTH:
            raise item.fail("a file that does not include itself")
        yield source


def find_named_file(node: Node, shipped: Path = WORLDS) -> Source:
    """A file that comes with the project, by its bare name, or a .toml file relative to the file that names it.

    Raises:
        WorldError: there is no such file.
    """
    name = node.text()
    path = node.source.folder / name if name.endswith(".toml") else shipped / f"{name}.toml"
    bare = name.endswith(".toml") or name in [known.stem for known in shipped.glob("*.toml")]
    try:
        if bare and "\0" not in name and path.is_file():
            return Source.read(path, depth=node.source.depth + 1)
    except OSError:
        pass
    names = ", ".join(sorted(known.stem for known in shipped.glob("*.toml")))
    raise node.fail(f"a .toml file that is there, or one of {names}")


def find_all_files(source: Source) -> Iterator[Source]:
    """A world file and all that it includes or copies from, once for each time that it is named."""
    yield source
    root = source.root
    if not isinstance(root.value, dict) or source.depth > MAX_DEPTH:
        return
    if isinstance(root.value.get("include"), list):
        for other in read_included(root):
            yield from find_all_files(other)
    if isinstance(root.value.get("locales"), dict):
        for _, node in root["locales"].entries():
            if isinstance(node.value, dict) and "from" in node:
                yield from find_all_files(find_named_file(node["from"]))


def compute_digest(path: Path) -> str:
    """SHA-256 of a world file with all that it includes or copies from. Raises OSError or WorldError."""
    own = path.read_bytes()
    try:
        others = list(find_all_files(Source.read(path)))[1:]
    except WorldError:
        others = []
    if not others:
        return hashlib.sha256(own).hexdigest()
    return hashlib.sha256(b"".join([own, *(other.text.encode() for other in others)])).hexdigest()
