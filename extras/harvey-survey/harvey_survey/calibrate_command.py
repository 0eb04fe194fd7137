"""``harvey calibrate``: a camera's intrinsics, lens distortion and mounting, from pictures of a ChArUco board."""

from __future__ import annotations

import re
import sys
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from harvey.commands.command import CliCommand, whole
from harvey.errors import BadInput

if TYPE_CHECKING:
    from harvey_survey.board_pictures import Boards, Grey, Mounted
    from harvey_survey.intrinsics import Calibration, Pattern


def _pattern(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,3})x(\d{1,3})", text, re.ASCII)
    if match is None:
        raise ArgumentTypeError(f"expected inner corners as 7x5, got {text!r}")
    return int(match[1]), int(match[2])


def _millimetres(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not -10000.0 < value < 10000.0:
        raise ArgumentTypeError(f"expected millimetres, got {text!r}")
    return value / 1000.0


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("images", metavar="IMAGE", nargs="*", help="pictures of the board: files, folders, 'left*.jpg'")
    parser.add_argument("--board", metavar="FILE", help="only write the board that is to be printed, as .pdf or .png")
    parser.add_argument("--camera", metavar="SOURCE", help="take them live: number of a device, video file or URL")
    parser.add_argument("--count", metavar="N", type=whole, default=20, help="live: how many views to take (20)")
    parser.add_argument("--pattern", metavar="CxR", type=_pattern, default=(7, 5),
                        help="inner corners in a row and in a column of the board (7x5)")
    parser.add_argument("--square-mm", metavar="MM", type=_millimetres, default=0.025, dest="square_m",
                        help="side of a square (25)")
    parser.add_argument("--k3", action="store_true", help="find a third radial term too (very wide lenses)")
    parser.add_argument("--out", metavar="FILE", default="camera.toml",
                        help="the camera file (camera.toml); report and picture go beside it, as .txt and .png")
    mount = parser.add_argument_group("mounting")
    mount.add_argument("--mount-board", choices=("floor", "standing"),
                       help="how the board is placed: flat on the floor, or upright on it")
    mount.add_argument("--mount-image", metavar="IMAGE", help="a picture of it there; live, one is taken")
    mount.add_argument("--lowest-mm", metavar="MM", type=_millimetres, dest="lowest_m",
                       help="standing: height of the lowest row of inner corners above the floor")
    mount.add_argument("--board-ahead-mm", metavar="MM", type=_millimetres, dest="board_ahead_m",
                       help="from the robot's turning axis ahead to the nearest inner corners (standing: to the board)")
    mount.add_argument("--forward-mm", metavar="MM", type=_millimetres, dest="forward_m",
                       help="or: from the turning axis ahead to the lens, by tape measure (0)")


def _run(args: Namespace) -> int:
    from harvey_survey.board_pictures import (
        calibrate_camera,
        find_deviation,
        find_mounting,
        grey_of,
        report,
        save_board,
    )
    from harvey_survey.intrinsics import Pattern, draw_calibration
    from world_models.files.toml.camera_file import camera_text

    try:
        columns, rows = args.pattern
        pattern = Pattern(columns, rows, args.square_m)
    except ValueError as error:
        raise BadInput(f"--pattern, --square-mm: {error}") from None
    if args.board is not None:
        save_board(Path(args.board), pattern)
        _print_status(f"written: {args.board}; print it in its true size, and measure a square")
        return 0
    board = _check_options(args)
    place = None if args.mount_image is None else grey_of(Path(args.mount_image))
    boards = _find_boards(args, pattern)
    calibration = calibrate_camera(boards, pattern, with_k3=args.k3)
    found, mount = None, None
    if board is not None:
        place = _take_place(args) if place is None else place
        found, mount = find_mounting(calibration, place, pattern, board)
    lines = report(calibration, boards, found, board)
    text = camera_text(calibration.camera, mount, _notes(calibration, args), find_deviation(calibration, found, board))
    _write(args.out, text, lines, draw_calibration(calibration, boards.shown))
    print("\n".join(lines))
    return 0


def _check_options(args: Namespace) -> Mounted | None:
    """The board of the mounting. Raises BadInput where options do not go together."""
    from harvey_survey.board_pictures import Mounted

    if bool(args.images) == (args.camera is not None):
        raise BadInput("expected pictures or --camera SOURCE, got " + ("both" if args.images else "neither"))
    measured = (args.mount_image, args.lowest_m, args.board_ahead_m, args.forward_m)
    if args.mount_board is None:
        if any(value is not None for value in measured):
            raise BadInput("--mount-board: expected floor or standing with options of the mounting, got nothing")
        return None
    if (args.lowest_m is None) == (args.mount_board == "standing"):
        raise BadInput("--lowest-mm: expected it with --mount-board standing, and only there")
    if args.mount_image is None and args.camera is None:
        raise BadInput("--mount-image: expected a picture of the board where it was placed, got none")
    if args.board_ahead_m is not None and args.forward_m is not None:
        raise BadInput("--forward-mm: expected it or --board-ahead-mm, got both")
    return Mounted(args.lowest_m, args.board_ahead_m, args.forward_m)


def _find_boards(args: Namespace, pattern: Pattern) -> Boards:
    from harvey_survey.board_pictures import find_boards, grey_of, live_pictures, picture_files

    if args.camera is None:
        pictures = ((str(path), grey_of(path)) for path in picture_files(args.images))
        return find_boards(pictures, pattern, _print_status)
    _print_status("show the board from all sides: near and far, tilted, and in every corner of the picture")
    with closing(live_pictures(args.camera)) as taken:
        return find_boards(taken, pattern, _print_status, wanted=args.count)


def _take_place(args: Namespace) -> Grey:
    """The picture of the mounting, taken when the user says so."""
    from harvey_survey.board_pictures import live_pictures

    where = "flat on the floor" if args.mount_board == "floor" else "upright on the floor"
    try:
        input(f"put the board {where} in front of the robot, square to it, then press Enter ")
    except EOFError:
        raise BadInput("--mount-image: expected Enter, or a picture, got the end of the input") from None
    with closing(live_pictures(args.camera)) as taken:
        return next(taken)[1]


def _notes(calibration: Calibration, args: Namespace) -> tuple[str, ...]:
    from harvey_survey.intrinsics import PARAMETERS

    sure = ", ".join(f"{name} {sigma:.2g}" for name, sigma in zip(PARAMETERS, calibration.deviations, strict=False))
    lines = [f"Written by harvey calibrate: {len(calibration.views)} views, {calibration.rms_px:.3f} px RMS.",
             f"Standard deviations: {sure}."]
    if args.mount_board is not None and args.board_ahead_m is None and args.forward_m is None:
        lines.append("forward_m was not measured: put in how far the lens is ahead of the turning axis.")
    return tuple(lines)


def _write(out: str, camera: str, lines: tuple[str, ...], picture: bytes) -> None:
    path = Path(out)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(camera, encoding="utf-8")
        path.with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
        path.with_suffix(".png").write_bytes(picture)
    except OSError as error:
        raise BadInput(f"--out {out}: expected a file to write to, got: {error.strerror}") from None
    _print_status(f"written: {path}, {path.with_suffix('.txt').name}, {path.with_suffix('.png').name}")


def _print_status(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


COMMAND = CliCommand(
    "calibrate", "measure a camera: lens, distortion, mounting",
    (
        ("harvey calibrate --board board.pdf", "the board, to be printed"),
        ("harvey calibrate photos/ --square-mm 24.8", "from photographs of it, with a square as it was measured"),
        ("harvey calibrate --camera 0 --count 25 --out eye.toml", "live, from a USB camera"),
        ("harvey calibrate photos/ --mount-board floor --mount-image floor.jpg --board-ahead-mm 900", "and mounting"),
        ("harvey calibrate --camera 0 --mount-board standing --lowest-mm 62 --forward-mm 80", "with an upright board"),
    ),
    _arguments, _run,
    """
Print the board (--board), glue it to something flat, and measure a square. Take 15 to 25 pictures: near and far, tilted
up to 45 degrees to all sides, and into every corner of the picture, also with a part of the board only. Do not touch
focus or zoom afterwards.

Mounting: --mount-board floor: lay the board flat on the floor, where the camera sees all of it, its rows square to the
robot. Height, tilt and roll follow from the board alone. A camera that looks straight ahead sees the floor at a flat
angle only: use large squares, or --mount-board standing: stand the board upright on the floor (against a box; check
with a set square) and measure how high its lowest row of inner corners is. For how far the camera is ahead of the axis
that the robot turns about, measure from below that axis to the nearest inner corners (--board-ahead-mm), or to the lens
(--forward-mm). The camera file knows no roll and no yaw: the report tells them, so that the camera can be turned right.
""".strip(),
)
