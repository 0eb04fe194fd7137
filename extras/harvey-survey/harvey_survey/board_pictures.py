"""Calibrating a camera: pictures in; a camera file, a report and a picture out."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass
from itertools import count as count_up
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from harvey.errors import BadInput
from harvey.hardware.drivers.capture import CameraFault
from harvey.hardware.drivers.video_camera import VideoCamera
from harvey_survey.intrinsics import (
    PARAMETERS,
    BoardView,
    Calibration,
    Mounting,
    Pattern,
    calibrate,
    estimate_mounting,
    find_board,
)
from knowledge_sources.methods.features import read_picture
from world_models.camera import CameraDeviation, CameraMount
from world_models.words import by_numbers, count

ENDINGS = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".pgm", ".webp")
NEW_PX = 0.08
"""A live view is new when its corners have moved so far on the average, as part of the picture's width."""
SAME_PX = 0.02
"""Two pictures show the same view where the corners have moved less on the average, as part of the picture's width."""
MAX_DEVIATION_PX = 0.01
"""A camera is of no use whose focal length or principal point is not known to this part of the picture's width."""
ROLLED = math.radians(1.0)
PRINTED_TIMES = 10
"""Of the least size at which a board can be drawn: sharp on any printer."""
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


def save_board(path: Path, pattern: Pattern) -> None:
    """The board to be printed, in its true size, with a margin. Raises BadInput."""
    image = pattern.draw(PRINTED_TIMES)
    square_px = image.shape[1] // (pattern.columns + 1)
    per_inch = square_px * 0.0254 / pattern.square_m
    page = Image.fromarray(np.pad(image, square_px // 2, constant_values=255))
    try:
        page.save(path, dpi=(per_inch, per_inch), resolution=per_inch)
    except (OSError, ValueError) as error:
        raise BadInput(f"--board {path}: expected a .pdf or .png file to write to, got: {error}") from None


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
            raise BadInput(f"expected pictures of a board, a folder or a pattern of them, got {name!r}")
        files += found
    return tuple(dict.fromkeys(files))


def grey_of(path: Path) -> Grey:
    """A picture. Raises BadInput."""
    try:
        return read_picture(path.read_bytes()).grey
    except (OSError, ValueError) as error:
        raise BadInput(f"{path}: {getattr(error, 'strerror', None) or error}") from None


def find_boards(
    pictures: Iterable[tuple[str, Grey]], pattern: Pattern, tell: Callable[[str], None], *, wanted: int | None = None
) -> Boards:
    """Look for the board in pictures; views that are alike count once. Raises BadInput where it is in none.

    Args:
        wanted: of pictures without end: so many views, each clearly from another side; what is of no use is not kept.
    """
    views: list[BoardView] = []
    useless: list[tuple[str, str]] = []
    shown: Grey | None = None
    size: tuple[int, int] | None = None
    apart, message = SAME_PX if wanted is None else NEW_PX, ""
    for name, grey in pictures:
        here = grey.shape[1], grey.shape[0]
        size = size or here
        found = find_board(name, grey, pattern) if here == size else f"its size is {here}, that of the others {size}"
        if isinstance(found, BoardView):
            near = (view.name for view in views if found.measure_moved_px(view) < apart * here[0])
            if again := next(near, ""):
                found = f"the same view as {again}, which counts once"
        if isinstance(found, BoardView):
            views.append(found)
            shown = grey if shown is None else shown
            tell(f"{name}: board found")
        elif wanted is None:
            useless.append((name, found))
            tell(f"{name}: {found}")
        elif found != message:
            message = found
            tell(f"{len(views)} of {wanted} views; {name}: {found}")
        if len(views) == wanted:
            break
    if shown is None or size is None:
        why = f"; {useless[0][0]}: {useless[0][1]}" if useless else ""
        raise BadInput(f"expected a board of {pattern.columns} x {pattern.rows} inner corners, as --board writes it, "
                       f"in at least one of {count(len(useless), 'picture')}, got none{why}")
    return Boards(tuple(views), shown, size, tuple(useless))


def live_pictures(source: str) -> Generator[tuple[str, Grey], None, None]:
    """Pictures without end of a camera: number of a device, video file or URL. Raises BadInput."""
    began_s = time.monotonic()
    try:
        with VideoCamera(source, None, clock=lambda: time.monotonic() - began_s, late_s=5.0) as camera:
            for number in count_up(1):
                yield f"picture {number}", read_picture(camera.look("calibrate").jpeg).grey
    except CameraFault as fault:
        raise BadInput(f"--camera {source}: {fault.kind}: {fault.detail}") from None


def calibrate_camera(boards: Boards, pattern: Pattern, *, with_k3: bool) -> Calibration:
    """Raises BadInput where the views do not do, by what the calibration itself says."""
    try:
        found = calibrate(boards.views, pattern, boards.size, with_k3=with_k3)
        worst, limit_px = int(np.argmax(found.deviations[:4])), MAX_DEVIATION_PX * found.camera.width
        if found.deviations[worst] <= limit_px:
            return found
        raise ValueError(
            f"expected views that tell focal length and principal point to {limit_px:.2g} px, got {PARAMETERS[worst]} "
            f"{found.values[worst]:.0f} +- {found.deviations[worst]:.2g} px: take the board from more sides, tilted up "
            "to 45 degrees, near and far, into every corner of the picture")
    except ValueError as error:
        message = "".join(f"; {name}: {why}" for name, why in boards.useless[:1])
        raise BadInput(f"calibration: {error}{message}") from None


def find_mounting(
    calibration: Calibration, grey: Grey, pattern: Pattern, board: Mounted
) -> tuple[Mounting, CameraMount]:
    """The mounting by one picture. Raises BadInput."""
    camera, view = calibration.camera, find_board("mount", grey, pattern)
    try:
        if isinstance(view, str):
            raise ValueError(view)
        if grey.shape != (camera.height, camera.width):
            raise ValueError(f"expected {camera.width} x {camera.height} px, as the others, got "
                             f"{grey.shape[1]} x {grey.shape[0]}")
        found = estimate_mounting(calibration, view, pattern, standing_at_m=board.standing_at_m)
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
    lines = [f"{c.width} x {c.height} px; {count(len(calibration.views), 'view')} of the board used; "
             f"corners are off by {calibration.rms_px:.3f} px RMS", ""]
    lines += [f"  {name}  {value:12.6g} +- {sigma:<9.3g} {'px' * (name[0] in 'fc')}".rstrip()
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
    height, tilt, roll, away, yaw = found.deviations.tolist()
    rows = [("height", found.height_m, height, "m"), ("tilt", found.tilt_rad, tilt, "degrees, downward"),
            ("roll", found.roll_rad, roll, "degrees, clockwise"),
            ("board", found.to_board_m, away, "m ahead of the camera")]
    if board.board_ahead_m is not None:
        rows += [("forward", board.board_ahead_m - found.to_board_m, away, "m, and what the tape measure errs"),
                 ("yaw", found.yaw_rad, yaw, "degrees to the left, if the board was square to the robot")]
    lines = ["", "mounting:"]
    for name, value, sigma, unit in rows:
        times = math.degrees(1.0) if unit.startswith("degrees") else 1.0
        lines.append(f"  {name:7} {times * value:8.4f} +- {times * sigma:.4f} {unit}")
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
