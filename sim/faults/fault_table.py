"""How a fault is written in a scenario file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from sim.body.faulty_body import AILMENTS
from sim.faults.faults import Ailment, Displacement, Fault, LightsOff, Moment, Occlusion
from world_models.bounds import Bounds, check_bounds
from world_models.entries.location import Place
from world_models.files.toml.settings import read_settings
from world_models.files.toml.source import Node

FAR_M = 5.0
"""Nobody is bumped or carried further, but to a place that is named."""
BOUNDS: Mapping[str, Bounds] = {
    "after_m": Bounds(0.0, 1e6),
    "after_s": Bounds(0.0, 1e6),
    "forward_m": Bounds(-FAR_M, FAR_M),
    "left_m": Bounds(-FAR_M, FAR_M),
    "turn_rad": Bounds(-2.0 * math.pi, 2.0 * math.pi),
    "distance_m": Bounds(0.0, FAR_M),
    "duration_s": Bounds(0.0, 1e6, above=True),
    "part": Bounds(0.0, 0.99, above=True),
    "to_x_m": Bounds(-1e5, 1e5),
    "to_y_m": Bounds(-1e5, 1e5),
    "to_heading_rad": Bounds(-2.0 * math.pi, 2.0 * math.pi),
}


@dataclass(frozen=True, slots=True)
class FaultTable:
    """Every key of a fault; which ones count depends on its kind."""

    kind: str = ""
    in_locale: str = ""
    after_m: float = 0.0
    after_s: float = 0.0
    forward_m: float = 0.0
    left_m: float = 0.0
    turn_rad: float = 0.0
    distance_m: float = 0.0
    duration_s: float = 10.0
    part: float = 0.2
    to_locale: str = ""
    to_x_m: float = 0.0
    to_y_m: float = 0.0
    to_heading_rad: float = 0.0

    def __post_init__(self) -> None:
        check_bounds(self, BOUNDS)


def read_fault(node: Node) -> Fault:
    """One of a scenario's ``[[faults]]``. Raises WorldError where it is none."""
    table = read_settings(node, FaultTable)
    moment = Moment(table.in_locale, table.after_m, table.after_s)
    if table.kind == "lights_off":
        return LightsOff(moment, table.duration_s)
    if table.kind == "occluded":
        return Occlusion(moment, table.duration_s, table.part)
    if table.kind in AILMENTS:
        return Ailment(table.kind, moment, table.duration_s)
    if table.kind not in ("bump", "kidnap"):
        kinds = f"kind = bump, kidnap, lights_off, occluded or one of {', '.join(AILMENTS)}"
        raise node.fail(kinds, repr(table.kind) if "kind" in node else "none")
    there = Place(table.to_locale, table.to_x_m, table.to_y_m, table.to_heading_rad) if table.to_locale else None
    return Displacement(
        table.kind, moment, table.forward_m, table.left_m, table.turn_rad, table.distance_m, there
    )
