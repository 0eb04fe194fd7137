"""Reading the table of a locale, with defaults for what it does not say."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world_models.building.geometry.faces import Finish
from world_models.building.geometry.outlines import is_simple
from world_models.building.locales import WORDS
from world_models.building.model_errors import SIGMA
from world_models.files.construction.specs import ROOM_HEIGHTS_M, LocaleSpec, RoomFinishes
from world_models.files.toml.placements import SharedParts, read_words
from world_models.files.toml.source import Node
from world_models.frames import Pose

RECTANGLE_WALLS = ("south", "east", "north", "west")
FINISH_KEYS = ("walls", "floor", "ceiling", "baseboard", "moulding", "frame", "leaf", "threshold")
LOCALE_KEYS = ("kind", "in", "at", "turn", "size", "outline", "height", "wall_heights", "sky", "like", "things",
               "properties", "survey", "sigma_cm", "words", *FINISH_KEYS[:5])
DEFAULT_KEYS = (*FINISH_KEYS, "kind", "in", "height", "door_width", "door_height")
MAX_SIGMA_CM = 100.0
GREY_WALL, GREY_FLOOR, WHITE_CEILING = Finish((0.8, 0.8, 0.76)), Finish((0.5, 0.5, 0.5)), Finish((0.9, 0.9, 0.9))


@dataclass
class LocaleReader:
    """Reads tables of locales and doors.

    Attributes:
        shared: finishes, parts and the unit of the file being read.
        defaults: of each key, the value and the unit of the file that gives it [m].
    """

    shared: SharedParts = field(default_factory=SharedParts)
    defaults: dict[str, tuple[Node, float]] = field(default_factory=dict)

    def read_defaults(self, root: Node) -> None:
        """Take the defaults of a file over those known so far."""
        if "defaults" in root:
            root["defaults"].table(optional=DEFAULT_KEYS)
        self.defaults.update({key: (node, self.shared.unit_m) for key, node in root.entries_of("defaults")})

    def read(self, name: str, node: Node, world_name: str) -> LocaleSpec:
        """A locale of the world. Raises WorldError."""
        kind = self._given(node, "kind")
        if kind is None:
            raise node.fail("the key 'kind'", f"keys {', '.join(node.value) or 'none'}")
        outline, walls = self._read_outline(node)
        height_m = self.length(node, "height", *ROOM_HEIGHTS_M, 2.7)
        unused = next((node[key] for key in FINISH_KEYS[:5] if outline is None and key in node), None)
        if unused is not None:
            raise unused.fail("a finish only in a locale with walls", f"one in {name}, which only contains others")
        finishes = self._read_finishes(node, walls)
        properties = read_properties(node.get("properties"))
        if "sky" in node and node["sky"].flag():
            finishes = replace(finishes, ceiling=None, moulding=None)
            properties["sky"] = True
        if "sigma_cm" in node:
            properties[SIGMA] = read_sigma(node)
        if words := self._read_all_words(node):
            properties[WORDS] = words
        survey_m, survey_rad = self._read_survey(node.get("survey"))
        return LocaleSpec(
            name, kind.text(), self._read_container(name, node, world_name), self.read_pose(node), outline, walls,
            height_m, finishes, properties, node.where, survey_m, survey_rad,
            self._read_wall_heights(node.get("wall_heights"), walls, height_m),
        )

    def length(
        self, node: Node, key: str, low_m: float, high_m: float, otherwise_m: float, default_key: str = ""
    ) -> float:
        """A length of this table, or of the defaults, which may be of a file in another unit, or else a value [m]."""
        if key in node:
            return self.shared.length(node[key], low_m, high_m)
        default = self.defaults.get(default_key or key)
        if default is None:
            return otherwise_m
        value, unit_m = default
        return value.number(low_m / unit_m, high_m / unit_m) * unit_m

    def finish(self, node: Node, key: str, otherwise: Finish) -> Finish:
        """A finish of this table, or of the defaults, or else a value."""
        given = self._given(node, key)
        return self.shared.finish(given) if given else otherwise

    def finish_or_none(self, node: Node, key: str, otherwise: Finish | None = None) -> Finish | None:
        """The same of what may be left out by ``"none"``."""
        given = self._given(node, key)
        if given is None:
            return otherwise
        return None if given.value == "none" else self.shared.finish(given)

    def read_pose(self, node: Node) -> Pose:
        """The coordinate frame given by ``at`` (x, y[, z]) and ``turn`` (degrees, counter-clockwise)."""
        limit = self.shared.max_coordinate
        at = node["at"].numbers((2, 3), -limit, limit) if "at" in node else (0.0, 0.0)
        turn_deg = node["turn"].number(-360.0, 360.0) if "turn" in node else 0.0
        x, y, z = (*at, 0.0)[:3]
        return pose_at((x, y, z), turn_deg, self.shared.unit_m)

    def _read_all_words(self, node: Node) -> str:
        """What people call a locale: its own words, and those of the finishes that its table names."""
        named = [self._given(node, key) for key in ("floor", "walls")] if "size" in node or "outline" in node else []
        values = [value for given in named if given is not None for value in _texts(given.value)]
        return ", ".join(filter(None, [read_words(node), *(self.shared.words.get(v) for v in dict.fromkeys(values))]))

    def _given(self, node: Node, key: str) -> Node | None:
        """The value of a key of this table, or else of the defaults."""
        return node.get(key) or (self.defaults[key][0] if key in self.defaults else None)

    def _read_container(self, name: str, node: Node, world_name: str) -> str:
        """Name of the locale that this one is in; the default container is itself in the root."""
        given = self._given(node, "in")
        return world_name if given is None or ("in" not in node and given.value == name) else given.text()

    def _read_survey(self, node: Node | None) -> tuple[float, float]:
        """Standard deviations [m, rad] of a frame's position and direction in its container."""
        if node is None:
            return 0.0, 0.0
        node.table(optional=("sigma", "sigma_deg"))
        sigma_m = self.shared.length(node["sigma"], 0.0) if "sigma" in node else 0.0
        return sigma_m, math.radians(node["sigma_deg"].number(0.0, 180.0)) if "sigma_deg" in node else 0.0

    def _read_outline(self, node: Node) -> tuple[NDArray[np.float64] | None, tuple[str, ...]]:
        """(k, 2) outline [m] and the names of its walls; None for a locale without walls."""
        if "size" in node and "outline" in node:
            raise node["outline"].fail("either size or outline", "both")
        unit_m, limit = self.shared.unit_m, self.shared.max_coordinate
        if "size" in node:
            width, depth = (v * unit_m for v in node["size"].numbers((2,), 0.1 / unit_m, limit))
            return np.array([(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)]), RECTANGLE_WALLS
        if "outline" in node:
            corners = [item.numbers((2,), -limit, limit) for item in node["outline"].items(min_count=3)]
            outline = np.array(corners) * unit_m
            if not is_simple(outline):
                raise node["outline"].fail("corners counter-clockwise round a room, without crossing or doubling")
            return outline, tuple(f"side-{index}" for index in range(len(outline)))
        return None, ()

    def _read_wall_heights(self, node: Node | None, walls: Sequence[str], height_m: float) -> Mapping[str, float]:
        """Heights of the walls that are lower than the room [m], by name."""
        if node is None:
            return {}
        heights = node.table(optional=tuple(walls))
        return {name: self.shared.length(item, 0.1, height_m) for name, item in heights.entries()}

    def _read_finishes(self, node: Node, walls: Sequence[str]) -> RoomFinishes:
        return RoomFinishes(
            self._read_wall_finishes(node, walls),
            self.finish(node, "floor", GREY_FLOOR), self.finish(node, "ceiling", WHITE_CEILING),
            self.finish_or_none(node, "baseboard"), self.finish_or_none(node, "moulding"),
        )

    def _read_wall_finishes(self, node: Node, walls: Sequence[str]) -> Mapping[str, Finish]:
        """One finish for all walls, or a list or a table of one for each."""
        given = self._given(node, "walls")
        if given is not None and isinstance(given.value, dict):
            given.table(tuple(walls))
            return {name: self.shared.finish(given[name]) for name in walls}
        if given is not None and isinstance(given.value, list):
            if len(given.value) != len(walls):
                raise given.fail(f"a finish for each of the {len(walls)} walls {', '.join(walls)}")
            return {name: self.shared.finish(item) for name, item in zip(walls, given.items(), strict=True)}
        return {name: self.finish(node, "walls", GREY_WALL) for name in walls}


def pose_at(at: tuple[float, float, float], turn_deg: float, unit_m: float = 1.0) -> Pose:
    """A coordinate frame at (x, y, z), in units of ``unit_m``, turned counter-clockwise about z."""
    turn = math.radians(turn_deg)
    c, s = (round(value, 15) for value in (math.cos(turn), math.sin(turn)))
    return Pose(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.array(at) * unit_m)


def read_sigma(node: Node) -> float:
    """How well a table's part of the building is known: a standard deviation [m]."""
    return 0.01 * node["sigma_cm"].number(0.0, MAX_SIGMA_CM)


def _texts(value: Any) -> list[str]:
    """The names of finishes: one, or one a wall in a list or a table."""
    return [value] if isinstance(value, str) else list(value.values() if isinstance(value, dict) else value)


def read_properties(node: Node | None) -> dict[str, Any]:
    """The ``properties`` of a locale: texts, numbers and flags."""
    if node is None:
        return {}
    for _, item in node.entries():
        if not isinstance(item.value, str | bool | int | float):
            raise item.fail("a text, a number, true or false")
    return dict(node.value)
