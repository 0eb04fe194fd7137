"""Cases for the judge of milestones: what Harvey believes, where it truly is, and the picture that it gets there.

A place is *right* where the robot truly stands as its wheels, after a leg with servoing, may have left it: drawn from
the covariance that it holds by the actuator model (§3.2). The wrong places are a metre off, at another door, at the
other side of the corridor, or on another floor, with the same spread about them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.plan.milestone_selector import best_heading, expectation
from knowledge_sources.settings import DEFAULT
from sim.body.building import Building
from sim.made_up.generated_floors import Floor, generated_floor
from sim.render.occluder import Occluder
from sim.render.sensor import SensorParameters, compress_jpeg, expose
from sim.scenario import CameraSettings
from world_models.actuator import ActuatorModel
from world_models.building.outlines import inside_polygon
from world_models.entries.location import Hypothesis
from world_models.entries.task import Milestone
from world_models.frames import Pose2, wrap_angle
from world_models.robot import RobotModel

Floats = NDArray[np.float64]
ROOMS = 8
KINDS = ("right", "a metre off", "another door", "the other side", "another floor")
SHARES = (0.5, 0.14, 0.14, 0.1, 0.12)
GONE = 0.1
"""So much of what the model has is missing in every other building."""
OCCLUDED, LIGHT_CHANGED = 0.3, 0.5
"""Parts of the cases."""
MOST_HIDDEN = 0.2
ROOM_M = 0.45
"""The robot keeps so far from everything."""
TRIES = 400
CELL_PX, UNLIKE = 8, 0.04
"""Two pictures differ in cells of this size where their brightness or colour does by more than this, 0..1."""
SAME = 0.02
"""Places from which the model looks otherwise in less than this part of the picture are the same to any eye."""


@dataclass(frozen=True, eq=False)
class Site:
    """A floor as the cases need it.

    Attributes:
        robot: what it knows. bare: the building as the model has it.
        buildings: with the details that the model lacks; and then with model parts missing.
    """

    floor: Floor
    robot: RobotModel
    bare: Building
    buildings: tuple[Building, Building]
    is_symmetric: bool


@dataclass(frozen=True, eq=False)
class Case:
    """One question to the judge.

    Attributes:
        kind: of :data:`KINDS`.
        belief: the held hypothesis; its heading is that of the look.
        rival: another place where the robot may be for all it knows; None where it does not doubt.
        true: where it is, in the world of the floor that it is truly on.
        milestone: what it expects.
        jpeg: what it sees.
        unlike: part of the picture, 0..1, in which the model looks otherwise from the wrong place than from the
            believed one; where it is next to nothing, nobody could tell them apart.
        hidden, gone, light: part of the view that is hidden, of the model that is missing, and the change of light.
    """

    kind: str
    belief: Hypothesis
    rival: Hypothesis | None
    true: Pose2
    milestone: Milestone
    jpeg: bytes
    unlike: float
    hidden: float
    gone: float
    light: float

    @property
    def is_elsewhere(self) -> bool:
        """Whether the true pose is of another floor."""
        return self.kind == "another floor"


@lru_cache(maxsize=2)
def site(seed: int) -> Site:
    """The floor of a seed: every fifth one is symmetric, every other fifth has doors that repeat."""
    symmetric, repeated = seed % 5 == 3, seed % 5 in (3, 4)
    floor = generated_floor(seed, ROOMS, symmetric=symmetric, repeated=repeated)
    settings = CameraSettings()
    robot = RobotModel(floor.world, settings.camera, settings.mount, ActuatorModel())
    whole = Building.of_faces(floor.building.faces)
    lacking = Building.of_faces(floor.altered(GONE).faces)
    return Site(floor, robot, Building.of_faces(floor.world.faces), (whole, lacking), symmetric)


def cases(floor_seed: int, first: int, count: int) -> Iterator[Case]:
    """Cases number ``first``, ``first + 1``, ... of a floor; each follows from its number alone."""
    for number in range(first, first + count):
        rng = np.random.default_rng([floor_seed, number])
        kind = str(rng.choice(KINDS, p=SHARES))
        yield _case(floor_seed, kind, rng)


def _case(floor_seed: int, kind: str, rng: np.random.Generator) -> Case:
    here = site(floor_seed)
    for _ in range(TRIES):
        believed, other = _places(here, kind, rng)
        if believed is None or (other is None and kind != "another floor"):
            continue
        covariance = _spread(here.robot.actuator, believed, rng)
        heading = best_heading(here.robot, believed, _headings(believed), 0.1)
        turned = wrap_angle(heading - believed.heading_rad)
        believed = Pose2(believed.x_m, believed.y_m, heading)
        there, building = site(floor_seed), int(rng.integers(2))
        if kind == "another floor":
            there = site(floor_seed + 1)
            other = _like(here, there, believed, rng)
        else:
            assert other is not None
            other = Pose2(other.x_m, other.y_m, wrap_angle(other.heading_rad + turned))
        if other is None:
            continue
        true = _left_by_wheels(believed, other, covariance, rng)
        if not _is_free(there, true):
            continue
        milestone = expectation(here.robot, believed, Milestone("", 0, "a case", heading))
        locale = here.robot.world.locale_at(believed.position) or ""
        belief = Hypothesis.of_world(here.robot.world, locale, believed, covariance, "odometry")
        rival = None
        if here.is_symmetric and (twin := _mirrored(here, believed)) is not None:
            rival = Hypothesis.of_world(here.robot.world, locale, twin, covariance, "relocalization",
                                        status="candidate", weight=0.5)
        jpeg, hidden, light = _picture(here.robot, there.buildings[building], true, rng)
        unlike = _unlike(here, believed, there, other)
        return Case(kind, belief, rival, true, milestone, jpeg, unlike, hidden, GONE * building, light)
    raise ValueError(f"expected a floor with room for a case {kind!r}, got none on floor {floor_seed}")


# -- places ------------------------------------------------------------------------------------------------------------


def _places(here: Site, kind: str, rng: np.random.Generator) -> tuple[Pose2 | None, Pose2 | None]:
    """Where the robot believes to be, and the wrong place; None where it would not stand free."""
    corridor = kind == "the other side" or rng.random() < 0.6
    names = here.floor.corridors if corridor else here.floor.rooms
    other: Pose2 | None
    if kind == "another door":
        believed, other = _at_doors(here, rng)
    else:
        believed = _anywhere(here, str(rng.choice(names)), rng)
        other = believed
        if kind == "a metre off":
            distance, way = rng.uniform(0.7, 1.5), rng.uniform(-math.pi, math.pi)
            other = Pose2(believed.x_m + distance * math.cos(way), believed.y_m + distance * math.sin(way),
                          believed.heading_rad)
        elif kind == "the other side":
            other = _mirrored(here, believed)
    if other is None or not _is_free(here, believed) or not _is_free(here, other):
        return None, None
    return believed, other


def _anywhere(here: Site, name: str, rng: np.random.Generator) -> Pose2:
    low, high = (f(here.robot.world.outline(name), axis=0) for f in (np.min, np.max))
    x, y = rng.uniform(low + ROOM_M, high - ROOM_M)
    along = 0.0 if high[0] - low[0] > high[1] - low[1] else 0.5 * math.pi
    heading = rng.uniform(-math.pi, math.pi)
    if name in here.floor.corridors:
        heading = along + math.pi * rng.integers(2) + rng.normal(0.0, 0.3)
    return Pose2(float(x), float(y), wrap_angle(float(heading)))


def _mirrored(here: Site, pose: Pose2) -> Pose2 | None:
    """The place on the other side of the middle of the corridor that a pose is in."""
    name = here.robot.world.locale_at(pose.position)
    if name not in here.floor.corridors:
        return None
    corners = here.robot.world.outline(name)
    x, y = corners.min(axis=0) + corners.max(axis=0)
    return Pose2(float(x) - pose.x_m, float(y) - pose.y_m, wrap_angle(pose.heading_rad + math.pi))


def _at_doors(here: Site, rng: np.random.Generator) -> tuple[Pose2, Pose2]:
    """The same place before two doors of a corridor."""
    frames = _door_frames(here)
    a, b = rng.choice(len(frames), 2, replace=False)
    own = Pose2(float(rng.uniform(-1.0, 1.0)), float(rng.uniform(0.6, 1.6)), float(rng.uniform(-math.pi, math.pi)))
    return frames[a] @ own, frames[b] @ own


def _door_frames(here: Site) -> list[Pose2]:
    """For each door of a corridor a frame with its y out of the wall."""
    frames = []
    world = here.robot.world
    for mark in world.landmarks:
        if mark.kind in ("door", "doorway") and mark.locale in here.floor.corridors:
            middle = mark.lines_world.reshape(-1, 3).mean(axis=0)
            corners = world.outline(mark.locale)
            across = float(corners.mean(axis=0)[1] - middle[1])
            wall = float(corners[:, 1].min() if across > 0 else corners[:, 1].max())
            frames.append(Pose2(float(middle[0]), wall, 0.0 if across > 0 else math.pi))
    return frames


def _like(here: Site, there: Site, pose: Pose2, rng: np.random.Generator) -> Pose2 | None:
    """The place of another floor that is most like a pose: as far from the south-west corner of a like locale."""
    name = here.robot.world.locale_at(pose.position) or ""
    names = there.floor.corridors if name in here.floor.corridors else there.floor.rooms
    corner = here.robot.world.outline(name).min(axis=0)
    other = there.robot.world.outline(str(rng.choice(names))).min(axis=0)
    found = Pose2(float(other[0] + pose.x_m - corner[0]), float(other[1] + pose.y_m - corner[1]), pose.heading_rad)
    return found if _is_free(there, found) else None


def _is_free(here: Site, pose: Pose2) -> bool:
    """Whether the robot may stand there: in a locale, clear of everything."""
    name = here.robot.world.locale_at(pose.position)
    if name is None or not (name in here.floor.corridors or name in here.floor.rooms):
        return False
    return here.buildings[0].obstacles.clearance_m(pose) > 0.0 and inside_polygon(
        pose.position, here.robot.world.outline(name))


def _headings(pose: Pose2) -> list[float]:
    return [pose.heading_rad, *(wrap_angle(pose.heading_rad + glance) for glance in DEFAULT.plan.look_turns_rad)]


def _spread(actuator: ActuatorModel, pose: Pose2, rng: np.random.Generator) -> Floats:
    """The covariance that is held after tracking, after some increments of dead reckoning, or when tracks were lost."""
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


def _left_by_wheels(believed: Pose2, there: Pose2, covariance: Floats, rng: np.random.Generator) -> Pose2:
    """A pose off ``there`` as the true one is off the believed one."""
    error = rng.multivariate_normal(np.zeros(3), covariance)
    own = Pose2(0.0, 0.0, believed.heading_rad).inverse() @ Pose2(float(error[0]), float(error[1]), 0.0)
    return there @ Pose2(own.x_m, own.y_m, float(error[2]))


# -- pictures ----------------------------------------------------------------------------------------------------------


def _unlike(here: Site, believed: Pose2, there: Site, other: Pose2) -> float:
    """In which part of the view the bare models differ between two places."""
    if here is there and believed == other:
        return 0.0
    seen = [site.bare.renderer.radiance(here.robot.camera, here.robot.camera_from_world(pose))
            for site, pose in ((here, believed), (there, other))]
    height, width = (side // CELL_PX * CELL_PX for side in seen[0].shape[:2])
    cells = [image[:height, :width].reshape(height // CELL_PX, CELL_PX, width // CELL_PX, CELL_PX, 3).mean(axis=(1, 3))
             for image in seen]
    return float(np.mean(np.abs(cells[0] - cells[1]).max(axis=2) > UNLIKE))


def _picture(
    robot: RobotModel, building: Building, true: Pose2, rng: np.random.Generator
) -> tuple[bytes, float, float]:
    """JPEG bytes, the part that is hidden, and by how much the light is changed (the logarithm of its gain)."""
    radiance = building.renderer.radiance(robot.lens, robot.camera_from_world(true))
    hidden = float(rng.uniform(0.05, MOST_HIDDEN)) if rng.random() < OCCLUDED else 0.0
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
