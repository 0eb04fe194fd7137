"""Calibrating a camera: pictures in; a camera file, a report and a picture out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from harvey.errors import BadInput
from harvey.hardware.drivers.capture import CameraFault
from harvey.hardware.drivers.video_camera import VideoCamera
from knowledge_sources.methods.calibration import (
    PARAMETERS,
    BoardView,
    Calibration,
    Mounting,
    Pattern,
    calibrate,
    estimate_mounting,
    find_corners,
)
from knowledge_sources.methods.features import read_picture
from world_models.camera import CameraDeviation, CameraMount
from world_models.words import by_numbers, count

ENDINGS = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".pgm", ".webp")
NEW_PX = 0.08
"""A live view is new when its corners have moved so far on the average, as part of the picture's width."""
SAME_PX = 0.02
"""Two pictures show the same view where the corners have moved less on the average, as part of the picture's width."""
MAX_SPREAD_PX = 0.01
"""A camera is of no use that says no better, as part of the picture's width, where a direction is seen in it."""
ROLLED = math.radians(1.0)
UNITS = (("fx", "px"), ("fy", "px"), ("cx", "px"), ("cy", "px"))
Grey = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Boards:
    """Pictures gone through: views of the board, one picture to show, their size, and why others are of no use."""

    views: tuple[BoardView, ...]
    shown: Grey
    size: tuple[int, int]
    useless: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Mounted:
    """The board by which the mounting is found: lying on the floor, or standing upright with its lowest inner corners
    at a height; and how far ahead of the robot's turning axis it is, or how far the camera is; None where not measured.
    """

    standing_at_m: float | None = None
    board_ahead_m: float | None = None
    camera_ahead_m: float | None = None


def picture_files(names: Sequence[str]) -> tuple[Path, ...]:
    """The pictures that a user names: files, folders and patterns. Raises BadInput where there are none."""
    files: list[Path] = []
    for name in names:
        path = Path(name)
        found = [path]
        if path.is_dir():
            found = sorted((p for p in path.iterdir() if p.suffix.lower() in ENDINGS), key=by_numbers)
        if not path.exists() and any(c in name for c in "*?["):
            found = sorted(path.parent.glob(path.name), key=by_numbers)
        if not found or not all(p.is_file() for p in found):
            raise BadInput(f"expected pictures of a chessboard, a folder or a pattern of them, got {name!r}")
        files += found
    return tuple(dict.fromkeys(files))


def grey_of(path: Path) -> Grey:
    """A picture. Raises BadInput."""
    try:
        return read_picture(path.read_bytes()).grey
    except (OSError, ValueError) as error:
        raise BadInput(f"{path}: {getattr(error, 'strerror', None) or error}") from None


def find_boards(pictures: Iterator[tuple[str, Grey]], pattern: Pattern, tell: Callable[[str], None]) -> Boards:
    """Look for the board in pictures. Raises BadInput where there is none in any."""
    views: list[BoardView] = []
    useless: list[tuple[str, str]] = []
    shown: Grey | None = None
    size: tuple[int, int] | None = None
    for name, grey in pictures:
        here = grey.shape[1], grey.shape[0]
        size = size or here
        corners = find_corners(grey, pattern) if here == size else f"its size is {here}, that of the others {size}"
        if not isinstance(corners, str):
            again = next((view.name for view in views if _moved_px(corners, view.corners_px) < SAME_PX * here[0]), None)
            corners = corners if again is None else f"the same view as {again}, which counts once"
        tell(f"{name}: {corners if isinstance(corners, str) else 'board found'}")
        if isinstance(corners, str):
            useless.append((name, corners))
        else:
            views.append(BoardView(name, corners))
            shown = grey if shown is None else shown
    if shown is None or size is None:
        why = f"; {useless[0][0]}: {useless[0][1]}" if useless else ""
        raise BadInput(f"expected a board of {pattern.columns} x {pattern.rows} inner corners in at least one of "
                       f"{count(len(useless), 'picture')}, got none{why}")
    return Boards(tuple(views), shown, size, tuple(useless))


def _moved_px(corners: NDArray[np.float64], old: NDArray[np.float64]) -> float:
    """How far corners (n, 2) are from others on the average [px]; a board may be found from either end."""
    return min(float(np.mean(np.linalg.norm(way - old, axis=1))) for way in (corners, corners[::-1]))


def live_pictures(
    camera: VideoCamera, pattern: Pattern, wanted: int, tell: Callable[[str], None]
) -> Iterator[tuple[str, Grey]]:
    """Pictures with the board in them, each from another side, until there are enough. Raises BadInput."""
    kept: list[NDArray[np.float64]] = []
    told = ""
    while len(kept) < wanted:
        try:
            grey = read_picture(camera.look("calibrate").jpeg).grey
        except CameraFault as fault:
            raise BadInput(f"camera: {fault.kind}: {fault.detail} ({len(kept)} of {wanted} views taken)") from None
        found = find_corners(grey, pattern)
        if isinstance(found, str):
            told, before = found, told
            if told != before:
                tell(f"waiting: {found}")
        elif all(_moved_px(found, old) > NEW_PX * grey.shape[1] for old in kept):
            kept.append(found)
            told = ""
            yield f"view {len(kept)} of {wanted}", grey


def calibrate_camera(boards: Boards, pattern: Pattern, *, with_k3: bool) -> Calibration:
    """Raises BadInput where the views do not do."""
    try:
        found = calibrate(boards.views, pattern, boards.size, with_k3=with_k3)
        limit_px = MAX_SPREAD_PX * found.camera.width
        if found.spread_px <= limit_px:
            return found
        raise ValueError(
            f"expected views that tell to {limit_px:.2g} px where a direction is seen, got {found.spread_px:.2g} px "
            f"(fx {found.camera.fx:.0f} +- {found.deviations[0]:.2g} px): take the board from more sides, tilted up to "
            "45 degrees, near and far, into every corner of the picture")
    except ValueError as error:
        told = "".join(f"; {name}: {why}" for name, why in boards.useless[:1])
        raise BadInput(f"calibration: {error}{told}") from None


def find_mounting(
    calibration: Calibration, grey: Grey, pattern: Pattern, board: Mounted
) -> tuple[Mounting, CameraMount]:
    """The mounting by one picture. Raises BadInput."""
    corners = find_corners(grey, pattern)
    camera = calibration.camera
    if isinstance(corners, str):
        raise BadInput(f"the picture of the mounting: {corners}")
    if grey.shape != (camera.height, camera.width):
        raise BadInput(f"the picture of the mounting: expected {camera.width} x {camera.height} px, as the others, got "
                       f"{grey.shape[1]} x {grey.shape[0]}")
    try:
        found = estimate_mounting(calibration, corners, pattern, standing_at_m=board.standing_at_m)
    except ValueError as error:
        raise BadInput(f"the picture of the mounting: {error}") from None
    forward = board.camera_ahead_m or 0.0
    if board.board_ahead_m is not None:
        forward = board.board_ahead_m - found.to_board_m
    return found, CameraMount(found.height_m, forward, found.tilt_rad, found.roll_rad)


def find_deviation(calibration: Calibration, found: Mounting | None, board: Mounted | None) -> CameraDeviation:
    """How well camera and mounting are known; nothing is stated of what was measured by tape alone."""
    focal = float(calibration.deviations[0]) / calibration.camera.fx
    if found is None:
        return CameraDeviation(focal=focal)
    height_m, tilt_rad, roll_rad, to_board_m, _ = (float(sigma) for sigma in found.deviations)
    by_board = board is not None and board.board_ahead_m is not None
    return CameraDeviation(tilt_rad, height_m, to_board_m if by_board else 0.0, focal, roll_rad)


def report(
    calibration: Calibration, boards: Boards, found: Mounting | None, board: Mounted | None
) -> tuple[str, ...]:
    """Lines for people."""
    c = calibration.camera
    names = dict(UNITS)
    lines = [f"{c.width} x {c.height} px; {count(len(calibration.views), 'view')} of the board used; "
             f"corners are off by {calibration.rms_px:.3f} px RMS", ""]
    lines += [f"  {name}  {value:12.6g} +- {sigma:<9.3g} {names.get(name, '')}".rstrip()
              for name, value, sigma in zip(PARAMETERS, calibration.values, calibration.deviations, strict=False)]
    lines += ["", "RMS error of each view [px]:"]
    lines += [f"  {rms:.3f}  {view.name}" for view, rms in zip(calibration.views, calibration.view_rms_px, strict=True)]
    out = (*boards.useless, *sorted(calibration.rejected.items()))
    lines += ["", f"left out: {'nothing' if not out else ''}".rstrip(), *(f"  {name}: {why}" for name, why in out)]
    missing = _count_uncovered(calibration)
    if missing:
        lines += ["", f"no corner was seen in {missing} of 16 parts of the picture: the distortion is a guess there; "
                      "hold the board into the corners too"]
    return (*lines, *(() if found is None or board is None else _mounting_lines(found, board)))


def _mounting_lines(found: Mounting, board: Mounted) -> tuple[str, ...]:
    s = found.deviations
    lines = ["", "mounting:",
             f"  height  {found.height_m:8.4f} +- {s[0]:.4f} m",
             f"  tilt    {math.degrees(found.tilt_rad):8.3f} +- {math.degrees(s[1]):.3f} degrees, downward",
             f"  roll    {math.degrees(found.roll_rad):8.3f} +- {math.degrees(s[2]):.3f} degrees, clockwise",
             f"  board   {found.to_board_m:8.4f} +- {s[3]:.4f} m ahead of the camera"]
    if board.board_ahead_m is not None:
        forward = board.board_ahead_m - found.to_board_m
        lines += [f"  forward {forward:8.4f} +- {s[3]:.4f} m, and what the tape measure errs",
                  f"  yaw     {math.degrees(found.yaw_rad):8.3f} +- {math.degrees(s[4]):.3f} degrees to the left, if "
                  "the board was square to the robot"]
    for name, angle in (("roll", found.roll_rad), ("yaw", found.yaw_rad if board.board_ahead_m is not None else 0.0)):
        if abs(angle) > ROLLED:
            lines.append(f"  the camera file has no {name}: turn the camera until this is below 1 degree")
    return tuple(lines)


def _count_uncovered(calibration: Calibration) -> int:
    """How many of 4 x 4 parts of the picture no corner was seen in."""
    corners = np.concatenate([view.corners_px for view in calibration.views])
    size = np.array([calibration.camera.width, calibration.camera.height])
    parts = np.clip(np.floor(4.0 * (corners + 0.5) / size), 0, 3).astype(int)
    return 16 - len(np.unique(parts, axis=0))
