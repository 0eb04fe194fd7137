"""A part of one world file in another: a floor that is built twice is written once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from dataclasses import replace

from world_models.building.regions import Finish
from world_models.files.construction.blueprint import Blueprint, LocaleSpec, RoomLook, ThingSpec
from world_models.files.toml.source import Node
from world_models.frames import Pose

COPY_KEYS = ("from", "of", "prefix", "without", "kind", "in", "at", "turn", "properties", "add")
"""What may be said of a locale that is taken from another file."""


def subtree(whole: Blueprint, node: Node) -> Blueprint:
    """What a file has within the locale ``of`` (all of it, where none is said), ``without`` some of it; that locale is
    the blueprint's root."""
    root = whole.name
    if "of" in node:
        root = node["of"].choice(*whole.locales)
    inside = dict(_within(whole.locales, root))
    doors = [door for door in whole.doors if set(door.between) <= set(inside)]
    things = [thing for thing in whole.things if thing.locale in inside]
    links = [link for link in whole.links if set(link.between) <= set(inside)]
    left = Blueprint(root, whole.source, inside, tuple(doors), tuple(things), tuple(links))
    return _lacking(left, node["without"]) if "without" in node else left


def renamed(part: Blueprint, root: str, prefix: str) -> Blueprint:
    """The same with its root named anew, and a prefix before the name of every other locale, door and link."""
    names = {name: root if name == part.name else prefix + name for name in part.locales}
    names[part.name] = root
    top = LocaleSpec(root, "building", "", Pose.identity(), None, (), 2.7, _NO_LOOK, {}, part.source)
    locales = {root: top} if part.name not in part.locales else {}
    for name, spec in part.locales.items():
        locales[names[name]] = replace(spec, name=names[name], parent=names.get(spec.parent, ""))
    return Blueprint(
        root, part.source, locales,
        tuple(replace(d, name=prefix + d.name, between=tuple(names[n] for n in d.between)) for d in part.doors),
        tuple(replace(t, locale=names[t.locale]) for t in part.things),
        tuple(replace(k, name=prefix + k.name, between=(names[k.between[0]], names[k.between[1]])) for k in part.links),
    )


_NO_LOOK = RoomLook({}, Finish((0.5, 0.5, 0.5)), None, None, None)


def _within(locales: Mapping[str, LocaleSpec], root: str) -> Iterator[tuple[str, LocaleSpec]]:
    """A locale and all below it, in the order of the file."""
    for name, spec in locales.items():
        above: str | None = name
        while above is not None and above != root:
            above = locales[above].parent if above in locales else None
        if above == root:
            yield name, spec


def _lacking(part: Blueprint, node: Node) -> Blueprint:
    """Without the locales, doors, links and things (as room/thing) that are listed."""
    for item in node.items():
        name = item.text()
        known = {*part.locales, *(d.name for d in part.doors), *(k.name for k in part.links),
                 *(f"{t.locale}/{t.name}" for t in part.things)} - {part.name}
        if name not in known:
            raise item.fail("a locale, door, link or thing (as room/thing) of that file")
        part = _without(part, name)
    return part


def _without(part: Blueprint, name: str) -> Blueprint:
    gone: Set[str] = {inside for inside, _ in _within(part.locales, name)} if name in part.locales else set()
    return replace(
        part,
        locales={known: spec for known, spec in part.locales.items() if known not in gone},
        doors=tuple(d for d in part.doors if d.name != name and not gone & set(d.between)),
        links=tuple(k for k in part.links if k.name != name and not gone & set(k.between)),
        things=tuple(t for t in part.things if not _is(t, name) and t.locale not in gone),
    )


def _is(thing: ThingSpec, name: str) -> bool:
    return f"{thing.locale}/{thing.name}" == name
