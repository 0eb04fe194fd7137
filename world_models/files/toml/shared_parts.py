"""What world files share: units, finishes, and the parts that things are made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from world_models.building.geometry.regions import TEXTURES, Finish
from world_models.building.geometry.solids import Box, Range
from world_models.files.toml.source import Node
from world_models.units import FOOT_M

UNITS_M: Mapping[str, float] = {"feet": FOOT_M, "metres": 1.0}
MAX_COORDINATE_M = 10_000.0
MIN_LENGTH_M = 0.001


@dataclass
class SharedParts:
    """Finishes and parts read so far, by name, and the unit of length of the file being read [m]."""

    unit_m: float = 1.0
    finishes: dict[str, Finish] = field(default_factory=dict)
    parts: dict[str, tuple[Box, ...]] = field(default_factory=dict)

    def read(self, root: Node) -> None:
        """Add the finishes and parts of a file, and take its unit; raises WorldError for a name given before."""
        self.unit_m = UNITS_M[root["units"].choice(*UNITS_M)]
        for name, node in root.entries_of("finishes"):
            _check_new(name, node, self.finishes)
            self.finishes[name] = self._read_finish(node)
        for name, node in root.entries_of("parts"):
            _check_new(name, node, self.parts)
            self.parts[name] = self.read_boxes(node, None)

    def _read_finish(self, node: Node) -> Finish:
        node.table(("colour",), ("texture", "scale"))
        red, green, blue = node["colour"].numbers((3,), 0.0, 1.0)
        texture = node["texture"].choice(*TEXTURES) if "texture" in node else "plain"
        scale = self.length(node["scale"], MIN_LENGTH_M, 100.0) if "scale" in node else 0.1
        return Finish((red, green, blue), texture, scale)

    def finish(self, node: Node) -> Finish:
        """The finish that a text names."""
        if not isinstance(node.value, str) or node.value not in self.finishes:
            raise node.fail(f"one of the finishes {', '.join(self.finishes) or '(none)'}")
        return self.finishes[node.value]

    def part(self, node: Node) -> tuple[Box, ...]:
        """The part that a text names."""
        if not isinstance(node.value, str) or node.value not in self.parts:
            raise node.fail(f"one of the parts {', '.join(self.parts) or '(none)'}")
        return self.parts[node.value]

    def read_boxes(self, node: Node, finish: Finish | None) -> tuple[Box, ...]:
        """A list of boxes; ``finish`` is for boxes that name none."""
        return tuple(box for item in node.items(min_count=1) for box in self._read_box(item, finish))

    def _read_box(self, node: Node, finish: Finish | None) -> list[Box]:
        """One box, or five for a box with a rim; with ``twin``, also those mirrored at x = 0."""
        needed = ("x", "y", "z") if finish else ("x", "y", "z", "finish")
        rimmed = ("rim_width",) if "rim" in node.table(needed, ("finish", "rim", "rim_width", "twin")) else ()
        node.table((*needed, *rimmed), ("finish", "rim", "twin"))
        own = self.finish(node["finish"]) if "finish" in node else finish
        assert own is not None
        box = Box(self._read_range(node["x"]), self._read_range(node["y"]), self._read_range(node["z"]), own)
        boxes = self._add_rim(box, node) if rimmed else [box]
        twin = "twin" in node and node["twin"].flag()
        return boxes + [replace(box, x=(-box.x[1], -box.x[0])) for box in boxes if twin]

    def _add_rim(self, box: Box, node: Node) -> list[Box]:
        """A board set into a rim that protrudes by the full depth of the box."""
        rim, width = self.finish(node["rim"]), self.length(node["rim_width"], MIN_LENGTH_M)
        (x0, x1), (y0, y1), (z0, z1) = box.ranges
        if min(x1 - x0, z1 - z0) < 2 * width + MIN_LENGTH_M:
            raise node["rim_width"].fail("a rim that leaves something of the board")
        inside = Box((x0 + width, x1 - width), (y0, y0 + 0.4 * (y1 - y0)), (z0 + width, z1 - width), box.finish)
        rims = [((x0, x1), (z0, z0 + width)), ((x0, x1), (z1 - width, z1)),
                ((x0, x0 + width), inside.z), ((x1 - width, x1), inside.z)]
        return [inside, *(Box(x, box.y, z, rim) for x, z in rims)]

    def _read_range(self, node: Node) -> Range:
        low, high = (value * self.unit_m for value in node.numbers((2,), -self.max_coordinate, self.max_coordinate))
        if high - low < MIN_LENGTH_M:
            raise node.fail(f"a range [low, high] of at least {MIN_LENGTH_M / self.unit_m:g}")
        return low, high

    def length(self, node: Node, low_m: float, high_m: float = MAX_COORDINATE_M) -> float:
        """A length within bounds [m]."""
        return node.number(low_m / self.unit_m, high_m / self.unit_m) * self.unit_m

    def coordinate(self, node: Node) -> float:
        """A coordinate [m]."""
        return node.number(-self.max_coordinate, self.max_coordinate) * self.unit_m

    @property
    def max_coordinate(self) -> float:
        """Largest allowed coordinate, in units of the file."""
        return MAX_COORDINATE_M / self.unit_m


def _check_new(name: str, node: Node, known: dict[str, Any]) -> None:
    if name in known:
        raise node.fail("a new name", f"{name!r}, which the world file has already")
