"""Camera calibration from views of a ChArUco board, as OpenCV does it, with deviations; and the mounting, by one view.

A ChArUco board is a chessboard with a marker in each white square. So every inner corner has a number, and a view of a
part of the board is of use. Source: Z. Zhang, A flexible new technique for camera calibration, PAMI 22(11), 2000.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.arrays import Floats, Image
from knowledge_sources.methods.features import Rectifier
from world_models.camera import Camera

MARKERS = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
MARKER_SHARE = 2.0 / 3.0  # side of a marker, as a share of the square that it stands in
SQUARE_PX = 18  # so wide a square is drawn without a remainder: a marker of 6 x 6 cells of 2 px, and 3 px around it
MAX_SQUARES = 500  # every second holds a marker of its own
MAGNIFIED = 2  # times, where markers are not read
MIN_CORNERS = 8  # fewest corners of a view that is used
MIN_VIEWS = 4  # least number of views of the board (Zhang 2000)
MAX_VIEW_RMS_RATIO = 3.0  # largest RMS error of a view over that of the median view before it is left out
CORNER = (40, 40, 210)  # blue, green, red of a corner that was seen
STEPS = cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-10  # of the calibration

PARAMETERS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
"""Names of the parameters, in OpenCV's order."""


@dataclass(frozen=True, slots=True)
class Pattern:
    """A board: how many inner corners in a row and in a column, and the side of a square [m].

    Its frame: origin at the outer corner of the first square, x along a row, y down, z away from who sees it.
    """

    columns: int
    rows: int
    square_m: float

    def __post_init__(self) -> None:
        squares = (self.columns + 1) * (self.rows + 1)
        if min(self.columns, self.rows) < 3 or squares > MAX_SQUARES or not 0.0 < self.square_m < 10.0:
            raise ValueError(
                f"expected at least 3 x 3 inner corners, at most {MAX_SQUARES} squares, and squares of more than 0 and "
                f"less than 10 m, got {self.columns} x {self.rows} and {self.square_m} m")

    @property
    def board(self) -> cv2.aruco.CharucoBoard:
        """OpenCV's board."""
        squares = self.columns + 1, self.rows + 1
        return cv2.aruco.CharucoBoard(squares, self.square_m, MARKER_SHARE * self.square_m, MARKERS)

    @property
    def points(self) -> Floats:
        """(columns rows, 3) inner corners by their numbers, row by row, in the plane z = 0 [m]."""
        return np.asarray(self.board.getChessboardCorners(), float).reshape(-1, 3)

    def draw(self, times: int = 1) -> Image:
        """The board, black on white, each square ``times`` times 18 px wide, without a margin."""
        side = times * SQUARE_PX
        size = (self.columns + 1) * side, (self.rows + 1) * side
        return np.asarray(self.board.generateImage(size, marginSize=0), np.uint8)


@dataclass(frozen=True, eq=False)
class BoardView:
    """One view of a board: name of the picture, inner corners (n, 2) [px], and their numbers (n,)."""

    name: str
    corners_px: Floats
    numbers: NDArray[np.int64]

    def measure_moved_px(self, other: BoardView) -> float:
        """How far the corners are on the average from those of another view; infinite where none is seen in both."""
        _, here, there = np.intersect1d(self.numbers, other.numbers, return_indices=True)
        apart = np.linalg.norm(self.corners_px[here] - other.corners_px[there], axis=1)
        return float(np.mean(apart)) if len(apart) else float("inf")


def find_board(name: str, image: Image, pattern: Pattern) -> BoardView | str:
    """Find a board in a grey picture (h, w) uint8; or the reason why the picture cannot be used.

    Where markers are too small to be read the picture is magnified, and more of them are looked for where those that
    were read say that they must be; corners are less exact then.
    """
    seen = 0
    for times in (1, MAGNIFIED):
        ways = cv2.aruco.CharucoParameters()
        ways.tryRefineMarkers = times > 1
        magnified = cv2.resize(image, None, fx=times, fy=times, interpolation=cv2.INTER_CUBIC)
        corners, numbers, _, _ = cv2.aruco.CharucoDetector(pattern.board, ways).detectBoard(magnified)
        seen = 0 if numbers is None else len(numbers)
        if seen >= MIN_CORNERS and not pattern.board.checkCharucoCornersCollinear(numbers):
            corners_px = (np.asarray(corners, float).reshape(-1, 2) + 0.5) / times - 0.5
            return BoardView(name, corners_px, np.ravel(numbers).astype(np.int64))
    part = f"only {seen} corners of a" if seen else "no"
    return f"{part} board of {pattern.columns} x {pattern.rows} inner corners in it"


@dataclass(frozen=True, eq=False)
class Calibration:
    """A calibrated camera.

    Attributes:
        camera: intrinsics and distortion.
        deviations: (p,) standard deviations of the first p of :data:`PARAMETERS`.
        views: those that were used; view_rms_px: for each the RMS distance between found and projected corners.
        rms_px: the RMS distance over all corners.
        rejected: name of a view -> why it was left out.
    """

    camera: Camera
    deviations: Floats
    views: tuple[BoardView, ...]
    view_rms_px: Floats
    rms_px: float
    rejected: Mapping[str, str]

    @property
    def values(self) -> Floats:
        """(p,) the parameters, in the order of :data:`PARAMETERS`."""
        c = self.camera
        return np.array([c.fx, c.fy, c.cx, c.cy, *c.distortion])[: len(self.deviations)]


def calibrate(
    views: Sequence[BoardView], pattern: Pattern, size: tuple[int, int], *, with_k3: bool = False,
) -> Calibration:
    """Estimate the camera from views of a board, and reject views whose error is an outlier.

    Args:
        size: (width, height) of the pictures [px].
        with_k3: estimate the sixth-order term of the distortion too; wide lenses need it, others lose accuracy by it.

    Raises:
        ValueError: too few views, or no camera explains them.
    """
    used, rejected = list(views), dict[str, str]()
    while len(used) >= MIN_VIEWS:
        found = _fit_camera(used, pattern, size, with_k3, rejected)
        worst, usual = int(np.argmax(found.view_rms_px)), float(np.median(found.view_rms_px))
        if found.view_rms_px[worst] <= MAX_VIEW_RMS_RATIO * usual:
            return found
        why = f"its corners are off by {found.view_rms_px[worst]:.2f} px, {usual:.2f} px are usual here"
        rejected[used.pop(worst).name] = why
    raise ValueError(f"expected at least {MIN_VIEWS} views of the board that can be used, got {len(used)}")


def _fit_camera(
    views: Sequence[BoardView], pattern: Pattern, size: tuple[int, int], with_k3: bool, rejected: Mapping[str, str]
) -> Calibration:
    points = [pattern.points[view.numbers].astype(np.float32) for view in views]
    corners = [view.corners_px.astype(np.float32) for view in views]
    try:
        rms, matrix, terms, _, _, deviations, _, view_rms = cv2.calibrateCameraExtended(
            points, corners, size, np.eye(3), np.zeros(5), flags=0 if with_k3 else cv2.CALIB_FIX_K3, criteria=STEPS)
    except cv2.error as error:
        raise ValueError(f"expected views that a camera explains, got: {error.err}") from None
    m, k, sigmas = (np.asarray(found, float) for found in (matrix, np.ravel(terms)[:5], np.ravel(deviations)))
    if not (np.all(np.isfinite(m)) and np.all(np.isfinite(k))):
        raise ValueError("expected views that a camera explains, got none that fits")
    camera = Camera(float(m[0, 0]), float(m[1, 1]), float(m[0, 2]), float(m[1, 2]), *size, tuple(map(float, k)))
    return Calibration(camera, sigmas[: 9 if with_k3 else 8], tuple(views), np.ravel(view_rms), float(rms), rejected)


def draw_calibration(calibration: Calibration, grey: Image) -> bytes:
    """One view (h, w) with the corners of all views, and next to it the same view rectified, as PNG bytes."""
    camera = calibration.camera
    raw = np.ascontiguousarray(grey)
    seen, rectified = (cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
                       for image in (raw, Rectifier(camera, camera.pinhole).rectify(raw)))
    for x, y in np.concatenate([view.corners_px for view in calibration.views]):
        cv2.circle(seen, (round(16 * x), round(16 * y)), 32, CORNER, -1, cv2.LINE_AA, 4)
    return bytes(cv2.imencode(".png", np.hstack([seen, rectified]))[1])


MAX_TILT_RAD = 1.55  # largest tilt of a camera before the view of its mounting board is refused
MAX_ROLL_RAD = 0.8  # largest roll of a camera before the view of its mounting board is refused
STEP = 1e-6  # of the pose, by which derivatives are taken


@dataclass(frozen=True, eq=False)
class Mounting:
    """Place and orientation of a camera against the floor.

    Attributes:
        height_m: optical centre above the floor.
        tilt_rad: downward; roll_rad: clockwise as the camera looks (its right side is low).
        to_board_m: from the camera ahead along the floor: to the nearest inner corners of a lying board, to the middle
            of a standing one.
        yaw_rad: angle of the board's rows against the picture: the camera's yaw on the robot, to the left, where the
            board was laid square to the robot.
        deviations: (5,) standard deviations of the five parameters above.
    """

    height_m: float
    tilt_rad: float
    roll_rad: float
    to_board_m: float
    yaw_rad: float
    deviations: Floats


def estimate_mounting(
    calibration: Calibration, view: BoardView, pattern: Pattern, *, standing_at_m: float | None = None,
) -> Mounting:
    """Estimate the mounting from one view of a board, with its deviations propagated to first order.

    Args:
        standing_at_m: None for a board that lies flat on the floor; for an upright one the height of its lowest row of
            inner corners above the floor.

    Raises:
        ValueError: no such board is seen like this.
    """
    camera, points = calibration.camera, pattern.points[view.numbers]
    seen_by = camera.matrix, np.asarray(camera.distortion)
    found, turn, place = cv2.solvePnP(points, view.corners_px, *seen_by, flags=cv2.SOLVEPNP_IPPE)
    if not found:
        raise ValueError("expected corners of a flat board, got none that a pose explains")
    turn, place = cv2.solvePnPRefineLM(points, view.corners_px, *seen_by, turn, place)
    pose = np.concatenate([np.ravel(turn), np.ravel(place)])
    values = _compute_parameters(pose, pattern, standing_at_m)
    if not (values[0] > 0.0 and abs(values[1]) < MAX_TILT_RAD and abs(values[2]) < MAX_ROLL_RAD):
        where = "on the floor" if standing_at_m is None else "upright"
        raise ValueError(f"expected a board {where} before the camera, got one that puts it {values[0]:.2f} m high, "
                         f"tilted by {math.degrees(values[1]):.0f} and rolled by {math.degrees(values[2]):.0f} degrees")
    slope = np.stack([(_compute_parameters(pose + move, pattern, standing_at_m) - values) / STEP
                      for move in STEP * np.eye(6)], axis=1)
    covariance = slope @ _compute_pose_covariance(pose, view, points, calibration) @ slope.T
    height_m, tilt_rad, roll_rad, to_board_m, yaw_rad = (float(v) for v in values)
    return Mounting(height_m, tilt_rad, roll_rad, to_board_m, yaw_rad, np.sqrt(np.diag(covariance)))


def _compute_pose_covariance(pose: Floats, view: BoardView, points: Floats, calibration: Calibration) -> Floats:
    """(6, 6) covariance of a pose (6,), from the larger noise of the corners, here or in the calibration, and from the
    deviations of focal lengths and principal point, taken as independent.
    """
    camera = calibration.camera
    px, slope = cv2.projectPoints(points, pose[:3], pose[3:], camera.matrix, np.asarray(camera.distortion))
    jacobian = np.asarray(slope, float)
    here = float(np.sum((view.corners_px - px.reshape(-1, 2)) ** 2)) / (view.corners_px.size - 6)
    by_pose, by_camera = jacobian[:, :6], jacobian[:, 6:10]
    normal = np.linalg.inv(by_pose.T @ by_pose)
    moved = normal @ by_pose.T @ by_camera * calibration.deviations[:4]
    return np.asarray(max(here, calibration.rms_px**2 / 2.0) * normal + moved @ moved.T)


def _compute_parameters(pose: Floats, pattern: Pattern, standing_at_m: float | None) -> Floats:
    """The five parameters (5,) of :class:`Mounting` from a board's pose (6,): rotation vector, place, in the camera."""
    rotation = np.asarray(cv2.Rodrigues(pose[:3])[0], float)
    corners = pattern.points @ rotation.T + pose[3:]
    if standing_at_m is None:
        up = rotation[:, 2] * (-1.0 if rotation[:, 2] @ corners[0] > 0.0 else 1.0)  # the side that is seen
    else:
        axes = np.concatenate([rotation[:, :2].T, -rotation[:, :2].T])
        up = axes[np.argmin(axes[:, 1])]  # the direction along the board that is most upward in the picture
    ahead = np.array([0.0, 0.0, 1.0]) - up[2] * up  # the optical axis, projected to the floor
    ahead /= np.linalg.norm(ahead)
    away = (corners @ ahead).reshape(pattern.rows, pattern.columns)
    if standing_at_m is None:
        height_m = float(-np.mean(corners @ up))
        to_board_m = min(float(np.mean(side)) for side in (away[0], away[-1], away[:, 0], away[:, -1]))
    else:
        heights = corners @ up
        height_m = standing_at_m - float(np.mean(heights[heights < np.min(heights) + 0.5 * pattern.square_m]))
        to_board_m = float(np.mean(away))
    tilt, roll = math.atan2(-up[2], math.hypot(up[0], up[1])), math.atan2(-up[0], -up[1])
    return np.array([height_m, tilt, roll, to_board_m, _compute_yaw(rotation, up, ahead)])


def _compute_yaw(rotation: Floats, up: Floats, ahead: Floats) -> float:
    """Angle of the board's level lines against the camera's right, seen from above, within 45 degrees [rad]."""
    right = np.cross(ahead, up)
    x, y = rotation[:, :2].T
    level = x if abs(x @ up) < abs(y @ up) or abs(x @ right) > abs(y @ right) else y
    angle = math.atan2(float(level @ ahead), float(level @ right))
    return math.pi / 4.0 - (angle + math.pi / 4.0) % (math.pi / 2.0)  # the camera is turned the other way
