"""Cases for the milestone judge: believed pose, true pose, and the frame seen from there.

In a *right* case the true pose is drawn from the covariance of the believed one, as the actuator model gives it after a
leg with servoing (§3.2). In a wrong case it is a metre off, at another door, at the other side of the corridor, or on
another floor, with the same covariance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from experiments.generated.floors import Floor, generated_floor
from knowledge_sources.methods.verification import LOOK_TURNS_RAD, choose_heading, predict_milestone
from sim.body.simulated_building import SimulatedBuilding
from sim.render.sensor import Occluder, SensorParameters, compress_jpeg, expose
from sim.scenario import CameraSettings
from world_models.actuator import ActuatorModel
from world_models.building.geometry.outlines import inside_polygon
from world_models.entries import Hypothesis, Milestone
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

Floats = NDArray[np.float64]
ROOMS = 8
KINDS = ("right", "a metre off", "another door", "the other side", "another floor")
SHARES = (0.5, 0.14, 0.14, 0.1, 0.12)
MISSING_SHARE = 0.1
"""Share of the model's things that is missing in every other building."""
OCCLUDED, LIGHT_CHANGED = 0.3, 0.5
"""Shares of the cases."""
MAX_HIDDEN_SHARE = 0.2
MIN_CLEARANCE_M = 0.45
"""Distance of the robot from walls."""
MAX_TRIES = 400
CELL_PX, MIN_CELL_DIFFERENCE = 8, 0.04
"""Frames differ in a cell of this size if their mean brightness or colour differs by more than this, 0..1."""
MIN_DIFFERENCE = 0.02
"""Places are indistinguishable if the model differs in less than this share of the frame."""


@dataclass(frozen=True, eq=False)
class Site:
    """A floor with its buildings.

    Attributes:
        robot: the robot with its model. bare: the building as the model has it.
        buildings: with details that the model lacks; and in addition with parts of the model missing.
    """

    floor: Floor
    robot: RobotModel
    bare: SimulatedBuilding
    buildings: tuple[SimulatedBuilding, SimulatedBuilding]
    is_symmetric: bool


@dataclass(frozen=True, eq=False)
class Case:
    """One case.

    Attributes:
        kind: of :data:`KINDS`.
        belief: the held hypothesis; its heading is that of the look.
        alternative: a second hypothesis on the board; None if there is none.
        true: true pose, in the world of the floor that it is truly on.
        milestone: the milestone expected.
        jpeg: the frame seen.
        difference: share of the frame, 0..1, in which the model differs between the wrong and the believed place.
        hidden, missing, light: hidden share of the view, missing share of the model, and change of light.
    """

    kind: str
    belief: Hypothesis
    alternative: Hypothesis | None
    true: Pose2
    milestone: Milestone
    jpeg: bytes
    difference: float
    hidden: float
    missing: float
    light: float

    @property
    def is_elsewhere(self) -> bool:
        """Whether the true pose is of another floor."""
        return self.kind == "another floor"


def has_identical_doors(seed: int) -> bool:
    """Whether a floor has, without being symmetric."""
    return seed % 5 == 4


@lru_cache(maxsize=2)
def get_site(seed: int, textured: bool = False) -> Site:
    """Get the floor of a seed: every fifth is symmetric, every other fifth has identical doors.

    ``textured``: walls, floors and ceilings have tiles, bricks and planks, of which and of all colours the model says
    nothing.
    """
    symmetric, repeated = seed % 5 == 3, seed % 5 == 3 or has_identical_doors(seed)
    known = built = generated_floor(seed, ROOMS, symmetric=symmetric, repeated=repeated)
    bare = known.world
    if textured:
        known, built, bare = known.plan, known.textured(np.random.default_rng([seed, 2])), known.grey.world
    settings = CameraSettings()
    robot = RobotModel(known.world, settings.camera, settings.mount, ActuatorModel())
    buildings = (SimulatedBuilding.of_faces(built.building.faces),
                 SimulatedBuilding.of_faces(built.altered(MISSING_SHARE).faces))
    return Site(known, robot, SimulatedBuilding.of_faces(bare.faces), buildings, symmetric)


def generate_cases(floor_seed: int, first: int, count: int, textured: bool = False) -> Iterator[Case]:
    """Generate cases ``first``, ``first + 1``, ... of a floor; each is determined by its number."""
    for number in range(first, first + count):
        rng = np.random.default_rng([floor_seed, number])
        kind = str(rng.choice(KINDS, p=SHARES))
        yield _generate_case(floor_seed, textured, kind, rng)


def _generate_case(floor_seed: int, textured: bool, kind: str, rng: np.random.Generator) -> Case:
    here = get_site(floor_seed, textured)
    for _ in range(MAX_TRIES):
        believed, other = _draw_places(here, kind, rng)
        if believed is None or (other is None and kind != "another floor"):
            continue
        covariance = _draw_covariance(here.robot.actuator, believed, rng)
        heading = choose_heading(here.robot, believed, _headings(believed), 0.1)
        turned = wrap_angle(heading - believed.heading_rad)
        believed = Pose2(believed.x_m, believed.y_m, heading)
        there, building = here, int(rng.integers(2))
        if kind == "another floor":
            there = get_site(floor_seed + 1, textured)
            other = _find_similar(here, there, believed, rng)
        else:
            assert other is not None
            other = Pose2(other.x_m, other.y_m, wrap_angle(other.heading_rad + turned))
        if other is None:
            continue
        true = _draw_true_pose(believed, other, covariance, rng)
        if not _is_free(there, true):
            continue
        milestone = predict_milestone(here.robot, believed, Milestone("", 0, "a case", heading))
        locale = here.robot.world.locale_at(believed.position) or ""
        belief = Hypothesis.of_world(here.robot.world, locale, believed, covariance, "odometry")
        alternative = None
        if here.is_symmetric and (mirrored := _mirror(here, believed)) is not None:
            alternative = Hypothesis.of_world(here.robot.world, locale, mirrored, covariance, "relocalization",
                                        status="candidate", weight=0.5)
        jpeg, hidden, light = _render_frame(here.robot, there.buildings[building], true, rng)
        difference = _measure_difference(here, believed, there, other)
        return Case(kind, belief, alternative, true, milestone, jpeg, difference, hidden, MISSING_SHARE * building,
                    light)
    raise ValueError(f"expected a floor with room for a case {kind!r}, got none on floor {floor_seed}")


# -- places ------------------------------------------------------------------------------------------------------------


def _draw_places(here: Site, kind: str, rng: np.random.Generator) -> tuple[Pose2 | None, Pose2 | None]:
    """Draw the believed and the wrong place; None if the robot would not stand free."""
    corridor = kind == "the other side" or rng.random() < 0.6
    names = here.floor.corridors if corridor else here.floor.rooms
    other: Pose2 | None
    if kind == "another door":
        believed, other = _draw_at_doors(here, rng)
    else:
        believed = _draw_place(here, str(rng.choice(names)), rng)
        other = believed
        if kind == "a metre off":
            distance, way = rng.uniform(0.7, 1.5), rng.uniform(-math.pi, math.pi)
            other = Pose2(believed.x_m + distance * math.cos(way), believed.y_m + distance * math.sin(way),
                          believed.heading_rad)
        elif kind == "the other side":
            other = _mirror(here, believed)
    if other is None or not _is_free(here, believed) or not _is_free(here, other):
        return None, None
    return believed, other


def _draw_place(here: Site, name: str, rng: np.random.Generator) -> Pose2:
    low, high = (f(here.robot.world.outline(name), axis=0) for f in (np.min, np.max))
    x, y = rng.uniform(low + MIN_CLEARANCE_M, high - MIN_CLEARANCE_M)
    along = 0.0 if high[0] - low[0] > high[1] - low[1] else 0.5 * math.pi
    heading = rng.uniform(-math.pi, math.pi)
    if name in here.floor.corridors:
        heading = along + math.pi * rng.integers(2) + rng.normal(0.0, 0.3)
    return Pose2(float(x), float(y), wrap_angle(float(heading)))


def _mirror(here: Site, pose: Pose2) -> Pose2 | None:
    """Mirror a pose at the middle of its corridor; None outside of corridors."""
    name = here.robot.world.locale_at(pose.position)
    if name not in here.floor.corridors:
        return None
    corners = here.robot.world.outline(name)
    x, y = corners.min(axis=0) + corners.max(axis=0)
    return Pose2(float(x) - pose.x_m, float(y) - pose.y_m, wrap_angle(pose.heading_rad + math.pi))


def _draw_at_doors(here: Site, rng: np.random.Generator) -> tuple[Pose2, Pose2]:
    """Draw the same place in front of two doors of a corridor."""
    frames = _build_door_frames(here)
    a, b = rng.choice(len(frames), 2, replace=False)
    own = Pose2(float(rng.uniform(-1.0, 1.0)), float(rng.uniform(0.6, 1.6)), float(rng.uniform(-math.pi, math.pi)))
    return frames[a] @ own, frames[b] @ own


def _build_door_frames(here: Site) -> list[Pose2]:
    """Build a frame for each door of a corridor, with its y axis out of the wall."""
    frames = []
    world = here.floor.world
    for mark in world.landmarks:
        if mark.kind in ("door", "doorway") and mark.locale in here.floor.corridors:
            middle = mark.lines_world.reshape(-1, 3).mean(axis=0)
            corners = world.outline(mark.locale)
            across = float(corners.mean(axis=0)[1] - middle[1])
            wall = float(corners[:, 1].min() if across > 0 else corners[:, 1].max())
            frames.append(Pose2(float(middle[0]), wall, 0.0 if across > 0 else math.pi))
    return frames


def _find_similar(here: Site, there: Site, pose: Pose2, rng: np.random.Generator) -> Pose2 | None:
    """Find the similar pose on another floor: as far from the south-west corner of a locale of the same kind."""
    name = here.robot.world.locale_at(pose.position) or ""
    names = there.floor.corridors if name in here.floor.corridors else there.floor.rooms
    corner = here.robot.world.outline(name).min(axis=0)
    other = there.robot.world.outline(str(rng.choice(names))).min(axis=0)
    found = Pose2(float(other[0] + pose.x_m - corner[0]), float(other[1] + pose.y_m - corner[1]), pose.heading_rad)
    return found if _is_free(there, found) else None


def _is_free(here: Site, pose: Pose2) -> bool:
    """Whether the robot can stand there: in a locale, without contact."""
    name = here.robot.world.locale_at(pose.position)
    if name is None or not (name in here.floor.corridors or name in here.floor.rooms):
        return False
    return here.buildings[0].obstacles.clearance_m(pose) > 0.0 and inside_polygon(
        pose.position, here.robot.world.outline(name))


def _headings(pose: Pose2) -> list[float]:
    return [pose.heading_rad, *(wrap_angle(pose.heading_rad + turn_rad) for turn_rad in LOOK_TURNS_RAD)]


def _draw_covariance(actuator: ActuatorModel, pose: Pose2, rng: np.random.Generator) -> Floats:
    """Draw a covariance as after tracking, after some increments of dead reckoning, or after lost tracks."""
    how = rng.random()
    if how < 0.4:
        sigma_m, sigma_rad = rng.uniform(0.003, 0.02), math.radians(rng.uniform(0.1, 0.5))
        return np.diag([sigma_m**2, sigma_m**2, sigma_rad**2])
    if how > 0.85:
        sigma_m, sigma_rad = rng.uniform(0.02, 0.05), math.radians(rng.uniform(0.4, 1.2))
        return np.diag([sigma_m**2, sigma_m**2, sigma_rad**2])
    covariance = np.diag([0.005**2, 0.005**2, math.radians(0.2) ** 2])
    at = pose
    for _ in range(int(rng.integers(1, 4))):
        turn = float(rng.uniform(-1.0, 1.0)) * actuator.turn_increment_rad * float(rng.random() < 0.5)
        move = float(rng.uniform(0.2, 1.0)) * actuator.increment_m
        at, covariance = actuator.propagate_move(at, covariance, turn, move)
    return covariance


def _draw_true_pose(believed: Pose2, there: Pose2, covariance: Floats, rng: np.random.Generator) -> Pose2:
    """Draw a pose about ``there`` with the covariance of the believed pose."""
    error = rng.multivariate_normal(np.zeros(3), covariance)
    own = Pose2(0.0, 0.0, believed.heading_rad).inverse() @ Pose2(float(error[0]), float(error[1]), 0.0)
    return there @ Pose2(own.x_m, own.y_m, float(error[2]))


# -- frames ------------------------------------------------------------------------------------------------------------


def _measure_difference(here: Site, believed: Pose2, there: Site, other: Pose2) -> float:
    """Measure the share of the view in which the bare models differ between two places."""
    if here is there and believed == other:
        return 0.0
    seen = [site.bare.renderer.radiance(here.robot.camera, here.robot.camera_from_world(pose))
            for site, pose in ((here, believed), (there, other))]
    height, width = (side // CELL_PX * CELL_PX for side in seen[0].shape[:2])
    cells = [image[:height, :width].reshape(height // CELL_PX, CELL_PX, width // CELL_PX, CELL_PX, 3).mean(axis=(1, 3))
             for image in seen]
    return float(np.mean(np.abs(cells[0] - cells[1]).max(axis=2) > MIN_CELL_DIFFERENCE))


def _render_frame(
    robot: RobotModel, building: SimulatedBuilding, true: Pose2, rng: np.random.Generator
) -> tuple[bytes, float, float]:
    """Render JPEG bytes; returned with the hidden share and the change of light (logarithm of its gain)."""
    radiance = building.renderer.radiance(robot.lens, robot.camera_from_world(true))
    hidden = float(rng.uniform(0.05, MAX_HIDDEN_SHARE)) if rng.random() < OCCLUDED else 0.0
    if hidden:
        radiance = Occluder.draw(hidden, math.inf, rng).cover(radiance)
    light = 0.0
    if rng.random() < LIGHT_CHANGED:
        light = float(rng.uniform(math.log(0.35), math.log(1.5)))
        colour = np.exp(light + rng.uniform(-0.12, 0.12, 3))
        slope = 1.0 + float(rng.uniform(-0.3, 0.3)) * np.linspace(-1.0, 1.0, radiance.shape[1])
        radiance = np.asarray(radiance * colour * slope[:, None], np.float32)
    sensor = SensorParameters()
    return compress_jpeg(expose(radiance, sensor, rng), sensor.jpeg_quality), hidden, light
