"""Does a picture show a leaf in an opening, or what is beyond? Colors against the model's, and against each other.

Light is not modelled, so that only ratios of colors count: what is beyond has the model's colors up to one gain. A leaf
has one color from its foot to its head, whatever that is; and where the floor beyond should be seen at the foot of the
opening, there is more of the leaf. Where its foot is seen before the wall or behind it, a leaf stands there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import shapely

from knowledge_sources.methods.arrays import Floats, Image, Mask
from knowledge_sources.methods.doors.rival_views import ALIKE, Views, fit_views
from knowledge_sources.methods.verification import RAYS, cast_rays
from world_models.building.building import Building
from world_models.building.locales import Doorway
from world_models.camera import NEAR_PLANE_M
from world_models.frames import Pose, Pose2
from world_models.robot import RobotModel

MAX_DISTANCE_M = 5.0  # largest distance of a doorway that is looked at: there a row is 5 cm of the floor
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

FOOT_REACH_M, FOOT_STEP_M = 1.0, 0.05
"""So far before an opening, and behind it, the foot of a leaf is looked for, in such steps of the floor."""
FOOT_ACROSS = (0.3, 0.4, 0.5, 0.6, 0.7)
"""Parts of the opening's width through which that floor is looked at."""
NOTHING = shapely.Polygon()
Box = tuple[float, float, float, float]
"""Left, top, right, bottom [px]."""
OWN_SURFACE_M = 0.1
"""What the model has nearer than the opening by more than this stands before it."""


@dataclass(frozen=True, slots=True, eq=False)
class SeenOpening:
    """The part of a picture that shows what is beyond a doorway, or its leaf, wherever in the wall that hangs.

    Attributes:
        box_px: the opening in the picture, as far as it is in view.
        distance_m: from the camera to the middle of the opening, on the plan.
        pixels: (n, 2) samples that look through the opening, of the rectified picture [px].
        across: (n,) place of each in the opening, 0 at the left jamb to 1; height_m: (n,) above the floor.
        colors: (n, 3) what the model has there, 0..1; NaN where it does not know.
        is_whole: (n,) whether the model has the same surface all round the sample.
        sine: of the angle at which it is seen, 1 from the front.
        frame_pixels: (k, 2) samples of what is round the opening: casing and wall; frame_colors: (k, 3) of the model.
        foot_pixels: (m, 2) samples of the floor before the opening and behind it; foot_off_m: (m,) how far behind the
            wall each is, negative before it, 0 within it and what the pose leaves open.
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
    sine: float
    foot_pixels: Floats
    foot_off_m: Floats


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
    before: shapely.Geometry = NOTHING,
) -> SeenOpening | None:
    """What should be seen of a doorway from a pose in one of its rooms; None where too little of it is in view.

    Args:
        robot: on the floor of its room, with what is known to stand before its camera.
        covariance: (3, 3) of the pose; samples keep so far from the jambs that the pose may be wrong by it.
        locale: the room where the robot is.
        beyond: the building with this door open.
        before: the floor of what was found to stand in the room [m, world]: what stands there may hide the opening up
            to any height, as its top is seldom seen.
    """
    if not is_in_view(robot, pose, doorway, locale):
        return None
    camera_from_world, floor_m = robot.camera_from_world(pose), robot.world.floor_m(locale)
    center = camera_from_world.inverse().translation
    middle = doorway.threshold_of(locale).mean(axis=0)
    distance_m = float(np.linalg.norm(middle - center[:2]))
    sine = float((middle - center[:2]) @ doorway.outward_from(locale)) / distance_m
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
    if not before.is_empty:
        ends = center[:2] + first_m[mine, None] * world[mine, :2]
        lines = shapely.linestrings(np.stack([np.broadcast_to(center[:2], ends.shape), ends], axis=1))
        clear &= ~shapely.intersects(lines, before)
    if robot.camera.obstruction is not None:
        clear &= ~robot.camera.obstruction.covers(pixels[:, 0])
    free = through[mine] & clear
    if np.count_nonzero(free) < MIN_SAMPLES:
        return None
    known = np.vstack([colors, np.full((1, 3), np.nan)])[surface]
    look = np.vstack([np.column_stack([colors, normals]), np.full((1, 6), np.nan)])[surface].reshape(-1, RAYS, 6)
    is_whole = np.all(np.abs(look - look[:, :1]) < 1e-4, axis=(1, 2))
    frame = beside[mine] & clear & is_whole & (depth[mine] < first_m[mine] + OWN_SURFACE_M)
    return SeenOpening(box, distance_m, pixels[free, 0], across[mine][free], height_m[mine][free], known[mine][free],
                       is_whole[free], pixels[frame, 0], known[mine][frame], sine,
                       *_list_foot(robot, camera_from_world, doorway, locale, margin_m))


def _list_foot(
    robot: RobotModel, camera_from_world: Pose, doorway: Doorway, locale: str, margin_m: float
) -> tuple[Floats, Floats]:
    """The floor before an opening and behind it that is seen through its middle: pixels, and how far off its wall."""
    (left, right), outward = doorway.threshold_of(locale), doorway.outward_from(locale)
    eye = camera_from_world.inverse().translation[:2]
    deep = np.tile(np.arange(-FOOT_REACH_M, FOOT_REACH_M + doorway.depth_m, FOOT_STEP_M), len(FOOT_ACROSS))
    through = np.repeat(left + np.outer(FOOT_ACROSS, right - left), len(deep) // len(FOOT_ACROSS), axis=0)
    floor = eye + (1.0 + deep / ((left - eye) @ outward))[:, None] * (through - eye)
    near = camera_from_world.apply(np.column_stack([floor, np.full(len(floor), robot.world.floor_m(locale))]))
    ahead = near[:, 2] > NEAR_PLANE_M
    pixels, off_m = robot.camera.project(near[ahead]), deep - np.clip(deep, -margin_m, doorway.depth_m + margin_m)
    size = np.array([robot.camera.width, robot.camera.height]) - 1.0
    in_view = np.all((pixels >= BORDER_PX) & (pixels <= size - BORDER_PX), axis=1)
    return pixels[in_view], off_m[ahead][in_view]


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


MIN_GREY = 6.0  # least median brightness of an opening that is judged [grey levels]
MAX_GREY = 250.0  # a sample is overexposed where one of its colors is brighter [grey levels]
MIN_EXPOSED_SHARE = 0.8  # least share of an opening's samples that are not overexposed, where it is judged
DARK_OFFSET = 4.0  # grey levels added before a ratio of colors is taken, against noise in the dark
MIN_COMPARED = 20  # fewest samples for which the model has a color
MAX_LEAF_BRIGHTNESS = 0.2  # largest difference of log brightness within a leaf
MAX_LEAF_TINT = 0.08  # largest difference of log color, without brightness, within a leaf
MAX_GAIN_BRIGHTNESS = 0.15  # largest difference of log brightness from the model's, up to one gain
MAX_GAIN_TINT = 0.06  # largest difference of log color, without brightness, from the model's, up to one gain
FOOT_M = 0.35  # height of what counts as the foot of an opening
MIN_FOOT_TOLD = 0.9  # least share of the floor's samples that tell where a leaf's foot is
MIN_FOOT_SAMPLES = 8  # fewest samples at the foot, and above it, by which both compare
MIN_FRAME_SAMPLES = 12  # fewest samples round an opening that show whether something stands before it
MIN_FRAME_SHARE = 0.6  # least share of them that has the model's color, up to one gain, where nothing stands before it
MAX_FRAME_LEAF_SHARE = 0.4  # largest share of them that has the color of the opening, where that is a leaf
MIN_LEAF_SINE = 0.6  # least sine of the angle at which a leaf differs from an open doorway: 37 degrees
MAX_RIVAL_BETTER = 0.15  # most by which what is beyond may explain it better [mean log]; chosen on floors 7000 to 7407
MAX_LOG_RATIO = 4.5  # most that one picture may add to the log odds of a door: 90 to 1

MAX_COMPARED = 60
"""Samples that the others are compared with."""


@dataclass(frozen=True, slots=True)
class LeafEvidence:
    """What a picture says of an opening.

    Attributes:
        uniform: largest share of all samples that have one color, 0..1.
        expected_uniform: the same share of what the model has beyond.
        agreeing: largest share of those that the model has a color for that have that, up to one gain.
        foot: log ratio of the colors at the foot of the opening and above it; NaN where one is not in view.
        expected_foot: the same of what the model has beyond.
        frame: share of the samples round the opening that have the model's color, 0..1; NaN where there are too few.
        frame_leaf: share of them that has the opening's own color.
        sine: of the angle at which the opening is seen, 1 from the front.
        views: how badly a leaf explains the opening, and what is beyond.
        foot_off_m: how far behind its wall, or before it (negative), the foot of the leaf is seen; NaN where it is not.
    """

    uniform: float
    expected_uniform: float
    agreeing: float
    foot: float
    expected_foot: float
    frame: float
    frame_leaf: float
    sine: float = 1.0
    views: Views = ALIKE
    foot_off_m: float = math.nan

    @property
    def features(self) -> tuple[float, ...]:
        """What the log odds of a leaf are a sum of, each with its weight of :data:`WEIGHTS`."""
        foot = 0.0 if math.isnan(self.foot) else self.foot
        is_expected = not math.isnan(self.foot + self.expected_foot)
        confirmed = min(1.0, self.expected_foot / FULL_FOOT) if is_expected else 0.0
        alike = max(0.0, 1.0 - foot / ALIKE_FOOT)
        one = max(0.0, (self.uniform - LEAST_UNIFORM) / (1.0 - LEAST_UNIFORM))
        return (
            one, one * (1.0 - self.expected_uniform), 1.0 - self.uniform, self.agreeing,
            self.agreeing * (1.0 - self.expected_uniform), confirmed * alike, min(1.0, foot / FULL_FOOT), 1.0)


FULL_FOOT, ALIKE_FOOT, LEAST_UNIFORM = 0.3, 0.2, 0.7
WEIGHTS = (4.04, 1.33, -3.65, -7.24, -1.59, 2.18, -1.03, 4.79)
"""Of each of the features: logistic regression on 2,305 rendered pictures of doors of generated floors (seeds 2000 to
2109), a third of them with a thing near the door. Of 1,039 open doors none had log odds above 3."""


def measure_opening(
    robot: RobotModel, opening: SeenOpening, image: Image
) -> LeafEvidence | None:
    """Measure an opening in a picture (h, w, 3), as the lens made it, maybe reduced; None where it is too dark or too
    bright: all that is overexposed has one color.
    """
    lens = robot.lens
    pixels = np.concatenate([opening.pixels, opening.frame_pixels, opening.foot_pixels])
    at = pixels if lens == robot.camera else lens.project(robot.camera.rays(pixels))
    height, width = image.shape[:2]
    part = (at + 0.5) / (lens.width, lens.height) * (width, height)
    column, row = np.clip(part.astype(np.int64), 0, (width - 1, height - 1)).T
    seen, around, floor = np.split(cv2.blur(image, (3, 3))[row, column].astype(np.float64),
                                   np.cumsum([len(opening.pixels), len(opening.frame_pixels)]))
    is_exposed = seen.max(axis=1) <= MAX_GREY
    if np.median(seen) < MIN_GREY or is_exposed.mean() < MIN_EXPOSED_SHARE:
        return None
    colors = np.log(seen + DARK_OFFSET)
    compared = opening.is_whole & ~np.isnan(opening.colors[:, 0])
    if np.count_nonzero(compared) < MIN_COMPARED:
        return None
    expected = np.log(255.0 * opening.colors[compared] + DARK_OFFSET)
    leaf = np.median(colors, axis=0)
    frame, frame_leaf = _compare_frame(np.log(around + DARK_OFFSET), opening.frame_colors, leaf)
    one, other = MAX_LEAF_BRIGHTNESS, MAX_LEAF_TINT
    surfaces = np.unique(np.round(opening.colors[compared], 3), axis=0, return_inverse=True)[1].ravel()
    views = fit_views(colors[compared], surfaces, opening.across[compared], opening.height_m[compared])
    return LeafEvidence(
        find_largest_share(colors, one, other), find_largest_share(expected, one, other),
        find_largest_share(colors[compared] - expected, MAX_GAIN_BRIGHTNESS, MAX_GAIN_TINT),
        _compare_foot(colors, opening.height_m),
        _compare_foot(expected, opening.height_m[compared]),
        frame, frame_leaf, opening.sine, views,
        _find_foot(np.log(floor + DARK_OFFSET), opening, leaf),
    )


def find_largest_share(logs: Floats, brightness: float, tint: float) -> float:
    """The largest part of log colors (n, 3) that are like one of them in brightness and in tint, 0..1."""
    some = logs[np.linspace(0, len(logs) - 1, min(len(logs), MAX_COMPARED)).astype(np.int64)]
    parts = [logs[:, None, k] - some[None, :, k] for k in range(3)]  # one by one: ten times as fast as along an axis
    level = (parts[0] + parts[1] + parts[2]) / 3.0
    tints = np.maximum(np.maximum(*(np.abs(part - level) for part in parts[:2])), np.abs(parts[2] - level))
    return float(((np.abs(level) <= brightness) & (tints <= tint)).mean(axis=0).max())


def _compare_foot(logs: Floats, height_m: Floats) -> float:
    """How different the colors at the foot are from those above; NaN where too few of either are in view."""
    low, high = logs[height_m < FOOT_M], logs[height_m > 2.0 * FOOT_M]
    if min(len(low), len(high)) < MIN_FOOT_SAMPLES:
        return math.nan
    return float(np.abs(np.median(low, axis=0) - np.median(high, axis=0)).max())


def _find_foot(logs: Floats, opening: SeenOpening, leaf: Floats) -> float:
    """Where the floor, of log colors (m, 3), ends and a leaf of a log color begins; NaN where nothing tells them apart.
    """
    is_leaf = _are_alike(logs, leaf)
    if min(np.sum(is_leaf), np.sum(~is_leaf)) < MIN_FOOT_SAMPLES:
        return math.nan
    floor = np.median(logs[~is_leaf], axis=0)
    is_leaf = np.linalg.norm(logs - leaf, axis=1) < np.linalg.norm(logs - floor, axis=1)
    places = np.unique(opening.foot_off_m)
    told = [np.mean((opening.foot_off_m >= place) == is_leaf) for place in places]
    return float(places[np.argmax(told)]) if max(told) >= MIN_FOOT_TOLD else math.nan


def _are_alike(logs: Floats, leaf: Floats) -> Mask:
    """Which log colors (n, 3) a leaf may have that has a color."""
    off = logs - leaf
    level = off.mean(axis=1)
    tint = np.abs(off - level[:, None]).max(axis=1)
    return np.asarray((np.abs(level) <= MAX_LEAF_BRIGHTNESS) & (tint <= MAX_LEAF_TINT))


def _compare_frame(seen: Floats, colors: Floats, leaf: Floats) -> tuple[float, float]:
    """The shares of what is round an opening that have the model's color and the opening's own; NaN without samples."""
    known = ~np.isnan(colors[:, 0])
    if np.count_nonzero(known) < MIN_FRAME_SAMPLES:
        return math.nan, math.nan
    expected = np.log(255.0 * colors[known] + DARK_OFFSET)
    agreeing = find_largest_share(seen[known] - expected, MAX_GAIN_BRIGHTNESS, MAX_GAIN_TINT)
    return agreeing, float(_are_alike(seen, leaf).mean())


def weigh_leaf(evidence: LeafEvidence) -> float:
    """The log likelihood ratio of a leaf against an open doorway, as much as one picture may say.

    A leaf stands in its frame: where what is round the opening is not as the model has it, or has the color of the
    opening, something may stand before it. And nothing supports a leaf seen diagonally: an open doorway shows but
    its jamb and a bare wall from there. What a rival explains better says nothing: what is beyond, in other colors than
    the model has; or a leaf that stands there, loose or ajar: its foot is seen before the wall or behind it.
    """
    ratio, (shut, opened) = float(np.dot(evidence.features, WEIGHTS)), evidence.views
    is_framed = evidence.frame >= MIN_FRAME_SHARE and evidence.frame_leaf <= MAX_FRAME_LEAF_SHARE
    is_other = shut - opened > MAX_RIVAL_BETTER or abs(evidence.foot_off_m) > FOOT_STEP_M
    if ratio > 0.0 and (is_other or not is_framed or evidence.sine < MIN_LEAF_SINE):
        return 0.0
    return min(max(ratio, -MAX_LOG_RATIO), MAX_LOG_RATIO)


def describe(evidence: LeafEvidence, ratio: float) -> str:
    """What is seen in an opening, in words."""
    if ratio > 0.0:
        foot = "" if math.isnan(evidence.foot) else ", no floor beyond" if evidence.foot < ALIKE_FOOT else ""
        return f"a leaf ({evidence.uniform:.0%} of it of one color{foot})"
    return f"what is beyond ({evidence.agreeing:.0%} of it as the model has it)"
