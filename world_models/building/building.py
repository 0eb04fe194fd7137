"""A building (§3.4) as it is asked about one locale at a time: hierarchy, coordinate frames, places, routes, scenes.

All that it knows are locale frames by name, and a frame comes only when it is asked for. So a robot in a room reads
that room.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.scene import LocaleGeometry, Scene, build_scene, concatenate_scenes
from world_models.building.locale_frame import LocaleFrame
from world_models.building.locales import Doorway, Link, Locale, LocaleExtent, Thing
from world_models.building.passages import Route, find_route
from world_models.frames import Pose, frozen

T = TypeVar("T")

FLOOR_MARGIN_M = 0.5
"""A camera this far above a room's ceiling or below its floor may still be in its doorway."""

MAX_SHOWN = 12
"""An error names at most so many locales."""

MAX_POSES = 4096
MAX_SCENES = 32
"""Sizes of the caches of coordinate frames and scenes."""


class Building(ABC):
    """A building; the root locale's coordinate frame is the world frame.

    Attributes:
        frames: of its locales, by name; one that is not at hand is fetched, or says how it can be had.
    """

    def __init__(self, frames: Mapping[str, LocaleFrame]) -> None:
        self.frames = frames

    @abstractmethod
    def cached(self, name: str, max_items: int, key: Hashable, compute: Callable[[], T]) -> T:
        """The result of a pure function of the building for a key; computed where it is not at hand.

        Args:
            name: of the function; the last ``max_items`` of its results are kept.
        """

    @abstractmethod
    def root_frame(self) -> LocaleFrame:
        """The frame of the locale that contains all others."""

    @property
    def root(self) -> str:
        """Name of the locale that contains all others."""
        return self.root_frame().name

    # -- one locale ------------------------------------------------------------------------------------------------

    def frame(self, name: str) -> LocaleFrame:
        """The frame of a locale. Raises ValueError where there is none."""
        try:
            return self.frames[name]
        except KeyError:
            names = list(self.frames)
            shown = ", ".join(names[:MAX_SHOWN])
            more = f" and {len(names) - MAX_SHOWN} more" if len(names) > MAX_SHOWN else ""
            raise ValueError(f"expected a locale of {self.root} ({shown}{more}), got {name!r}") from None

    def locale(self, name: str) -> Locale:
        """A locale by name. Raises ValueError where there is none."""
        return self.frame(name).locale

    def is_room(self, name: str) -> bool:
        """Whether this is a locale that contains no other."""
        return self.frame(name).extent.is_room

    def children_of(self, name: str) -> tuple[str, ...]:
        """The locales that this one contains directly."""
        return tuple(child.name for child in self.frame(name).children)

    def rooms_in(self, name: str) -> Iterator[str]:
        """The rooms within a locale, or the locale itself where it is a room."""
        if self.is_room(name):
            yield name
        for child in self.children_of(name):
            yield from self.rooms_in(child)

    def path_of(self, name: str) -> tuple[str, ...]:
        """The locales that contain this one, from the root down to itself."""
        path = [name]
        while (parent := self.locale(path[-1]).parent) is not None:
            path.append(parent)
        return tuple(reversed(path))

    def common(self, *names: str) -> str:
        """The smallest locale that contains all of these."""
        paths = [self.path_of(name) for name in names]
        shared = self.root
        for steps in zip(*paths, strict=False):
            if len(set(steps)) == 1:
                shared = steps[0]
        return shared

    def world_from_locale(self, name: str) -> Pose:
        """Pose of a locale's coordinate frame."""
        return self._poses_of(name)[0]

    def floor_m(self, name: str) -> float:
        """Height of a locale's floor [m, world]."""
        return float(self.world_from_locale(name).translation[2])

    def _poses_of(self, name: str) -> tuple[Pose, Pose]:
        """world_from_locale and locale_from_world; cached."""
        return self.cached("poses", MAX_POSES, name, lambda: self._compute_poses(name))

    def _compute_poses(self, name: str) -> tuple[Pose, Pose]:
        locale = self.locale(name)
        above = self.world_from_locale(locale.parent) if locale.parent is not None else Pose.identity()
        pose = above @ locale.frame
        return pose, pose.inverse()

    def doorways_of(self, locale: str) -> tuple[Doorway, ...]:
        """The open doorways of a locale, in the order of the file."""
        return self.frame(locale).doorways

    def links_of(self, locale: str) -> tuple[Link, ...]:
        """The elevators and stairs that stop in a locale."""
        return self.frame(locale).links

    def things_of(self, locale: str) -> tuple[Thing, ...]:
        """The things that stand in a locale."""
        return self.frame(locale).things

    def outline(self, locale: str) -> NDArray[np.float64]:
        """(k, 2) free extent of a locale on the floor, counter-clockwise, to the walls as they are drawn [m, world]."""
        own = self.locale(locale).outline
        outline = self.world_from_locale(locale).apply(np.column_stack([own, np.zeros(len(own))]))[:, :2]
        for change in self.frame(locale).changes:
            if change.what == "beside" and change.shift.is_wall:
                outline = change.shift.move(outline)
        return frozen(outline)

    def obstacles(self, locale: str) -> tuple[NDArray[np.float64], ...]:
        """Footprints (k, 2) of the things in a locale that the robot could hit [m, world]."""
        return tuple(t.footprint_world for t in self.things_of(locale) if t.is_obstacle)

    # -- places and routes -----------------------------------------------------------------------------------------

    def locale_at(self, point_world: Any) -> str | None:
        """The deepest locale that contains a point (2,) on the floor or (3,) [m, world]."""
        p = np.asarray(point_world, float)
        if p.shape not in ((2,), (3,)):
            raise ValueError(f"expected a point (2,) or (3,), got shape {p.shape}")
        best: tuple[int, str] | None = None
        for name in self._near(p, 0.0):
            world_from_locale, locale_from_world = self._poses_of(name)
            lifted = p if p.size == 3 else np.array([*p, world_from_locale.translation[2]])
            depth = len(self.path_of(name))
            if (best is None or depth > best[0]) and self.locale(name).contains(locale_from_world.apply(lifted)):
                best = depth, name
        return best[1] if best else None

    def rooms_near(self, point_world: Any, margin_m: float) -> tuple[str, ...]:
        """The rooms whose bounding rectangle is at most ``margin_m`` from a point (2,) or (3,) [m, world]."""
        p = np.asarray(point_world, float)
        rooms = (name for name in self._near(p, margin_m) if self.is_room(name))
        return tuple(name for name in rooms if p.size == 2 or self._reaches(name, float(p[2])))

    def _near(self, point: NDArray[np.float64], margin_m: float) -> list[str]:
        z_m = float(point[2]) if point.size == 3 else None
        return self.near(float(point[0]), float(point[1]), margin_m, z_m)

    def near(self, x_m: float, y_m: float, margin_m: float, z_m: float | None = None) -> list[str]:
        """Locales whose bounding rectangle, grown by a margin, holds a point [m, world]; in the order of the file.

        It goes from the root down, into each locale that reaches the point; with ``z_m`` those on other floors than
        that height are left out.
        """
        found: list[LocaleExtent] = []
        todo = [self.root_frame().extent]
        while todo:
            here = todo.pop()
            if not here.reaches(x_m, y_m, margin_m):
                continue
            if z_m is not None and not here.reaches_height(z_m, FLOOR_MARGIN_M):
                continue
            if here.is_near(x_m, y_m, margin_m):
                found.append(here)
            if not here.is_room:
                todo += self.frames[here.name].children
        return [extent.name for extent in sorted(found, key=lambda extent: extent.number)]

    def _reaches(self, name: str, z_m: float) -> bool:
        """Whether a height is between floor and ceiling of a locale, within FLOOR_MARGIN_M."""
        base = self.floor_m(name)
        return base - FLOOR_MARGIN_M <= z_m <= base + self.locale(name).height_m + FLOOR_MARGIN_M

    def route(self, origin: str, destination: str, avoided: Iterable[Doorway | Link] = ()) -> Route | None:
        """The route from room to room at the highest level at which they differ; None where there is none.

        Args:
            avoided: passages that are not to be used, besides those that are believed shut.
        """
        for name in (origin, destination):
            self.locale(name)
        return find_route(self.frames, origin, destination, (*self.shut_doorways(), *avoided))

    def shut_doorways(self) -> tuple[Doorway, ...]:
        """The doorways that the file has open and that are believed shut."""
        return ()

    # -- what is seen ----------------------------------------------------------------------------------------------

    def scene_of(self, locales: Iterable[str]) -> Scene:
        """Model lines and surfaces of these locales, with those shared with neighbours, as arrays; cached."""
        names = tuple(sorted(locales))
        return self.cached("scenes", MAX_SCENES, names, lambda: self._join(names))

    def _join(self, locales: Iterable[str]) -> Scene:
        parts = self.parts_of(locales)
        scenes = [parts[key].scene for key in sorted(parts, key=str)]
        return concatenate_scenes(scenes) if scenes else build_scene((), ())

    def parts_of(self, locales: Iterable[str]) -> dict[tuple[str, str | None], LocaleGeometry]:
        """The geometry of several locales, each part once, by (locale, neighbour)."""
        return {(part.locale, part.neighbour): part for name in locales for part in self.frame(name).parts}
