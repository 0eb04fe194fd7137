"""The world (§3.4): the whole building as a file describes it; the attributes name everything in it.

Files, drawings and the simulator use the whole. The robot knows the locale frames that it asked for: what a world file
describes, sorted by locale, with extents and passage graphs.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, TypeVar

from world_models.building.building import Building
from world_models.building.geometry.faces import Face
from world_models.building.geometry.landmarks import Landmark
from world_models.building.geometry.scene import LocaleGeometry, Scene, build_scene, concatenate_scenes
from world_models.building.locale_frame import LocaleFrame
from world_models.building.locales import (
    Doorway,
    Finding,
    Link,
    Locale,
    LocaleExtent,
    Thing,
    bounding_box,
    bounding_rectangle,
    compute_reaches,
)
from world_models.building.passages import build_passage_graphs, drivable_passages
from world_models.frames import Pose

K = TypeVar("K")
T = TypeVar("T")


class World(Building):
    """The model of a building: the frames of all its locales, root first, then in the order of the file.

    What is asked of the whole world (passages, things, faces) reads all frames, once.

    Attributes:
        frames: of all locales; a compiled world unpacks each when it is asked for.
        name: of the world and of its root locale: that of the first frame.
        building_faults: parts of the description that could not be built.
    """

    def __init__(self, frames: Mapping[str, LocaleFrame], building_faults: Sequence[Finding] = ()) -> None:
        super().__init__(frames)
        self.name = next(iter(frames))
        self.building_faults = tuple(building_faults)
        self._results: dict[str, dict[Hashable, Any]] = {}

    def cached(self, name: str, max_items: int, key: Hashable, compute: Callable[[], T]) -> T:
        known: dict[Hashable, T] = self._results.setdefault(name, {})
        if key not in known:
            result = compute()
            while len(known) >= max_items:
                del known[next(iter(known))]
            known[key] = result
        return known[key]

    def root_frame(self) -> LocaleFrame:
        return self.frames[self.name]

    @property
    def root(self) -> str:
        return self.name

    # -- by name ---------------------------------------------------------------------------------------------------

    def named(self, words: str) -> Sequence[str]:
        """The locales with all these words in their name, kind or properties, in the order of the file."""
        wanted = words_of(words)
        return [name for name, locale in self.locales.items() if wanted <= words_about(locale)]

    def find_passage(self, name: str) -> Doorway | Link | None:
        """A doorway or link by name; None where there is none."""
        return self._passages.get(name)

    def passage(self, name: str) -> Doorway | Link:
        """A doorway or link by name. Raises ValueError where there is none."""
        found = self.find_passage(name)
        if found is None:
            raise ValueError(f"expected a passage of {self.name}, got {name!r}")
        return found

    @cached_property
    def _passages(self) -> dict[str, Doorway | Link]:
        passages: list[Doorway | Link] = [*self.links, *self.doorways]
        return {passage.name: passage for passage in passages}

    def landmark(self, name: str) -> Landmark:
        """A landmark by name. Raises ValueError where there is none."""
        found = [mark for mark in self.landmarks if mark.name == name]
        if not found:
            raise ValueError(f"expected the name of a landmark of {self.name}, got {name!r}")
        return found[0]

    # -- everything ------------------------------------------------------------------------------------------------

    @cached_property
    def locales(self) -> Mapping[str, Locale]:
        """All locales by name, root first, then in the order of the file."""
        return {name: frame.locale for name, frame in self.frames.items()}

    @cached_property
    def rooms(self) -> tuple[str, ...]:
        """The locales that contain no other, in the order of the file; only frames of containers are read."""
        found, todo = [], [self.root_frame().extent]
        while todo:
            here = todo.pop()
            if here.is_room:
                found.append(here)
            else:
                todo += self.frame(here.name).children
        return tuple(extent.name for extent in sorted(found, key=lambda extent: extent.number))

    @cached_property
    def doorways(self) -> tuple[Doorway, ...]:
        """All open doorways, locale by locale."""
        return tuple({door.name: door for frame in self.frames.values() for door in frame.doorways}.values())

    @cached_property
    def links(self) -> tuple[Link, ...]:
        """All elevators and stairs, locale by locale."""
        return tuple({link.name: link for frame in self.frames.values() for link in frame.links}.values())

    @cached_property
    def things(self) -> tuple[Thing, ...]:
        """All things, locale by locale."""
        return tuple(thing for frame in self.frames.values() for thing in frame.things)

    @cached_property
    def parts(self) -> tuple[LocaleGeometry, ...]:
        """The geometry of all locales, each part once, in the order of their first faces, then landmarks."""
        return tuple(sorted(self.parts_of(self.frames).values(), key=_first_number))

    @cached_property
    def faces(self) -> tuple[Face, ...]:
        """All barriers and doorways, by number; their regions are what is drawn."""
        return _in_order(pair for part in self.parts for pair in part.faces)

    @cached_property
    def landmarks(self) -> tuple[Landmark, ...]:
        """All landmarks, by number."""
        return _in_order(pair for part in self.parts for pair in part.landmarks)

    def faces_within(self, name: str) -> tuple[Face, ...]:
        """The faces of all rooms in a locale and of the rooms beyond its doorways, by number."""
        inside = tuple(self.rooms_in(name))
        beyond = [doorway.other(room) for room in inside for doorway in self.doorways_of(room)]
        parts = self.parts_of(dict.fromkeys((*inside, *beyond)))
        return _in_order(pair for part in parts.values() for pair in part.faces)

    def faces_of(self, name: str) -> tuple[Face, ...]:
        """The faces of a locale, without those that belong to its neighbours."""
        return tuple(face for part in self.frame(name).parts if part.locale == name for _, face in part.faces)

    @cached_property
    def scene(self) -> Scene:
        """Model lines and surfaces of the whole world."""
        return concatenate_scenes([part.scene for part in self.parts] or [build_scene((), ())])

    def walk(self, origin: str, destination: str) -> list[str] | None:
        """The rooms of the route with the fewest passages of the whole world, stairs included; None for no route."""
        import networkx as nx  # here, so that a world can be read without it

        passages: tuple[Doorway | Link, ...] = (*self.doorways, *self.links)
        ways: nx.Graph = nx.Graph(passage.between for passage in passages)
        try:
            way: list[str] = nx.shortest_path(ways, origin, destination)
        except (nx.NetworkXNoPath, nx.NodeNotFound):
            return None
        return way

    def counts(self) -> Mapping[str, int]:
        """Numbers of rooms, open doorways, things, faces and landmarks."""
        return {"room": len(self.rooms), "open doorway": len(self.doorways), "thing": len(self.things),
                "face": len(self.faces), "landmark": len(self.landmarks)}


def words_of(text: str) -> frozenset[str]:
    """The words of a name or a phrase in lower case, without a possessive's s."""
    return frozenset(word for word in re.split(r"[^a-z0-9]+", text.lower().replace("'s", "")) if word)


def words_about(locale: Locale) -> frozenset[str]:
    """The words by which people may name a locale: those of its name, kind and text properties."""
    texts = [locale.name, locale.kind, *(value for value in locale.properties.values() if isinstance(value, str))]
    return frozenset().union(*map(words_of, texts))


def _first_number(part: LocaleGeometry) -> tuple[bool, int]:
    """The number of its first face; of one without faces, after all others, that of its first landmark."""
    numbered = part.faces or part.landmarks
    return not part.faces, numbered[0][0] if numbered else 0


def _in_order(numbered: Iterable[tuple[int, T]]) -> tuple[T, ...]:
    """Items by their number in the world."""
    return tuple(item for _, item in sorted(numbered, key=lambda pair: pair[0]))


def build_frames(
    locales: Mapping[str, Locale], doorways: Sequence[Doorway] = (), faces: Sequence[Face] = (),
    landmarks: Sequence[Landmark] = (), things: Sequence[Thing] = (), links: Sequence[Link] = (),
) -> dict[str, LocaleFrame]:
    """The frames of all locales of a world, in their order; faces and landmarks are numbered as they come.

    Args:
        locales: by name, the root first.
    """
    parts = _group((name, part) for part in _build_parts(faces, landmarks)
                   for name in dict.fromkeys((part.locale, part.neighbour)) if name is not None)
    parents = {name: locale.parent for name, locale in locales.items()}
    extents = _compute_extents(locales, parents)
    children = _group((parent, extents[name]) for name, parent in parents.items() if parent is not None)
    passages = build_passage_graphs(parents, drivable_passages((*doorways, *links)))
    own_doorways = _group((name, doorway) for doorway in doorways for name in doorway.between)
    own_links = _group((name, link) for link in links for name in link.between)
    own_things = _group((thing.locale, thing) for thing in things)
    return {
        name: LocaleFrame(
            world="", locale=locale, extent=extents[name], children=children.get(name, ()),
            doorways=own_doorways.get(name, ()), links=own_links.get(name, ()), parts=parts.get(name, ()),
            things=own_things.get(name, ()), edges=passages.edges.get(name, ()),
            components=passages.components.get(name, ()))
        for name, locale in locales.items()}


def _build_parts(faces: Sequence[Face], landmarks: Sequence[Landmark]) -> list[LocaleGeometry]:
    """The geometry of each locale and of each pair of neighbours, in the order of their first faces."""
    own = _group(((face.locale, face.neighbour), (number, face)) for number, face in enumerate(faces))
    marks = _group(((mark.locale, mark.neighbour), (number, mark)) for number, mark in enumerate(landmarks))
    return [LocaleGeometry(*key, own.get(key, ()), marks.get(key, ())) for key in dict.fromkeys([*own, *marks])]


def _compute_extents(locales: Mapping[str, Locale], parents: Mapping[str, str | None]) -> dict[str, LocaleExtent]:
    poses: dict[str, Pose] = {}

    def pose_of(name: str) -> Pose:
        if name not in poses:
            parent, frame = parents[name], locales[name].frame
            poses[name] = frame if parent is None else pose_of(parent) @ frame
        return poses[name]

    boxes = {name: bounding_box(locale, pose_of(name)) for name, locale in locales.items()}
    reaches, containers = compute_reaches(parents, boxes), set(parents.values())
    return {name: LocaleExtent(name, number, name not in containers, bounding_rectangle(box), reaches[name])
            for number, (name, box) in enumerate(boxes.items())}


def _group(pairs: Iterable[tuple[K, T]]) -> dict[K, tuple[T, ...]]:
    """The values of each key, in order."""
    groups: dict[K, list[T]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return {key: tuple(values) for key, values in groups.items()}
