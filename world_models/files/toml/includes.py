"""Other files that a world file names: shared finishes and parts to include, and whole worlds to take a part from."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

from world_models.files.toml.source import Node, Source, WorldError

WORLDS = Path(__file__).parents[2] / "worlds"
"""Where the worlds that come with the project are kept, and in ``parts`` what they share."""
DEEPEST = 8


def included(root: Node) -> Iterator[Source]:
    """The files that ``include`` lists."""
    if "include" not in root:
        return
    for item in root["include"].items():
        source = named_file(item, WORLDS / "parts")
        if source.depth > DEEPEST:
            raise item.fail("a file that does not include itself")
        yield source


def named_file(node: Node, shipped: Path = WORLDS) -> Source:
    """A file that comes with the project, by its bare name, or any .toml file, relative to the one that names it."""
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


def files_of(source: Source) -> Iterator[Source]:
    """A world file and all that it is made of, each once for each time that it is named."""
    yield source
    root = source.root
    if not isinstance(root.value, dict) or source.depth > DEEPEST:
        return
    if isinstance(root.value.get("include"), list):
        for other in included(root):
            yield from files_of(other)
    locales = root.value.get("locales")
    for name, value in locales.items() if isinstance(locales, dict) else ():
        if isinstance(value, dict) and "from" in value:
            yield from files_of(named_file(root["locales"][name]["from"]))


def compute_digest(path: Path) -> str:
    """SHA-256 of a world file, and of what it is made of where there is such. Raises OSError or WorldError."""
    own = path.read_bytes()
    try:
        others = list(files_of(Source.read(path)))[1:]
    except WorldError:
        others = []
    if not others:
        return hashlib.sha256(own).hexdigest()
    return hashlib.sha256(b"".join([own, *(other.text.encode() for other in others)])).hexdigest()
