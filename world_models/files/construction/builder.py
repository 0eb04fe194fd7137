"""Building a world from its spec: poses, openings for doors, then faces and model lines of rooms, doors and things."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.faces import Face
from world_models.building.geometry.landmarks import Landmark
from world_models.building.geometry.solids import Solid
from world_models.building.locales import ROBOT_TOP_M, Doorway, Finding, Link, Locale, Thing
from world_models.building.world import World, build_frames
from world_models.files.construction.doors import LEAF_DEPTH_M, DoorSide, build_closed_door, build_open_door
from world_models.files.construction.rooms import (
    CASING_WIDTH_M,
    MIN_STRETCH_M,
    Opening,
    RoomShell,
    Wall,
    build_walls,
    coordinate_along_wall,
)
from world_models.files.construction.specs import DoorSpec, LinkSpec, LocaleSpec, ThingSpec, WorldSpec
from world_models.frames import Pose, Pose2, flattened

MAX_WALL_M = 0.9
"""Walls of two rooms further apart than this are not the two sides of one wall, not even in an old house."""

CONTAINER_MARGIN_M = 0.3
"""How far a locale without walls reaches beyond the locales in it."""


def build_world(spec: WorldSpec) -> World:
    """The world that a spec describes; what cannot be built is left out and is in ``World.building_faults``."""
    builder = _WorldBuilder(spec)
    builder.cut_openings()
    builder.build_rooms()
    builder.build_doors()
    builder.place_things()
    landmarks = [mark for mark in builder.landmarks if len(mark.edges)]
    links = [_build_link(link, builder.poses) for link in spec.links]
    locales = _build_locales(spec, builder.poses)
    frames = build_frames(locales, builder.doorways, builder.faces, landmarks, builder.things, links)
    return World(frames, builder.faults)


def compute_world_poses(locales: Mapping[str, LocaleSpec], root: str) -> dict[str, Pose]:
    """world_from_locale of every locale; the root's frame is the world's."""
    poses = {root: Pose.identity()}

    def pose_of(name: str) -> Pose:
        if name not in poses:
            poses[name] = pose_of(locales[name].parent) @ locales[name].frame
        return poses[name]

    for name in locales:
        pose_of(name)
    return poses


@dataclass
class _WorldBuilder:
    """A world while it is built, in the order of the public methods."""

    spec: WorldSpec
    poses: dict[str, Pose] = field(init=False)
    walls: dict[str, dict[str, Wall]] = field(init=False)
    shells: dict[str, RoomShell] = field(default_factory=dict)
    cuts: list[tuple[DoorSpec, list[tuple[str, str, Opening]]]] = field(default_factory=list)
    doorways: list[Doorway] = field(default_factory=list)
    faces: list[Face] = field(default_factory=list)
    landmarks: list[Landmark] = field(default_factory=list)
    things: list[Thing] = field(default_factory=list)
    faults: list[Finding] = field(default_factory=list)

    def __post_init__(self) -> None:
        locales = self.spec.locales
        self.poses = compute_world_poses(locales, self.spec.name)
        self.walls = {name: {w.name: w for w in build_walls(spec, self.poses[name])} for name, spec in locales.items()}

    def cut_openings(self) -> None:
        """Cut the openings of all doors, before any wall gets its face."""
        for door in self.spec.doors:
            try:
                openings = self._find_openings(door)
            except _CannotBuildError as problem:
                self.faults.append(Finding(door.source, f"door {door.name}: {problem}"))
                continue
            for room, wall, opening in openings:
                self.walls[room][wall] = self.walls[room][wall].with_opening(opening)
            self.cuts.append((door, openings))

    def _find_openings(self, door: DoorSpec) -> list[tuple[str, str, Opening]]:
        """(room, wall, opening) on one or both sides of a door's wall. Raises _CannotBuildError."""
        near = self.walls[door.between[0]][door.wall]
        wall_from_locale = near.world_from_wall.inverse() @ self.poses[door.between[0]]
        across = _coordinate_along(near.name, wall_from_locale, door.along_m)
        half = door.width_m / 2
        neighbours = (*door.between[1:], None) if door.is_open else (None,)
        frame_m = CASING_WIDTH_M if door.casing else 0.0
        opening = _fit(near, Opening(door.name, across - half, across + half, door.height_m, neighbours[0], frame_m))
        if len(door.between) == 1:
            return [(near.locale, near.name, opening)]
        ends_world = near.world_from_wall.apply([(across - half, 0, 0), (across + half, 0, 0)])
        far = self._find_far_opening(door, near, ends_world)
        return [(near.locale, near.name, opening), (*far[:2], _fit(self.walls[far[0]][far[1]], far[2]))]

    def _find_far_opening(
        self, door: DoorSpec, near: Wall, ends_world: NDArray[np.float64]
    ) -> tuple[str, str, Opening]:
        """(room, wall, opening) in the nearest wall of the second room behind the first one's. Raises."""
        best: tuple[float, Wall, Opening] | None = None
        for wall in self.walls[door.between[1]].values():
            ends = wall.world_from_wall.inverse().apply(ends_world)
            faces_back = float(wall.inward_world @ near.inward_world) < -0.999
            behind = -MAX_WALL_M <= ends[0, 1] <= 1e-6
            if faces_back and behind and ends[1, 0] >= -MIN_STRETCH_M and ends[0, 0] <= wall.length_m + MIN_STRETCH_M:
                neighbour = door.between[0] if door.is_open else None
                frame_m = CASING_WIDTH_M if door.casing else 0.0
                opening = Opening(door.name, float(ends[1, 0]), float(ends[0, 0]), door.height_m, neighbour, frame_m)
                if best is None or -ends[0, 1] < best[0] - 1e-9:
                    best = -float(ends[0, 1]), wall, opening
        if best is not None:
            return best[1].locale, best[1].name, best[2]
        raise _CannotBuildError(f"expected a wall of {door.between[1]} behind the {door.wall} wall of "
                                f"{door.between[0]}, got none there: the doorway leads nowhere")

    def build_rooms(self) -> None:
        """Floors, ceilings, walls and trim."""
        for name, spec in self.spec.locales.items():
            if spec.outline is None:
                continue
            shell = RoomShell(spec, tuple(self.walls[name].values()), self.poses[name])
            self.shells[name] = shell
            self.faces += shell.faces()
            self.landmarks += shell.landmarks()

    def build_doors(self) -> None:
        """Casings, jambs, thresholds and leaves."""
        for door, openings in self.cuts:
            sides = [self._build_door_side(door, room, wall, opening) for room, wall, opening in openings]
            if door.is_open:
                built = [build_open_door(sides[0], sides[1])]
                self.doorways.append(_build_doorway(door, sides))
            else:
                built = [build_closed_door(side) for side in sides]
            for faces, landmark in built:
                self.faces += faces
                self.landmarks.append(landmark)

    def _build_door_side(self, door: DoorSpec, room: str, wall: str, opening: Opening) -> DoorSide:
        here, floor = self.walls[room][wall], self.spec.locales[room].finishes.floor
        depth = LEAF_DEPTH_M
        if len(door.between) == 2:
            thickness = _wall_thickness(self.walls[door.between[0]][door.wall], here, self.walls, door)
            depth = thickness if door.is_open else min(LEAF_DEPTH_M, 0.45 * thickness)
        return DoorSide(door, here, opening, depth, floor)

    def place_things(self) -> None:
        """Furniture and the like."""
        for spec in self.spec.things:
            shell = self.shells[spec.locale]
            pose = self._pose_of_thing(spec)
            name = f"{spec.locale}/{spec.name}"
            solid = Solid(name, spec.boxes, pose, shell.surfaces)
            self.faces += solid.faces(spec.locale)
            self.landmarks.append(Landmark(name, spec.locale, spec.kind, solid.edges(), source=spec.source))
            self.things.append(_build_thing(spec, name, pose))

    def _pose_of_thing(self, spec: ThingSpec) -> Pose:
        world_from_locale = self.poses[spec.locale]
        if spec.locale_from_part is not None:
            return world_from_locale @ spec.locale_from_part
        wall = self.walls[spec.locale][str(spec.wall)]
        across = _coordinate_along(wall.name, wall.world_from_wall.inverse() @ world_from_locale, spec.along_m)
        if not 0 <= across <= wall.length_m:
            self.faults.append(Finding(
                spec.source, f"{spec.name}: expected a place on the {wall.name} wall of {spec.locale}, "
                             f"got one {across:.2f} m along its {wall.length_m:.2f} m"))
        return wall.world_from_wall @ Pose(np.eye(3), np.array([across, 0.0, spec.up_m]))


class _CannotBuildError(Exception):
    """A door that the walls do not allow."""


def _fit(wall: Wall, opening: Opening) -> Opening:
    """An opening in a wall; less than MIN_STRETCH_M of wall next to or above it is none.

    Raises _CannotBuildError where it is outside the wall, or over another opening.
    """
    left, right, top = opening.left_m, wall.length_m - opening.right_m, wall.height_m - opening.top_m
    if min(left, right, top) < -MIN_STRETCH_M:
        raise _CannotBuildError(
            f"expected an opening within the {wall.name} wall of {wall.locale} ({wall.length_m:.2f} m long, "
            f"{wall.height_m:.2f} m high), "
            f"got {opening.left_m:.2f} .. {opening.right_m:.2f} m, {opening.top_m:.2f} m high"
        )
    for other in wall.openings:
        if min(other.right_m - opening.left_m, opening.right_m - other.left_m) > MIN_STRETCH_M:
            raise _CannotBuildError(f"expected solid wall, got the opening of {other.name} in {wall.face_name}")
    return replace(opening, left_m=0.0 if left < MIN_STRETCH_M else opening.left_m,
                   right_m=wall.length_m if right < MIN_STRETCH_M else opening.right_m,
                   top_m=wall.height_m if top < MIN_STRETCH_M else opening.top_m)


def _coordinate_along(wall_name: str, wall_from_locale: Pose, along_m: float) -> float:
    """The wall's x of a place given as the locale's x or y (rectangles), or as distance from the wall's start [m]."""
    if wall_name in ("south", "north"):
        return coordinate_along_wall(wall_from_locale, (along_m, 0.0))
    if wall_name in ("east", "west"):
        return coordinate_along_wall(wall_from_locale, (0.0, along_m))
    return along_m


def _wall_thickness(near: Wall, here: Wall, walls: Mapping[str, Mapping[str, Wall]], door: DoorSpec) -> float:
    """Distance between the two sides of a door's wall [m]."""
    if here is not near:
        return float(abs((here.world_from_wall.translation - near.world_from_wall.translation) @ near.inward_world))
    backs = [w for w in walls[door.between[1]].values() if any(o.name == door.name for o in w.openings)]
    return _wall_thickness(near, backs[0], walls, door)


def _build_doorway(door: DoorSpec, sides: list[DoorSide]) -> Doorway:
    """The doorway, left jamb first as seen from inside each room: a wall's x runs to the left."""
    thresholds = [side.wall.world_from_wall.apply([(side.x[1], 0, 0), (side.x[0], 0, 0)])[:, :2] for side in sides]
    return Doorway(door.name, (door.between[0], door.between[1]), np.array(thresholds), door.height_m, door.source)


def _build_link(spec: LinkSpec, poses: Mapping[str, Pose]) -> Link:
    stops = [flattened(poses[room]) @ Pose2(*stop) for room, stop in zip(spec.between, spec.stops, strict=True)]
    return Link(spec.name, spec.kind, spec.between, np.array([(s.x_m, s.y_m, s.heading_rad) for s in stops]),
                spec.source)


def _build_thing(spec: ThingSpec, name: str, world_from_part: Pose) -> Thing:
    ranges = np.array([box.ranges for box in spec.boxes])
    low, high = ranges[..., 0].min(axis=0), ranges[..., 1].max(axis=0)
    reached = ranges[ranges[:, 2, 0] + spec.up_m < ROBOT_TOP_M]
    near, far = (reached[..., 0].min(axis=0), reached[..., 1].max(axis=0)) if len(reached) else (low, high)
    corners = [(near[0], near[1], 0), (far[0], near[1], 0), (far[0], far[1], 0), (near[0], far[1], 0)]
    return Thing(name, spec.locale, spec.kind, world_from_part.apply(corners)[:, :2],
                 spec.up_m + float(low[2]), spec.up_m + float(high[2]),
                 float(high[1]) if spec.wall else None, spec.source)


def _build_locales(spec: WorldSpec, poses: Mapping[str, Pose]) -> dict[str, Locale]:
    """All locales, root first, then in the order of the file; those without walls enclose the locales in them."""
    specs = spec.locales
    inside: dict[str, list[str]] = {}
    for name, s in specs.items():
        inside.setdefault(s.parent, []).append(name)
    corners = {name: _corners_within(name, inside, specs, poses)
               for name in (spec.name, *specs) if name == spec.name or specs[name].outline is None}
    root = _build_container(spec.name, "building", None, Pose.identity(), corners[spec.name], poses, {}, spec.source)
    out = {spec.name: root}
    for name, s in specs.items():
        if s.outline is None:
            out[name] = replace(
                _build_container(name, s.kind, s.parent, s.frame, corners[name], poses, s.properties, s.source),
                survey_m=s.survey_m, survey_rad=s.survey_rad)
        else:
            out[name] = Locale(name, s.kind, s.parent, s.frame, s.outline, s.height_m, s.properties, s.source,
                               survey_m=s.survey_m, survey_rad=s.survey_rad)
    return out


def _build_container(
    name: str, kind: str, parent: str | None, frame: Pose, corners_world: NDArray[np.float64],
    poses: Mapping[str, Pose], properties: Mapping[str, Any], source: str,
) -> Locale:
    corners = poses[name].inverse().apply(corners_world)
    (x0, y0, z0), (x1, y1, z1) = corners.min(axis=0), corners.max(axis=0)
    x0, y0, x1, y1 = x0 - CONTAINER_MARGIN_M, y0 - CONTAINER_MARGIN_M, x1 + CONTAINER_MARGIN_M, y1 + CONTAINER_MARGIN_M
    outline = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    return Locale(name, kind, parent, frame, outline, float(z1) + CONTAINER_MARGIN_M, properties, source, float(z0))


def _corners_within(
    name: str, inside: Mapping[str, Sequence[str]], specs: Mapping[str, LocaleSpec], poses: Mapping[str, Pose],
) -> NDArray[np.float64]:
    """(n, 3) floor and ceiling corners of all rooms that a locale contains [m, world]."""
    parts = [np.zeros((0, 3))]
    for child in inside.get(name, ()):
        spec = specs[child]
        parts.append(_corners_within(child, inside, specs, poses))
        if spec.outline is not None:
            parts += [poses[child].apply(np.column_stack([spec.outline, np.full(len(spec.outline), z)]))
                      for z in (0.0, spec.height_m)]
    return np.concatenate(parts)
