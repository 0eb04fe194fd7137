"""What is believed differently than the world file says: pure functions on the geometry and the things of a locale.

A doorway found shut; a thing, a landmark or a face that is gone; something that stands there and the file lacks; a
door that stands beside. A landmark that is gone keeps its number and its name, but has no lines any more: what was seen
of it has a name still. What is displaced stretches what it is built to: walls and trim end at a door's new place.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.faces import UNKNOWN, Face, Region, build_barrier
from world_models.building.geometry.landmarks import Edges, Landmark
from world_models.building.geometry.scene import LocaleGeometry
from world_models.building.locales import Doorway, Thing
from world_models.frames import frozen

SAME_PLACE_M = 1e-3
"""Corners no further apart than this on the plan are the same."""


def shut_door(parts: tuple[LocaleGeometry, ...], doorway: Doorway, floor_m: float) -> tuple[LocaleGeometry, ...]:
    """The geometry of one of a doorway's two locales, with the door shut.

    The faces of type doorway go; the shut faces come into the parts that the two locales share. Both locales' geometry
    gets the same shared parts. The numbers of the shut faces follow from their names: negative, and so apart from those
    of the world's own faces.

    Args:
        parts: own and shared parts of the locale.
        floor_m: height of the floor at the doorway [m, world].
    """
    shut = build_shut_faces(doorway, floor_m)
    changed = {(part.locale, part.neighbour): _without_opening(part, doorway) for part in parts}
    for face in shut:
        key = face.locale, face.neighbour
        part = changed.get(key) or LocaleGeometry(*key, (), ())
        faces = dict(part.faces) | {-1 - zlib.crc32(face.name.encode()): face}
        changed[key] = replace(part, faces=tuple(sorted(faces.items())))
    return tuple(changed.values())


def build_shut_faces(doorway: Doorway, floor_m: float) -> tuple[Face, Face]:
    """Two one-sided barriers that fill an opening, one at the threshold of each locale, facing that locale.

    The model does not know how deep the leaf hangs in the opening, nor what colour it has. So nothing within the
    opening is expected to be seen, and no colour is claimed.

    Args:
        floor_m: height of the floor at the doorway [m, world].
    """
    first, second = (_build_shut_face(doorway, locale, floor_m) for locale in doorway.between)
    return first, second


def _build_shut_face(doorway: Doorway, locale: str, floor_m: float) -> Face:
    left, right = doorway.threshold_of(locale)
    top_m = floor_m + doorway.height_m
    corners = [(*left, floor_m), (*right, floor_m), (*right, top_m), (*left, top_m)]
    return build_barrier(f"{locale}/{doorway.name}/shut", locale, corners, UNKNOWN, neighbour=doorway.other(locale))


def _without_opening(part: LocaleGeometry, doorway: Doorway) -> LocaleGeometry:
    """A part without the faces of type doorway that fill this opening."""
    kept = tuple((number, face) for number, face in part.faces if not _fills(face, doorway))
    return part if len(kept) == len(part.faces) else replace(part, faces=kept)


def _fills(face: Face, doorway: Doorway) -> bool:
    """Whether this is a face of type doorway whose corners are all at the jambs' feet on the plan."""
    if face.kind != "doorway" or {face.locale, face.neighbour} != set(doorway.between):
        return False
    feet: NDArray[np.float64] = doorway.thresholds_world.reshape(4, 2)
    away_m = np.linalg.norm(face.polygon_world[:, None, :2] - feet, axis=2).min(axis=1)
    return bool(away_m.max() < SAME_PLACE_M)


Parts = tuple[LocaleGeometry, ...]


def remove_thing(parts: Parts, things: tuple[Thing, ...], name: str) -> tuple[Parts, tuple[Thing, ...]]:
    """The geometry and the things of a locale without one thing, its faces and its landmark's lines.

    What stands near it, or on top of it, stays: the model does not say what carries what.

    Raises:
        ValueError: none of the things has this name.
    """
    kept = tuple(thing for thing in things if thing.name != name)
    if len(kept) == len(things):
        raise ValueError(f"expected one of the things {', '.join(t.name for t in things) or '(none)'}, got {name!r}")
    return _remove(parts, lambda known: known == name or known.startswith(f"{name}/")), kept


def remove_element(parts: Parts, name: str) -> Parts:
    """The geometry of a locale without the face of this name, and without the lines of the landmark of this name.

    A wall and its trim have one name, and go together.

    Raises:
        ValueError: none of its faces and landmarks has this name.
    """
    if name not in element_names(parts):
        locales = sorted({part.locale for part in parts})
        raise ValueError(f"expected the name of a face or landmark of {', '.join(locales)}, got {name!r}")
    return _remove(parts, lambda known: known == name)


def element_names(parts: Parts) -> frozenset[str]:
    """The names of all faces and landmarks."""
    faces = (face.name for part in parts for _, face in part.faces)
    return frozenset(faces).union(mark.name for part in parts for _, mark in part.landmarks)


def _remove(parts: Parts, is_gone: Callable[[str], bool]) -> Parts:
    """The same parts where nothing is gone."""
    return tuple(_remove_from(part, is_gone) if any(map(is_gone, element_names((part,)))) else part for part in parts)


def _remove_from(part: LocaleGeometry, is_gone: Callable[[str], bool]) -> LocaleGeometry:
    no_edges = Edges.from_rows(())
    faces = tuple((number, face) for number, face in part.faces if not is_gone(face.name))
    landmarks = tuple((n, replace(mark, edges=no_edges) if is_gone(mark.name) else mark) for n, mark in part.landmarks)
    return replace(part, faces=faces, landmarks=landmarks)


MIN_AREA_M2 = 1e-6
"""A smaller footprint hides nothing."""


def add_extra(
    parts: tuple[LocaleGeometry, ...], name: str, locale: str, footprint: Any, floor_m: float, height_m: float
) -> tuple[LocaleGeometry, ...]:
    """The geometry of a locale, with one more thing before what is behind it; the same where it hides nothing.

    The numbers of its faces follow from their names: negative, and so apart from those of the world's own faces.

    Args:
        footprint: (k, 2) corners of what it takes of the floor [m, world].
        floor_m: height of the floor [m, world].
        height_m: of its top above the floor; 0: nothing tells it, and it hides nothing.
    """
    faces = build_extra_faces(name, locale, footprint, floor_m, height_m)
    if not faces:
        return parts
    numbered = {-1 - zlib.crc32(face.name.encode()): face for face in faces}
    own = next((part for part in parts if part.neighbour is None), LocaleGeometry(locale, None, (), ()))
    changed = LocaleGeometry(own.locale, None, tuple(sorted((dict(own.faces) | numbered).items())), own.landmarks)
    return (*(part for part in parts if part is not own), changed)


def build_extra_faces(name: str, locale: str, footprint: Any, floor_m: float, height_m: float) -> tuple[Face, ...]:
    """The sides and the top of the hull of a footprint, up to a height.

    What it is nobody knows, so nothing of it is expected to be seen, and no colour is claimed; it hides what is behind.
    """
    import shapely  # slow to import, and what reads a journal needs none of it
    from shapely.geometry.polygon import orient

    hull = shapely.convex_hull(shapely.multipoints(np.asarray(footprint, float).reshape(-1, 2)))
    if not isinstance(hull, shapely.Polygon) or hull.area < MIN_AREA_M2 or height_m <= 0.0:
        return ()
    ring = np.asarray(orient(hull).exterior.coords)[:-1, :2]
    top_m = floor_m + height_m
    sides = [[(*a, floor_m), (*b, floor_m), (*b, top_m), (*a, top_m)]
             for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)]
    top = [(float(x), float(y), top_m) for x, y in ring]
    return tuple(build_barrier(f"{name}/{index}", locale, corners, UNKNOWN)
                 for index, corners in enumerate([*sides, top]))


BOARDS_M = 0.11
"""The boards round a door reach so far along its wall, and stand before it by less [m]."""


def outline_door(doorway: Doorway) -> tuple[tuple[float, float], ...]:
    """(4, 2) the floor that a door takes with its boards, through its wall, counter-clockwise [m, world]."""
    (a, b), (d, c) = doorway.threshold_of(doorway.between[0]), doorway.threshold_of(doorway.between[1])[::-1]
    along, ahead = BOARDS_M * (b - a) / doorway.width_m, BOARDS_M * doorway.outward_from(doorway.between[0])
    corners = np.array([a - along - ahead, b + along - ahead, c + along + ahead, d - along + ahead])
    return tuple((float(x), float(y)) for x, y in corners)


def find_along(doorway: Doorway) -> NDArray[np.float64]:
    """(2,) unit direction along the wall of a door, to the right as seen from its first room [world]."""
    ahead = doorway.outward_from(doorway.between[0])
    return np.array([ahead[1], -ahead[0]])


@dataclass(frozen=True, eq=False, slots=True)
class Shift:
    """A displacement of all that stands in an area of the floor, at whatever height.

    Attributes:
        corners: (k, 2) of the area, which is convex, counter-clockwise [m, world].
        by_m: (2,) how far it is displaced [m, world].
        is_wall: whether it is a wall: what stands at it moves with it.
    """

    corners: NDArray[np.float64]
    by_m: NDArray[np.float64]
    is_wall: bool = False

    def move(self, points: Any, whole: bool | None = None) -> NDArray[np.float64]:
        """Points (..., 2) or (..., 3), displaced where they stand in the area; the same array where none does.

        ``whole``: all of them are displaced, or none, wherever they stand.
        """
        known: NDArray[np.float64] = np.asarray(points, float)
        if whole is not None:
            return known + np.pad(self.by_m, (0, known.shape[-1] - 2)) if whole else known
        starts, sides = self.corners, np.roll(self.corners, -1, axis=0) - self.corners
        to = known[..., None, :2] - starts
        within = np.all(sides[:, 0] * to[..., 1] - sides[:, 1] * to[..., 0] >= 0.0, axis=-1)
        if not np.any(within):
            return known
        moved = known.copy()
        moved[within, :2] += self.by_m
        return moved

    def move_parts(self, parts: Parts, things: Sequence[Thing]) -> Parts:
        """The geometry of a locale; a part of which nothing stands in the area is the same. A thing moves as one."""
        whole = {thing.name: self.moves_thing(thing) for thing in things}
        return tuple(self._move_part(part, whole) for part in parts)

    def moves_thing(self, thing: Thing) -> bool:
        """Whether a thing is built to a wall that is displaced."""
        is_at = self.move(thing.footprint_world) is not thing.footprint_world
        return self.is_wall and thing.protrusion_m is not None and is_at

    def move_thing(self, thing: Thing) -> Thing:
        if not self.moves_thing(thing):
            return thing
        return replace(thing, footprint_world=frozen(thing.footprint_world + self.by_m))

    def move_doorway(self, doorway: Doorway) -> Doorway:
        moved = self.move(doorway.thresholds_world)
        return doorway if moved is doorway.thresholds_world else replace(doorway, thresholds_world=moved)

    def _move_part(self, part: LocaleGeometry, whole: Mapping[str, bool]) -> LocaleGeometry:
        faces = tuple((number, self._move_face(face, whole.get("/".join(face.name.split("/")[:2]))))
                      for number, face in part.faces)  # a thing's faces are called after it
        marks = tuple((number, self._move_mark(mark, whole.get(mark.name))) for number, mark in part.landmarks)
        is_same = all(new is old for (_, new), (_, old) in zip((*faces, *marks), (*part.faces, *part.landmarks),
                                                               strict=True))
        return part if is_same else replace(part, faces=faces, landmarks=marks)

    def _move_face(self, face: Face, whole: bool | None) -> Face:
        polygon = self.move(face.polygon_world, whole)
        sides = [self._move_regions(side, whole) for side in (face.front, face.back)]
        if polygon is face.polygon_world and sides == [face.front, face.back]:
            return face
        return replace(face, polygon_world=polygon, front=sides[0], back=sides[1])

    def _move_regions(self, regions: Sequence[Region], whole: bool | None) -> tuple[Region, ...]:
        moved = [(region, self.move(region.polygon_world, whole)) for region in regions]
        return tuple(region if polygon is region.polygon_world else replace(region, polygon_world=frozen(polygon))
                     for region, polygon in moved)

    def _move_mark(self, mark: Landmark, whole: bool | None) -> Landmark:
        lines = self.move(mark.lines_world, whole)
        return mark if lines is mark.lines_world else replace(mark, edges=replace(mark.edges, lines_world=lines))
