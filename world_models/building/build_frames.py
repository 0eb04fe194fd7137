"""Building locale frames: what a world file describes, sorted by locale, with extents and passage graphs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TypeVar

from world_models.building.geometry.faces import Face
from world_models.building.geometry.landmarks import Landmark
from world_models.building.geometry.scene import LocaleGeometry
from world_models.building.locale_frame import LocaleFrame
from world_models.building.locales import (
    Doorway,
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
    return {frame.name: frame
            for frame in iterate_frames(locales, doorways, links, things, lambda name: parts.get(name, ()))}


def iterate_frames(
    locales: Mapping[str, Locale], doorways: Sequence[Doorway], links: Sequence[Link], things: Sequence[Thing],
    parts_of: Callable[[str], tuple[LocaleGeometry, ...]],
) -> Iterator[LocaleFrame]:
    """The same, one by one, where the geometry of all locales at once would take too much memory."""
    parents = {name: locale.parent for name, locale in locales.items()}
    extents = _compute_extents(locales, parents)
    children = _group((parent, extents[name]) for name, parent in parents.items() if parent is not None)
    passages = build_passage_graphs(parents, drivable_passages((*doorways, *links)))
    own_doorways = _group((name, doorway) for doorway in doorways for name in doorway.between)
    own_links = _group((name, link) for link in links for name in link.between)
    own_things = _group((thing.locale, thing) for thing in things)
    for name, locale in locales.items():
        yield LocaleFrame(
            world="", locale=locale, extent=extents[name], children=children.get(name, ()),
            doorways=own_doorways.get(name, ()), links=own_links.get(name, ()), parts=parts_of(name),
            things=own_things.get(name, ()), edges=passages.edges.get(name, ()),
            components=passages.components.get(name, ()))


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
