"""A watcher of the floor that sees what the model has, and things that a test puts there: for tests of the motion."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import shapely

from blackboard import Change, Effect, Entry, Level, Post, Posted, View, Watch
from knowledge_sources.methods.floor import find_floor
from knowledge_sources.reads import find_belief, find_building, find_robot
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.entries import CameraPicture, FreeFloor, Hypothesis
from world_models.frames import Pose2

FAR_M = 8.0


class IdealFloorWatcher(RobotKnowledgeSource):
    """Posts after each picture what a perfect eye would see of the floor."""

    level = Level.ACTION
    on = (Watch(CameraPicture, (Posted,)),)
    writes = (FreeFloor,)

    def bind(self, view: View, trigger: Change) -> tuple[Entry[Hypothesis], Entry[CameraPicture]] | None:
        belief, frame = find_belief(view), view.latest(CameraPicture)
        return None if belief is None or frame is None else (belief, frame)

    def act(self, view: View, case: tuple[Entry[Hypothesis], Entry[CameraPicture]]) -> Iterable[Effect]:
        belief, frame = case
        robot, building = find_robot(view), find_building(view)
        pose = belief.value.world_from_robot(building)
        near = building.rooms_near(pose.position, 6.0)
        scan = scan_floor(find_floor(building, near), pose, belief.value.locale, frame.value.sim_time_s,
                          forward_m=robot.mount.forward_m)
        yield Post(scan, (frame, belief))


def scan_floor(
    floor: shapely.Geometry, pose: Pose2, locale: str = "room", seen_s: float = 0.0, *, forward_m: float = 0.1,
    count: int = 64, things: Sequence[shapely.Geometry] = (), near_m: float = 1.26,
    half_rad: float = math.radians(32.0),
) -> FreeFloor:
    """What a perfect eye sees of a floor with things on it."""
    x = pose.x_m + forward_m * math.cos(pose.heading_rad)
    y = pose.y_m + forward_m * math.sin(pose.heading_rad)
    bearings = pose.heading_rad + np.linspace(-half_rad, half_rad, count)
    solid = shapely.union_all(list(things)) if things else shapely.Polygon()
    far, ends = [], []
    for bearing in bearings:
        ray = shapely.LineString([(x, y), (x + FAR_M * math.cos(bearing), y + FAR_M * math.sin(bearing))])
        by_model = _cut(ray, floor, x, y)
        blocked = ray.intersection(solid)
        by_thing = math.inf if blocked.is_empty else float(shapely.Point(x, y).distance(blocked))
        far.append(min(by_model, by_thing))
        ends.append("thing" if by_thing < by_model else "model" if by_model < FAR_M - 1e-6 else "sight")
    return FreeFloor("camera", locale, x, y, tuple(map(float, bearings)), tuple(
        float(near_m / math.cos(b - pose.heading_rad)) for b in bearings), tuple(far), tuple(ends),
        tuple(0.02 for _ in bearings), (), seen_s, confirmed_m=tuple(far))


def _cut(ray: shapely.LineString, floor: shapely.Geometry, x: float, y: float) -> float:
    """How far a ray goes over the floor."""
    outside = ray.difference(floor)
    return FAR_M if outside.is_empty else float(shapely.Point(x, y).distance(outside))
