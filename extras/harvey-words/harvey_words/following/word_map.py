"""A building as people speak of it: halls and rooms, doors, openings and things with what they may be called.

Positions are (x, y) on the plan [m, world], directions angles counter-clockwise from east [rad].
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from harvey_words.reading.lexicon import OWN_FILE, Lexicon, lexicon_data
from world_models.building.geometry.faces import Face
from world_models.building.locales import WORDS_OF, Doorway, Locale
from world_models.building.world import World, words_about, words_of

Point = tuple[float, float]
HALL_WORDS = frozenset(("hall", "crossing", "corner", "end"))
"""Meanings in a locale's kind or name that make it a place to walk along."""
LONG_RATIO, TILE_RATIO, SQUARE = 3.0, 1.6, 1.1
"""Length over width of what is a hall by its form; and of a crossing, if all halls beside it are larger, and if not."""
WALKED_M = 1.2
"""An opening ahead no further to the side than this is walked on through."""
COLOUR_REACH = 0.3
"""Distance of red, green and blue (0..1) at which a colour is called by another's name as a rule no more."""


@dataclass(frozen=True, eq=False)
class NamedFeature:
    """Something that a text may name: a door, an opening from hall to hall, a lift or stairs, a thing.

    Attributes:
        name: in the model.
        sort: ``door``, ``opening`` or ``thing``.
        locale: from which it is seen.
        at: its place.
        outward: direction from the locale to what is behind it; None for what stands free.
        meanings: what its words mean, those of the locale beyond included.
        own: the same without those of the locale beyond.
        colours: red, green, blue of its surfaces.
        beyond: the locale behind it.
        is_open: whether one can go through.
        own_kind: of a thing, in the model.
    """

    name: str
    sort: str
    locale: str
    at: Point
    outward: float | None
    meanings: frozenset[str]
    own: frozenset[str]
    colours: tuple[tuple[float, float, float], ...] = ()
    beyond: str | None = None
    is_open: bool = False
    own_kind: str = ""


@dataclass(frozen=True, eq=False)
class Area:
    """A room, hall or crossing.

    Attributes:
        is_hall: whether one walks along it rather than into it.
        is_tile: whether it is a hall no longer than wide: a crossing, a corner.
        axis: direction of its longer side.
        middle: of its outline.
        half: half its length and half its width [m].
        meanings: what its words mean; colours: of its floor and walls.
    """

    name: str
    is_hall: bool
    is_tile: bool
    axis: float
    middle: Point
    half: Point
    meanings: frozenset[str]
    colours: tuple[tuple[float, float, float], ...]
    features: tuple[NamedFeature, ...] = ()


def turned(heading: float, by: float) -> float:
    """A heading turned, in (-180, 180] degrees, as rad."""
    angle = math.remainder(heading + by, math.tau)
    return math.pi if angle <= -math.pi + 1e-9 else angle


def is_along(one: float, other: float, within: float = 0.8) -> bool:
    """Whether two directions are the same within an angle [rad]."""
    return abs(math.remainder(one - other, math.tau)) < within


class WordMap:
    """What can be said of a world."""

    def __init__(self, world: World, language: str | Path = OWN_FILE) -> None:
        """``language``: the file of its lexicon. Raises LexiconError."""
        self.world = world
        named: list[Collection[str]] = [words_about(locale) for locale in world.locales.values()]
        named += [words_of(said) for locale in world.locales.values()
                  for said in locale.properties.get(WORDS_OF, {}).values()]
        named += [words_of(name) for name in (*_door_names(world), *(f"{one.kind} {one.name}" for one in world.things))]
        self.lexicon = Lexicon(lexicon_data(language), [[word for word in words if len(word) > 1] for words in named])
        self._surfaces: dict[str, list[Face]] = {}
        for face in world.faces:
            for depth in range(1, face.name.count("/") + 2):
                self._surfaces.setdefault("/".join(face.name.split("/")[:depth]), []).append(face)
        self._looks: dict[tuple[str, float, float, float], tuple[NamedSight, ...]] = {}

    @cached_property
    def areas(self) -> Mapping[str, Area]:
        """All locales with walls, by name."""
        plain = {name: self._build_area(self.world.locales[name]) for name in self.world.rooms}
        return {name: replace(area, features=tuple(self._features(name, plain))) for name, area in plain.items()}

    @cached_property
    def vocabulary(self) -> frozenset[str]:
        """All that the model has a word for."""
        features = (feature for area in self.areas.values() for feature in area.features)
        return frozenset().union(*(feature.meanings for feature in features),
                                 *(area.meanings for area in self.areas.values()))

    def _build_area(self, locale: Locale) -> Area:
        outline = np.asarray(self.world.outline(locale.name), float)
        sides = np.roll(outline, -1, axis=0) - outline
        longest = sides[np.argmax(np.hypot(*sides.T))]
        axis = math.atan2(longest[1], longest[0])
        turn = np.array([[math.cos(axis), math.sin(axis)], [-math.sin(axis), math.cos(axis)]])
        inside = outline @ turn.T
        low, high = inside.min(axis=0), inside.max(axis=0)
        x, y = turn.T @ ((low + high) / 2)
        length, width = ((high - low) / 2).tolist()
        doors = self.world.doorways_of(locale.name)
        texts = [locale.name, locale.kind, *(str(one) for one in locale.properties.values() if isinstance(one, str))]
        meanings = frozenset().union(*map(self.lexicon.meanings, texts))
        kind = self.lexicon.meanings(f"{locale.kind} {locale.name}")
        is_hall = bool(kind & HALL_WORDS) or length > LONG_RATIO * width or (
            bool(doors) and all(self._is_plain(locale.name, door) for door in doors))
        floor = self._surfaces.get(f"{locale.name}/floor", [])
        is_small = all(self._size(locale.name) < self._size(door.other(locale.name)) for door in doors)
        is_short = length < (TILE_RATIO if is_small else SQUARE) * width or bool(
            self.lexicon.meanings(locale.kind) & (HALL_WORDS - {"hall"}))
        return Area(locale.name, is_hall, is_hall and is_short, turned(axis, 0.0),
                    (float(x), float(y)), (length, width), meanings | _textures(floor), _colours(floor))

    def _size(self, locale: str) -> float:
        return float(np.prod(np.ptp(np.asarray(self.world.outline(locale), float), axis=0)))

    def _is_plain(self, locale: str, door: Doorway) -> bool:
        """Whether a doorway is an opening without a frame."""
        return not any("/casing/" in face.name for face in self._surfaces.get(f"{locale}/{door.name}", ()))

    def _features(self, name: str, areas: Mapping[str, Area]) -> Iterator[NamedFeature]:
        locale = self.world.locales[name]
        said: Mapping[str, str] = locale.properties.get(WORDS_OF, {})
        for door in self.world.doorways_of(name):
            pose, beyond = door.pose_from(name), areas[door.other(name)]
            plain = beyond.is_hall and (areas[name].is_hall and self._is_plain(name, door))
            faces = self._surfaces.get(f"{name}/{door.name}", [])
            own = self.lexicon.meanings(f"{door.name} {said.get(door.name, '')}") | _textures(faces)
            yield NamedFeature(door.name, "opening" if plain else "door", name, (pose.x_m, pose.y_m), pose.heading_rad,
                          own | beyond.meanings, own, _colours(faces), beyond.name, True)
        for face in self._surfaces.get(name, ()):
            if face.name.endswith("/leaf") and face.name.count("/") == 2:
                yield self._shut_door(name, face, said)
        for link in self.world.links:
            if name in link.between:
                x, y, _ = link.stop_of(name).tolist()
                yield NamedFeature(link.name, "door", name, (x, y), None,
                                   self.lexicon.meanings(f"{link.name} {link.kind}"),
                              frozenset((link.kind,)), (), link.other(name), True)
        for thing in self.world.frame(name).things:
            x, y = thing.footprint_world.mean(axis=0).tolist()
            faces = self._surfaces.get(thing.name, [])
            short = thing.name.rpartition("/")[2]
            words = self.lexicon.meanings(f"{thing.kind} , {short} , {said.get(short, '')}") | _textures(faces)
            yield NamedFeature(thing.name, "thing", name, (x, y), None, words, words, _colours(faces),
                               own_kind=thing.kind)

    def _shut_door(self, locale: str, leaf: Face, said: Mapping[str, str]) -> NamedFeature:
        short = leaf.name.split("/")[1]
        x, y = leaf.polygon_world.mean(axis=0)[:2].tolist()
        faces = self._surfaces[f"{locale}/{short}"]
        one, two, three = leaf.polygon_world[:3]
        normal = np.cross(two - one, three - two)
        words = self.lexicon.meanings(f"{short} {said.get(short, '')}") | _textures(faces)
        return NamedFeature(short, "door", locale, (x, y), math.atan2(-normal[1], -normal[0]), words, words,
                       _colours(faces))

    # -- looking ---------------------------------------------------------------------------------------------------

    def look(self, locale: str, at: Point, heading: float) -> tuple[NamedSight, ...]:
        """What is seen along a heading, through all halls in line, nearest first; what is behind comes with < 0."""
        key = locale, round(at[0], 2), round(at[1], 2), round(heading, 3)
        if key not in self._looks:
            self._looks[key] = tuple(sorted(self._look(locale, at, heading), key=lambda sight: sight.ahead_m))
        return self._looks[key]

    def _look(self, locale: str, at: Point, heading: float) -> Iterator[NamedSight]:
        area, begin_m, here = self.areas[locale], 0.0, at
        seen = {locale}
        while True:
            onward: tuple[float, NamedFeature] | None = None
            for feature in area.features:
                ahead, left = offsets(here, heading, feature.at)
                side = _side(heading, feature, left)
                yield NamedSight(feature, begin_m + ahead, left, side, area.name)
                if (area.is_hall and side == "ahead" and feature.is_open and feature.beyond is not None
                        and abs(left) < WALKED_M and feature.outward is not None
                        and self.areas[feature.beyond].is_hall and feature.sort == "opening"):
                    onward = ahead, feature
            if onward is None or onward[1].beyond in seen or len(seen) > 200:
                gap_m = offsets(here, heading, area.middle)[0] + area.half[0 if is_level(area.axis, heading) else 1]
                yield NamedSight(None, begin_m + gap_m, 0.0, "ahead", area.name)
                return
            begin_m, here, area = begin_m + onward[0], onward[1].at, self.areas[onward[1].beyond or ""]
            seen.add(area.name)
            yield NamedSight(None, begin_m + area.half[0 if is_level(area.axis, heading) else 1], 0.0, "in", area.name)


@dataclass(frozen=True, eq=False)
class NamedSight:
    """A feature as seen along a heading.

    Attributes:
        feature: what; None: the middle of a hall that begins (side ``in``), or the wall at the end (side ``ahead``).
        ahead_m, left_m: how far ahead, and to the left.
        side: ``left``, ``right``, ``ahead``, ``behind``, or ``in`` for what stands in the way.
        locale: where.
    """

    feature: NamedFeature | None
    ahead_m: float
    left_m: float
    side: str
    locale: str


def offsets(here: Point, heading: float, there: Point) -> Point:
    """How far ahead and how far to the left a place is."""
    dx, dy = there[0] - here[0], there[1] - here[1]
    c, s = math.cos(heading), math.sin(heading)
    return c * dx + s * dy, c * dy - s * dx


def moved(here: Point, heading: float, ahead_m: float, left_m: float = 0.0) -> Point:
    """A place some way ahead and to the left."""
    c, s = math.cos(heading), math.sin(heading)
    return here[0] + c * ahead_m - s * left_m, here[1] + s * ahead_m + c * left_m


def is_level(one: float, other: float) -> bool:
    """Whether two directions lie along each other, either way round."""
    return is_along(one, other) or is_along(one, other + math.pi)


def _side(heading: float, feature: NamedFeature, left_m: float) -> str:
    if feature.outward is not None:
        for side, turn in (("ahead", 0.0), ("left", math.pi / 2), ("right", -math.pi / 2), ("behind", math.pi)):
            if is_along(feature.outward, heading + turn):
                return side
    return "in" if abs(left_m) < 0.6 else "left" if left_m > 0 else "right"


def _door_names(world: World) -> set[str]:
    shut = {face.name.split("/")[1] for face in world.faces if face.name.endswith("/leaf")}
    return shut | {door.name for door in world.doorways} | {link.name for link in world.links}


def _textures(faces: Iterable[Face]) -> frozenset[str]:
    found = {region.texture for face in faces for region in face.front}
    return frozenset({"brick": "brick", "wood": "wood", "tiles": "tile", "stripes": "stripe"}[texture]
                     for texture in found & {"brick", "wood", "tiles", "stripes"})


def _colours(faces: Iterable[Face]) -> tuple[tuple[float, float, float], ...]:
    """Each once, unknown ones left out."""
    found = dict.fromkeys(region.colour for face in faces for region in face.front)
    return tuple(colour for colour in found if not math.isnan(colour[0]))
