"""What the truth says of obstacles: which are false, which stops were needless, and how short the way could have been.

The robot's model lacks what is solid in the building and not in the world file: things of its details files, extras
and leaves of its truth.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from sim.body.collision import Obstacles, find_free_floor, find_shortest_way
from sim.differences.table import NO_DIFFERENCES
from sim.scenario import Scenario
from sim.stage import Stage, build_stage
from world_models.frames import Pose2

Segments = NDArray[np.float64]
Corners = Sequence[tuple[float, float]]

SAME_M = 0.02
"""What is this near to something of the model, the model has: a poster on a wall."""
MAX_OFF_M = 0.15
"""An obstacle is false where nothing that the model lacks is as near as this to its footprint."""
NEAR_M = 2.0
"""A stop is needless where nothing that the model lacks is as near as this to the robot's axis."""


@dataclass(frozen=True, eq=False)
class Lacking:
    """Everything solid that the robot's model lacks, on the floor plane [m, world]."""

    lines: shapely.Geometry

    @staticmethod
    def of_segments(true: Segments, model: Segments) -> Lacking:
        """What of the true segments (n, 2, 2) is not among those of the model."""
        known = shapely.buffer(shapely.union_all(shapely.linestrings(model)), SAME_M) if len(model) else None
        lines = shapely.union_all(shapely.linestrings(true)) if len(true) else shapely.MultiLineString()
        return Lacking(lines if known is None else shapely.difference(lines, known))

    @staticmethod
    def of_stage(stage: Stage) -> Lacking:
        """What the building of a stage has beside its world file."""
        model = build_stage(_without_difference(stage.scenario)).building.obstacles
        return Lacking.of_segments(stage.building.obstacles.segments_world, model.segments_world)

    def distance_m(self, corners: Corners) -> float:
        """From a footprint, or a point, to the nearest of it; infinite where the model lacks nothing."""
        distance = float(shapely.distance(_shape(corners), self.lines))
        return math.inf if math.isnan(distance) else distance

    def is_false(self, footprint: Corners) -> bool:
        """Whether an obstacle is where nothing is that the model lacks."""
        return self.distance_m(footprint) > MAX_OFF_M

    def is_needless(self, x_m: float, y_m: float) -> bool:
        """Whether a stop here has no reason in the truth."""
        return self.distance_m([(x_m, y_m)]) > NEAR_M


def _without_difference(scenario: Scenario) -> Scenario:
    """The same in a building that is as its world file says."""
    return replace(scenario, details=(), truth=NO_DIFFERENCES, told=(), moved=(), faults=())


def _shape(corners: Corners) -> shapely.Geometry:
    """The hull of corners: a polygon, a line or a point."""
    return shapely.MultiPoint(np.asarray(corners, float)).convex_hull


def find_shortest_m(obstacles: Obstacles, start: Pose2, goal: Pose2) -> float | None:
    """The length of the shortest way that the truth allows, touching allowed [m]; None where there is none."""
    way = find_shortest_way(find_free_floor(obstacles), start, goal)
    return None if way is None else float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())


def judge(outcome: str, shortest_m: float | None) -> str:
    """How a mission ended, by the truth: an outcome, where ``blocked`` is right or wrong."""
    if outcome != "blocked":
        return outcome
    return "blocked rightly" if shortest_m is None else "blocked wrongly"


def count_stops(motions: Iterable[str]) -> int:
    """How often the robot stopped for the floor: looks and creeps in a row, with no other motion between, are one.

    Args:
        motions: ``go``, ``look`` (for the floor) and ``creep``, in the order of the run.
    """
    stops, before = 0, "go"
    for motion in motions:
        stops += motion != "go" and before == "go"
        before = motion
    return stops
