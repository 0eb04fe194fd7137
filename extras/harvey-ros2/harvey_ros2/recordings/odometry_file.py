"""What stands beside pictures in files: the odometry as TUM's lines or a table (CSV), and the times of the pictures."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path

from harvey.errors import BadInput
from harvey_ros2.recordings.bag_reader import BagItem
from world_models.files.regular_files import read_regular
from world_models.frames import Pose2

TUM = "time x y z qx qy qz qw"
TABLE = "time_s,x_m,y_m,heading_rad (or heading_deg)"


def read_odometry_file(path: Path) -> list[BagItem]:
    """Where the wheels count to be, in the order of time: a table where the name ends in ``.csv``, else TUM's lines.

    Raises:
        BadInput: a line is none of these, names file and line; times go back; or there are fewer than two.
    """
    rows = _read_table(path) if path.suffix.lower() == ".csv" else _read_tum(path)
    found = [BagItem(time_s, Pose2(x_m, y_m, heading_rad)) for time_s, x_m, y_m, heading_rad in rows]
    if len(found) < 2:
        raise BadInput(f"{path}: expected lines of odometry, {TUM} or of a .csv {TABLE}, got {len(found)}")
    for before, after in pairwise(found):
        if after.time_s < before.time_s:
            raise BadInput(f"{path}: expected times in order, got {after.time_s!r} after {before.time_s!r}")
    return found


def read_picture_times(path: Path) -> list[tuple[float, Path]]:
    """The pictures of a list as TUM's ``rgb.txt``, lines of time [s] and name, ordered by time. Raises BadInput."""
    found: list[tuple[float, Path]] = []
    for number, line in _lines(path):
        time, _, name = line.partition(" ")
        if not name:
            raise BadInput(f"{path}:{number}: expected a time and the name of a picture, got {line!r}")
        found.append((_numbers(path, number, [time], 1)[0], path.parent / name.strip()))
    return sorted(found)


def _read_tum(path: Path) -> Iterator[tuple[float, ...]]:
    for number, line in _lines(path):
        time_s, x_m, y_m, _, qx, qy, qz, qw = _numbers(path, number, line.replace(",", " ").split(), 8)
        yield time_s, x_m, y_m, math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))


def _read_table(path: Path) -> Iterator[tuple[float, ...]]:
    (_, head), *rest = list(_lines(path)) or [(0, "")]
    names = [name.strip() for name in head.split(",")]
    turn: Callable[[float], float] = math.radians if "heading_deg" in names else float
    wanted = ("time_s", "x_m", "y_m", "heading_deg" if "heading_deg" in names else "heading_rad")
    if lacking := [name for name in wanted if name not in names]:
        raise BadInput(f"{path}: expected a first line with {TABLE}, got none of {', '.join(lacking)}")
    for number, line in rest:
        cells: Mapping[str, str] = dict(zip(names, next(csv.reader([line])), strict=False))
        time_s, x_m, y_m, heading = _numbers(path, number, [cells.get(name, "") for name in wanted], 4)
        yield time_s, x_m, y_m, turn(heading)


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Lines with their numbers, without empty ones and comments."""
    try:
        text = read_regular(path).decode("utf-8-sig")
    except OSError as error:
        raise BadInput(f"{path}: expected a readable file, got: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise BadInput(f"{path}: expected text, got bytes that are none") from None
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip() and not line.startswith("#"):
            yield number, line.strip()


def _numbers(path: Path, number: int, words: list[str], wanted: int) -> list[float]:
    try:
        found = [float(word) for word in words]
    except ValueError:
        found = []
    if len(found) != wanted or not all(math.isfinite(one) for one in found):
        raise BadInput(f"{path}:{number}: expected {wanted} finite numbers, got {' '.join(words)!r}")
    return found
