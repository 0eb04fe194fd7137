"""Bring your own simulator: a flat painted with a depth buffer, and a robot that drives in it; one file, no more.

    python examples/own_simulator.py

docs/how-to/own-simulator.md explains it, part by part.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import harvey  # before numpy: so the same run is decided the same on every machine

# isort: split
import cv2
import numpy as np
from numpy.typing import NDArray

from harvey.hardware.hardware_mission import HardwareMission, load_mission
from harvey.hardware.own_body import OwnBody, build_robot, drive_body
from world_models.building.world import World
from world_models.camera import Camera, CameraMount
from world_models.entries import MotionReport, MotorCommand
from world_models.files.toml.camera_file import camera_text
from world_models.frames import Pose, Pose2

ROOT = Path(__file__).parents[1]
NEAR_M, FINE = 0.05, 2
"""What is nearer is not painted; pictures are painted so many times larger, then made smaller: edges are soft."""


def paint(world: World, camera: Camera, camera_from_world: Pose) -> NDArray[np.uint8]:
    """(height, width, 3) red, green, blue: each surface into a depth buffer."""
    size = camera.height * FINE, camera.width * FINE
    image, nearness = np.zeros((*size, 3), np.float32), np.zeros(size, np.float32)
    columns, rows = np.meshgrid(*((np.arange(n, dtype=np.float32) + 0.5) / FINE - 0.5 for n in size[::-1]))
    for face in world.faces:
        for region in (*face.front, *face.back):
            corners = camera_from_world.apply(region.polygon_world)
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[1])
            facing = float(normal @ corners[0])
            ends = [end for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True) for end in clip(a, b)]
            if facing >= -1e-12 or len(ends) < 3:  # seen from behind, or behind the camera
                continue
            seen = np.clip((camera.project(np.array(ends)) + 0.5) * FINE - 0.5, -1e4, 1e4).round().astype(np.int32)
            mask = np.zeros(size, np.uint8)
            cv2.fillPoly(mask, [seen], 1)
            u, v, wide, high = cv2.boundingRect(seen)
            part = slice(max(v, 0), max(v + high, 0)), slice(max(u, 0), max(u + wide, 0))
            x, y, z = normal / facing  # 1 / depth is linear in the picture
            near = x * (columns[part] - camera.cx) / camera.fx + y * (rows[part] - camera.cy) / camera.fy + z
            drawn = (mask[part] > 0) & (near > nearness[part])
            nearness[part][drawn] = near[drawn]
            upright = camera_from_world.rotation.T @ normal / np.linalg.norm(normal)
            image[part][drawn] = 255.0 * np.array(region.colour) * (0.75 + 0.2 * upright @ (0.3, 0.5, 0.8))
    fine = np.asarray(cv2.resize(image, (camera.width, camera.height), interpolation=cv2.INTER_AREA))
    return fine.clip(0, 255).astype(np.uint8)


def clip(a: NDArray[np.float64], b: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """What of an edge's start, and of where it crosses the near plane, belongs to the polygon before the camera."""
    crossing = [a + (NEAR_M - a[2]) / (b[2] - a[2]) * (b - a)] if (a[2] > NEAR_M) != (b[2] > NEAR_M) else []
    return [a, *crossing] if a[2] > NEAR_M else crossing


class PaintedRobot(OwnBody):
    """A robot whose wheels slip a little, and whose camera sees the painted flat."""

    def __init__(self, mission: HardwareMission, start: Pose2, seed: int) -> None:
        self.robot, self.world = build_robot(mission), harvey.load_world(mission.world)
        self.pose, self.rng, self.clock_s = start, np.random.default_rng(seed), 0.0

    @property
    def time_s(self) -> float:
        return self.clock_s

    def execute(self, command: MotorCommand, /) -> MotionReport:
        wheels, took_s = self.robot.actuator, abs(command.turn_rad) + command.move_m / 0.5
        turned = command.turn_rad * (1.0 + self.rng.normal(0.0, wheels.turn_sigma))
        moved = command.move_m * (1.0 + self.rng.normal(0.0, wheels.reach_sigma))
        self.pose = self.pose @ wheels.predict_motion(turned, moved, self.rng.normal(0.0, wheels.curvature_sigma_per_m))
        self.clock_s += took_s
        return MotionReport(command.turn_rad, command.move_m, took_s, self.clock_s)  # what the wheels claim

    def see(self, purpose: str, /) -> NDArray[np.uint8]:
        self.clock_s += 0.1
        return paint(self.world, self.robot.lens, self.robot.camera_from_world(self.pose))

    def wait(self, duration_s: float, /) -> float:
        self.clock_s += duration_s
        return self.clock_s


def main(folder: Path) -> float:
    """Drive in the flat, from the hall to the kitchen; return how far from its goal it truly ended [m]."""
    camera = Camera.from_field_of_view(math.radians(70.0), 480, 360)
    (folder / "camera.toml").write_text(camera_text(camera, CameraMount(1.0, 0.05, math.radians(3.0))), "utf-8")
    mission = load_mission(ROOT / "docs/flat/mission.toml",
                           {"camera.calibration": str(folder.resolve() / "camera.toml"), "actuator.reach": 1.0})
    feet = 0.3048  # the mission says: hall (4, 3), looking north; kitchen (6, 5), whose corner is at (8.5, 0)
    body = PaintedRobot(mission, Pose2(4.0 * feet + 0.02, 3.0 * feet - 0.01, math.radians(91.0)), seed=0)
    result = drive_body(mission, body, out=folder / "run")
    off_m = math.hypot(body.pose.x_m - 14.5 * feet, body.pose.y_m - 5.0 * feet)
    print(f"{result.outcome}: {result.reason}; truly {1000.0 * off_m:.0f} mm from the goal: harvey view {folder}/run")
    return off_m


if __name__ == "__main__":
    where = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/own-simulator")
    where.mkdir(parents=True, exist_ok=True)
    sys.exit(0 if main(where) < 0.1 else 1)
