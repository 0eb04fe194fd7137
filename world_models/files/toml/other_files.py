"""What a world file takes from others: those that it includes, and parts of worlds that it copies.

A floor that is built twice is described once.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from world_models.building.geometry.faces import Finish
from world_models.files.construction.specs import LocaleSpec, RoomFinishes, ThingSpec, WorldSpec
from world_models.files.regular_files import read_regular
from world_models.files.toml.source import WORLDS, Node, Source, WorldError
from world_models.frames import Pose

MAX_DEPTH = 8
"""Longest chain of files that name each other."""
MOST_NAMED = 5_000
"""So often may files name others, all together: ten that each name the next ten times would be read 10**10 times."""


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
    count = node.source.count
    count[0] += 1
    if count[0] > MOST_NAMED:
        raise node.fail(f"at most {MOST_NAMED} times that a file names another, all together")
    bare = name.endswith(".toml") or name in [known.stem for known in shipped.glob("*.toml")]
    try:
        if bare and "\0" not in name and path.is_file():
            return replace(Source.read(path, depth=node.source.depth + 1), count=count)
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
    own = read_regular(path)
    try:
        others = list(find_all_files(Source.read(path)))[1:]
    except WorldError:
        others = []
    if not others:
        return hashlib.sha256(own).hexdigest()
    return hashlib.sha256(b"".join([own, *(other.text.encode() for other in others)])).hexdigest()


COPY_KEYS = ("from", "of", "prefix", "without", "kind", "in", "at", "turn", "properties", "add")
"""Keys of a locale that is copied from another file."""


def extract_subtree(world: WorldSpec, node: Node) -> WorldSpec:
    """The part of a world within its locale ``of`` (by default all of it), less what ``without`` lists.

    That locale becomes the root.
    """
    root = world.name
    if "of" in node:
        root = node["of"].choice(*world.locales)
    inside = dict(_within(world.locales, root))
    doors = [door for door in world.doors if set(door.between) <= set(inside)]
    things = [thing for thing in world.things if thing.locale in inside]
    links = [link for link in world.links if set(link.between) <= set(inside)]
    part = WorldSpec(root, world.source, inside, tuple(doors), tuple(things), tuple(links))
    return _remove_listed(part, node["without"]) if "without" in node else part


def rename_locales(part: WorldSpec, root: str, prefix: str) -> WorldSpec:
    """The same part with a new name for its root, and a prefix before the names of other locales, doors and links."""
    names = {name: root if name == part.name else prefix + name for name in part.locales}
    names[part.name] = root
    top = LocaleSpec(root, "building", "", Pose.identity(), None, (), 2.7, _NO_FINISHES, {}, part.source)
    locales = {root: top} if part.name not in part.locales else {}
    for name, spec in part.locales.items():
        locales[names[name]] = replace(spec, name=names[name], parent=names.get(spec.parent, ""))
    return WorldSpec(
        root, part.source, locales,
        tuple(replace(d, name=prefix + d.name, between=tuple(names[n] for n in d.between)) for d in part.doors),
        tuple(replace(t, locale=names[t.locale]) for t in part.things),
        tuple(replace(k, name=prefix + k.name, between=(names[k.between[0]], names[k.between[1]])) for k in part.links),
    )


_NO_FINISHES = RoomFinishes({}, Finish((0.5, 0.5, 0.5)), None, None, None)


def _within(locales: Mapping[str, LocaleSpec], root: str) -> Iterator[tuple[str, LocaleSpec]]:
    """A locale and all below it, in the order of the file."""
    for name, spec in locales.items():
        above: str | None = name
        while above is not None and above != root:
            above = locales[above].parent if above in locales else None
        if above == root:
            yield name, spec


def _remove_listed(part: WorldSpec, node: Node) -> WorldSpec:
    """The part without the listed locales, doors, links and things (as room/thing)."""
    for item in node.items():
        name = item.text()
        known = {*part.locales, *(d.name for d in part.doors), *(k.name for k in part.links),
                 *(_path_of(t) for t in part.things)} - {part.name}
        if name not in known:
            raise item.fail("a locale, door, link or thing (as room/thing) of that file")
        part = _remove(part, name)
    return part


def _remove(part: WorldSpec, name: str) -> WorldSpec:
    gone = {inside for inside, _ in _within(part.locales, name)} if name in part.locales else set()
    return replace(
        part,
        locales={known: spec for known, spec in part.locales.items() if known not in gone},
        doors=tuple(d for d in part.doors if d.name != name and not gone & set(d.between)),
        links=tuple(k for k in part.links if k.name != name and not gone & set(k.between)),
        things=tuple(t for t in part.things if _path_of(t) != name and t.locale not in gone),
    )


def _path_of(thing: ThingSpec) -> str:
    return f"{thing.locale}/{thing.name}"
