"""Reading a world file, with all files that it includes or copies from, into a world spec."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import combinations, count
from pathlib import Path

from world_models.building.geometry.faces import Finish
from world_models.building.locales import WORDS_OF
from world_models.building.model_errors import SIGMA, SIGMAS
from world_models.files.construction.specs import DOOR_SIZES_M, DoorSpec, LinkSpec, LocaleSpec, ThingSpec, WorldSpec
from world_models.files.toml.locale_reader import LOCALE_KEYS, LocaleReader, pose_at, read_properties, read_sigma
from world_models.files.toml.other_files import (
    COPY_KEYS,
    extract_subtree,
    find_named_file,
    read_included,
    rename_locales,
)
from world_models.files.toml.placements import Placement, read_coordinates, read_placements, read_words
from world_models.files.toml.source import Node, Source

SHARED_KEYS = ("include", "finishes", "parts", "defaults")
DOOR_KEYS = ("width", "height", "open", "frame", "leaf", "threshold", "panel", "sigma_cm", "kind", "words")
DOOR_FINISH = Finish((0.45, 0.33, 0.22))


@dataclass
class WorldReader:
    """What has been read of a world so far.

    Attributes:
        base: the world file.
        within: the files that copy from this one, so that no file contains itself.
        reader: of the tables of locales and doors, with shared parts and defaults.
    """

    base: Source
    within: tuple[Path, ...] = ()
    name: str = ""
    reader: LocaleReader = field(default_factory=LocaleReader)
    locales: dict[str, LocaleSpec] = field(default_factory=dict)
    doors: list[DoorSpec] = field(default_factory=list)
    things: list[ThingSpec] = field(default_factory=list)
    links: list[LinkSpec] = field(default_factory=list)
    _sigma_m: float | None = None
    _sigmas_m: dict[str, dict[str, float]] = field(default_factory=dict)
    _words: dict[str, dict[str, str]] = field(default_factory=dict)
    _thing_names: dict[str, set[str]] = field(default_factory=dict)

    def spec(self) -> WorldSpec:
        """All that has been read."""
        locales = {name: self._with_sayings(spec) for name, spec in self.locales.items()}
        return WorldSpec(self.name, f"{self.base.name}:1", locales, tuple(self.doors), tuple(self.things),
                         tuple(self.links))

    def _with_sayings(self, spec: LocaleSpec) -> LocaleSpec:
        """A locale with what the file says of how well its doors and things are known, and of what they are called."""
        stated = {} if self._sigma_m is None else {SIGMA: self._sigma_m}
        own = self._sigmas_m.get(spec.name)
        more = {SIGMAS: {**spec.properties.get(SIGMAS, {}), **own}} if own else {}
        if spec.name in self._words:
            more[WORDS_OF] = {**spec.properties.get(WORDS_OF, {}), **self._words[spec.name]}
        return replace(spec, properties={**stated, **spec.properties, **more}) if stated or more else spec

    # -- files -----------------------------------------------------------------------------------------------------

    def read_base(self) -> None:
        """Read the world file itself. Raises WorldError."""
        root = self.base.root.table(("name", "units", "locales"), (*SHARED_KEYS, "doors", "links", "sigma_cm"))
        self._sigma_m = read_sigma(root) if "sigma_cm" in root else None
        self.name = root["name"].text()
        self._read_shared(root)
        nodes = root["locales"]
        for name, node in nodes.entries():
            self._read_locale(name, node)
        self._check_hierarchy(nodes)
        for name, node in nodes.entries():
            self._read_things(name, _with_like(name, node, nodes))
        for name, node in root.entries_of("doors"):
            self._read_doors(name, node)
        for name, node in root.entries_of("links"):
            self._read_links(name, node)

    def read_details(self, source: Source) -> None:
        """Read a file that adds finishes, parts and things to known locales. Raises WorldError."""
        root = source.root.table(("units", "locales"), ("finishes", "parts"))
        self.reader.shared.read(root)
        for name, node in root["locales"].entries():
            node.table(("things",))
            if name not in self.locales:
                raise node.fail(f"one of the locales {', '.join(self.locales)}", repr(name))
            self._read_things(name, node)

    def _read_shared(self, root: Node) -> None:
        """Finishes, parts and defaults; those of included files first, so that a file's own defaults win."""
        for source in read_included(root):
            self._read_shared(source.root.table(("units",), SHARED_KEYS))
        self.reader.shared.read(root)
        self.reader.read_defaults(root)

    # -- locales -----------------------------------------------------------------------------------------------------

    def _read_locale(self, name: str, node: Node) -> None:
        if name == self.name:
            raise node.fail("a name other than that of the whole world", repr(name))
        if "from" in node.table(optional=(*LOCALE_KEYS, *COPY_KEYS)):
            self._copy_locale(name, node.table(("from",), COPY_KEYS))
        else:
            own = _with_like(name, node.table(optional=LOCALE_KEYS))
            self._add_locale(name, self.reader.read(name, own, self.name), node)

    def _add_locale(self, name: str, spec: LocaleSpec, node: Node) -> None:
        if name in self.locales:
            raise node.fail("a name that no other locale has", f"{name!r} once more")
        self.locales[name] = spec

    def _copy_locale(self, name: str, node: Node) -> None:
        """A locale, with all that is in it, from another world file."""
        source = find_named_file(node["from"])
        if source.file in (self.base.file, *self.within):
            raise node["from"].fail("another world file, that is not made from this one")
        other = WorldReader(source, (self.base.file, *self.within))
        other.read_base()
        inside = extract_subtree(other.spec(), node)
        prefix = node["prefix"].text() if "prefix" in node else ""
        part = rename_locales(inside, name, prefix)
        top = part.locales[name]
        placed = replace(
            top, parent=node["in"].text() if "in" in node else self.name, frame=self.reader.read_pose(node),
            kind=node["kind"].text() if "kind" in node else top.kind, source=node.where,
            properties={**top.properties, **read_properties(node.get("properties"))})
        for own, spec in part.locales.items():
            self._add_locale(own, placed if own == name else spec, node)
        self.doors += part.doors
        self.links += part.links
        self.things += part.things
        for room, things in node.entries_of("add"):
            if prefix + room not in part.locales:
                raise things.fail(f"one of the locales {', '.join(inside.locales)}", repr(room))
            self._read_things(prefix + room, Node({"things": things.value}, node.key, node.source))

    def _check_hierarchy(self, nodes: Node) -> None:
        """Every locale lies in a known one, and those without walls contain some that have them."""
        containers = {spec.parent for spec in self.locales.values()}
        for name, spec in self.locales.items():
            node = nodes.get(name)
            if node is None:
                continue
            self._check_containers(name, node, nodes)
            contains = name in containers
            if (spec.outline is None) != contains:
                raise node.fail("either a size or outline, or other locales in it", "both" if contains else "neither")
        if not self.locales:
            raise nodes.fail("at least one locale")

    def _check_containers(self, name: str, node: Node, nodes: Node) -> None:
        """The containers of a locale are known, up to the root, without a cycle."""
        chain = [name]
        while chain[-1] != self.name:
            parent = self.locales[chain[-1]].parent
            last = nodes.get(chain[-1]) or node
            place = last.get("in") or node
            if parent != self.name and parent not in self.locales:
                raise place.fail(f"one of the locales {self.name}, {', '.join(self.locales)}")
            if parent in chain:
                raise place.fail("a locale that is not itself contained in this one")
            chain.append(parent)

    # -- doors and links -------------------------------------------------------------------------------------------

    def _read_doors(self, name: str, node: Node) -> None:
        """One door, or several alike along a wall."""
        node.table(("between", "wall", "along"), DOOR_KEYS)
        places = read_coordinates(node["along"], self.reader.shared)
        for number, along_m in enumerate(places, 1):
            own = name if len(places) == 1 else f"{name}-{number}"
            if any(door.name == own for door in self.doors):
                raise node.fail("a name that no other door has", f"{own!r} once more")
            self.doors.append(self._read_door(own, along_m, node))

    def _read_door(self, name: str, along_m: float, node: Node) -> DoorSpec:
        between = tuple(self._read_room(item) for item in node["between"].items(min_count=1))
        is_open = node["open"].flag() if "open" in node else False
        if len(between) > 2 or len(set(between)) != len(between) or (is_open and len(between) < 2):
            raise node["between"].fail("two different locales" if is_open else "one or two different locales")
        if "sigma_cm" in node:
            for room in between:
                self._sigmas_m.setdefault(room, {}).update(dict.fromkeys((name, f"{room}/{name}"), read_sigma(node)))
        said = ", ".join(filter(None, [node["kind"].text() if "kind" in node else "", read_words(node)]))
        for room in between if said else ():
            self._words.setdefault(room, {})[name] = said
        casing = self.reader.finish_or_none(node, "frame", DOOR_FINISH)
        leaf, threshold = (self.reader.finish(node, key, DOOR_FINISH) for key in ("leaf", "threshold"))
        return DoorSpec(
            name, between, self._read_wall(node["wall"], between[0]), along_m,
            self.reader.length(node, "width", *DOOR_SIZES_M, 0.9, "door_width"),
            self.reader.length(node, "height", *DOOR_SIZES_M, 2.0, "door_height"),
            is_open, casing, leaf, threshold, self.reader.shared.part(node["panel"]) if "panel" in node else (),
            node.where,
        )

    def _read_links(self, name: str, node: Node) -> None:
        """A link between two locales, or between each two of several that share one ``stop``."""
        one_stop = "stop" in node.table(("kind", "between"), ("stop", "stops"))
        node.table(("kind", "between", "stop" if one_stop else "stops"))
        rooms = [self._read_room(item) for item in node["between"].items(min_count=2)]
        if len(set(rooms)) != len(rooms) or (len(rooms) != 2 and not one_stop):
            raise node["between"].fail("different locales" if one_stop else "two different locales")
        nodes = [node["stop"]] * len(rooms) if one_stop else node["stops"].items(min_count=2)
        if len(nodes) != len(rooms):
            raise node["stops"].fail("a stop [x, y, heading in degrees] in each of the two locales")
        stops = [self._read_stop(item) for item in nodes]
        kind = node["kind"].choice("elevator", "stairs")
        for i, j in combinations(range(len(rooms)), 2):
            own = name if len(rooms) == 2 else f"{name}-{i + 1}-{j + 1}"
            if own in [door.name for door in self.doors] + [link.name for link in self.links]:
                raise node.fail("a name that no door has", repr(own))
            self.links.append(LinkSpec(own, kind, (rooms[i], rooms[j]), (stops[i], stops[j]), node.where))

    def _read_stop(self, node: Node) -> tuple[float, float, float]:
        """x, y [m] and heading [rad]."""
        shared = self.reader.shared
        x, y, degrees = node.numbers((3,), -shared.max_coordinate, shared.max_coordinate)
        return x * shared.unit_m, y * shared.unit_m, math.radians(degrees)

    def _read_room(self, node: Node) -> str:
        """The name of a locale with walls."""
        return node.choice(*(name for name, spec in self.locales.items() if spec.outline is not None))

    def _read_wall(self, node: Node, room: str) -> str:
        return node.choice(*self.locales[room].wall_names)

    # -- things ----------------------------------------------------------------------------------------------------

    def _read_things(self, locale: str, node: Node) -> None:
        things = node.get("things")
        if things is None:
            return
        if self.locales[locale].outline is None:
            raise things.fail("things only in a locale with walls", f"things in {locale}")
        for item in things.items():
            for place in read_placements(item, self.reader.shared):
                self.things.append(self._build_thing(locale, place))
                if place.words:
                    self._words.setdefault(locale, {})[self.things[-1].name] = place.words
                if place.sigma_m is not None:
                    name = f"{locale}/{self.things[-1].name}"
                    self._sigmas_m.setdefault(locale, {})[name] = place.sigma_m

    def _build_thing(self, locale: str, place: Placement) -> ThingSpec:
        name = self._name_thing(locale, place)
        spec = ThingSpec(name, locale, place.kind, place.boxes, place.node.where)
        if place.wall is None:
            return replace(spec, locale_from_part=pose_at((place.x_m, place.y_m, 0.0), place.turn_deg))
        return replace(spec, wall=self._read_wall(place.wall, locale), along_m=place.x_m, up_m=place.up_m)

    def _name_thing(self, locale: str, place: Placement) -> str:
        """The given name, or the part's name with the first free number."""
        if locale not in self._thing_names:
            self._thing_names[locale] = {thing.name for thing in self.things if thing.locale == locale}
        used = self._thing_names[locale]
        if place.name is None:
            numbered = (f"{place.kind}-{number}" for number in count(1))
            name = next(name for name in numbered if name not in used)
        else:
            name = place.name.text()
            if name in used:
                raise place.name.fail(f"a name that nothing else in {locale} has")
        used.add(name)
        return name


def _with_like(name: str, node: Node, nodes: Node | None = None) -> Node:
    """The table of a locale, completed from the table of the locale that it is ``like``."""
    if "like" not in node:
        return node
    nodes = nodes or Node(node.source.data["locales"], ("locales",), node.source)
    like = node["like"].text()
    known = nodes.value.get(like)
    if like == name or not isinstance(known, dict) or "like" in known or "from" in known:
        raise node["like"].fail("a locale of this file that is neither like another nor from another file")
    return Node({**known, **node.value}, node.key, node.source)
