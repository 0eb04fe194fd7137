"""What a picture should show through a doorway that is open, by the model (§3.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.verification.predicted_colors import RAYS, cast_rays
from world_models.building.building import Building
from world_models.building.locales import Doorway
from world_models.camera import NEAR_PLANE_M
from world_models.frames import Pose, Pose2
from world_models.robot import RobotModel

MAX_DISTANCE_M = 7.0  # largest distance of a doorway that is looked at
MIN_AWAY_M = 0.5  # least distance of the camera from the plane of the opening
MIN_SINE = 0.35  # least sine of the angle at which the opening is seen
MIN_WIDTH_PX = 20.0  # least width of an opening in the picture
MIN_HEIGHT_PX = 40.0  # least height of an opening in the picture
BORDER_PX = 6.0  # distance that samples keep from the border of the picture
FRAME_M = 0.3  # how much of what is round an opening is compared too
SAMPLES_PER_SIDE = 28  # samples along each side of an opening
EDGE_MARGIN_PX = 3.0  # distance that samples keep from the edges of faces
JAMB_MARGIN_M = 0.05  # distance that samples keep from jambs, head and floor
MARGIN_SIGMAS = 2.0  # standard deviations of the pose that are added to that distance
MIN_SAMPLES = 40  # fewest samples by which an opening is judged

Box = tuple[float, float, float, float]
"""Left, top, right, bottom [px]."""
OWN_SURFACE_M = 0.1
"""What the model has nearer than the opening by more than this stands before it."""


@dataclass(frozen=True, slots=True, eq=False)
class Opening:
    """The part of a picture that shows what is beyond a doorway, or its leaf, wherever in the wall that hangs.

    Attributes:
        box_px: the opening in the picture, as far as it is in view.
        distance_m: from the camera to the middle of the opening, on the plan.
        pixels: (n, 2) samples that look through the opening, of the rectified picture [px].
        across: (n,) place of each in the opening, 0 at the left jamb to 1; height_m: (n,) above the floor.
        colors: (n, 3) what the model has there, 0..1; NaN where it does not know.
        is_whole: (n,) whether the model has the same surface all round the sample.
        frame_pixels: (k, 2) samples of what is round the opening: casing and wall; frame_colors: (k, 3) of the model.
    """

    box_px: Box
    distance_m: float
    pixels: Floats
    across: Floats
    height_m: Floats
    colors: Floats
    is_whole: Mask
    frame_pixels: Floats
    frame_colors: Floats


def is_in_view(
    robot: RobotModel, pose: Pose2, doorway: Doorway, locale: str
) -> bool:
    """Whether a doorway of a room is near enough, seen from well inside the room, and before the camera."""
    left, right = doorway.threshold_of(locale)
    outward, camera_from_world = doorway.outward_from(locale), robot.camera_from_world(pose)
    center = camera_from_world.inverse().translation
    away_m = float((left - center[:2]) @ outward)
    distance_m = float(np.linalg.norm(0.5 * (left + right) - center[:2]))
    if not away_m >= MIN_AWAY_M or distance_m > MAX_DISTANCE_M:
        return False
    if away_m < MIN_SINE * distance_m:
        return False
    box = _find_box(robot, camera_from_world, doorway, locale, robot.world.floor_m(locale), 0.0)
    return box is not None and box[2] - box[0] >= MIN_WIDTH_PX and box[3] - box[1] >= MIN_HEIGHT_PX


def predict_opening(
    robot: RobotModel, pose: Pose2, covariance: Floats, doorway: Doorway, locale: str, beyond: Building,
) -> Opening | None:
    """What should be seen of a doorway from a pose in one of its rooms; None where too little of it is in view.

    Args:
        robot: on the floor of its room, with what is known to stand before its camera.
        covariance: (3, 3) of the pose; samples keep so far from the jambs that the pose may be wrong by it.
        locale: the room where the robot is.
        beyond: the building with this door open.
    """
    if not is_in_view(robot, pose, doorway, locale):
        return None
    camera_from_world, floor_m = robot.camera_from_world(pose), robot.world.floor_m(locale)
    center = camera_from_world.inverse().translation
    distance_m = float(np.linalg.norm(doorway.threshold_of(locale).mean(axis=0) - center[:2]))
    box = _find_box(robot, camera_from_world, doorway, locale, floor_m, 0.0)
    if box is None:
        return None
    sampled = _find_box(robot, camera_from_world, doorway, locale, floor_m, FRAME_M) or box
    pixels = _sample(sampled)
    rays = robot.camera.rays(pixels).reshape(-1, 3)
    rays = np.ascontiguousarray(rays / rays[:, 2:])
    bounds = np.concatenate([rays[:, :2].min(axis=0), rays[:, :2].max(axis=0)])
    a, b, c, d = bounds.tolist()
    colors, normals, surface, depth = cast_rays(
        beyond, camera_from_world, rays, bounds, (a, b, c, d), SAMPLES_PER_SIDE)
    world = rays @ camera_from_world.rotation  # directions in the world: z = 1 in the camera
    margin_m = JAMB_MARGIN_M + MARGIN_SIGMAS * _spread(covariance, distance_m)
    through, beside, across, height_m, first_m = _pass_through(center, world, doorway, locale, floor_m, margin_m)
    mine = slice(None, None, RAYS)
    clear = depth[mine] > first_m[mine] - OWN_SURFACE_M
    if robot.camera.obstruction is not None:
        clear &= ~robot.camera.obstruction.covers(pixels[:, 0])
    free = through[mine] & clear
    if np.count_nonzero(free) < MIN_SAMPLES:
        return None
    known = np.vstack([colors, np.full((1, 3), np.nan)])[surface]
    look = np.vstack([np.column_stack([colors, normals]), np.full((1, 6), np.nan)])[surface].reshape(-1, RAYS, 6)
    is_whole = np.all(np.abs(look - look[:, :1]) < 1e-4, axis=(1, 2))
    frame = beside[mine] & clear & is_whole & (depth[mine] < first_m[mine] + OWN_SURFACE_M)
    return Opening(box, distance_m, pixels[free, 0], across[mine][free], height_m[mine][free], known[mine][free],
                   is_whole[free], pixels[frame, 0], known[mine][frame])


def _find_box(
    robot: RobotModel, camera_from_world: Pose, doorway: Doorway, locale: str, floor_m: float, around_m: float,
) -> Box | None:
    """The rectangle round an opening, and so much round it, as far as it is in the picture; None where it is not."""
    left, right = doorway.threshold_of(locale)
    wider = around_m / doorway.width_m * (right - left)
    corners = np.array([[*foot, floor_m + z] for foot in (left - wider, right + wider)
                        for z in (0.0, doorway.height_m + around_m)])
    near = camera_from_world.apply(corners)
    if near[:, 2].min() <= NEAR_PLANE_M:
        return None
    px = robot.camera.project(near)
    low = np.maximum(px.min(axis=0), BORDER_PX)
    high = np.minimum(px.max(axis=0), np.array([robot.camera.width, robot.camera.height]) - 1.0 - BORDER_PX)
    if np.any(high <= low):
        return None
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _sample(box: Box) -> Floats:
    """(n, RAYS, 2) a grid of pixels in a rectangle, each with four around it [px]."""
    size, off = SAMPLES_PER_SIDE, EDGE_MARGIN_PX
    u, v = np.linspace(box[0], box[2], size), np.linspace(box[1], box[3], size)
    around = off * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)], float)
    return np.asarray(np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 1, 2) + around)


def _spread(covariance: Floats, distance_m: float) -> float:
    """How far a pose's standard deviation may move a thing at a distance [m]."""
    place = max(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), 0.0)
    return float(np.sqrt(place + covariance[2, 2] * distance_m**2))


def _pass_through(
    center: Floats, rays: Floats, doorway: Doorway, locale: str, floor_m: float, margin_m: float
) -> tuple[Mask, Mask, Floats, Floats, Floats]:
    """Whether rays (n, 3) pass both thresholds clear of jambs and head, or the nearer one's plane outside of it.

    Also the place across and the height at which they pass the nearer one, and how deep.

    Such a ray meets a leaf that fills the opening, wherever in the wall it hangs.
    """
    outward = doorway.outward_from(locale)
    inside = np.ones(len(rays), bool)
    beside = np.zeros(len(rays), bool)
    first: tuple[Floats, Floats, Floats] | None = None
    for room in (locale, doorway.other(locale)):
        left, right = doorway.threshold_of(room)
        if room != locale:
            left, right = right, left
        along = (right - left) / doorway.width_m
        slope = rays[:, :2] @ outward
        with np.errstate(divide="ignore", invalid="ignore"):
            deep = np.where(slope > 1e-9, ((left - center[:2]) @ outward) / slope, np.inf)
            hit = center + deep[:, None] * rays
            across, height = (hit[:, :2] - left) @ along, hit[:, 2] - floor_m
        with np.errstate(invalid="ignore"):
            inside &= ((across > margin_m) & (across < doorway.width_m - margin_m) & (height > margin_m)
                       & (height < doorway.height_m - margin_m) & np.isfinite(deep))
            outside = (across < -margin_m) | (across > doorway.width_m + margin_m) | (
                height > doorway.height_m + margin_m)
        if first is None:
            beside = outside & (height > margin_m) & np.isfinite(deep)
            first = across / doorway.width_m, height, deep
    assert first is not None
    return inside, beside, first[0], first[1], first[2]
