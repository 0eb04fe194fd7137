"""The ``map.yaml`` of a ROS map server, read strictly: flat ``key: value`` lines, each fault with its file and line.

The keys are those of ``map_server`` (http://wiki.ros.org/map_server, "YAML format") and of nav2; others are passed
over.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from harvey_buildings.building_plan import BuildingError

MODES = ("trinary", "scale", "raw")
MAX_YAML_BYTES = 100_000
MAX_RESOLUTION_M = 1.0
EXAMPLE = ("image: {image}", "resolution: 0.05", "origin: [0.0, 0.0, 0.0]", "negate: 0", "occupied_thresh: 0.65",
           "free_thresh: 0.196")
"""A file that a person can write for a bare image; the resolution is what they must know."""


@dataclass(frozen=True, slots=True)
class MapFile:
    """What a ``map.yaml`` says.

    Attributes:
        image: path of the grid's picture.
        resolution_m: side of a cell [m].
        origin: x [m], y [m], yaw [rad] of the lower left corner of the picture in the map's frame.
        negate: whether white is occupied.
        occupied, free: probabilities of being occupied, above and below which a cell is occupied and free.
        mode: trinary, scale or raw.
    """

    image: Path
    resolution_m: float
    origin: tuple[float, float, float]
    negate: bool
    occupied: float
    free: float
    mode: str


def read_map_yaml(path: Path) -> MapFile:
    """The file read. Raises BuildingError with file, line, what was expected and what was got."""
    keys = _read_lines(path)
    for key in ("image", "resolution", "origin"):
        if key not in keys:
            raise BuildingError(f"{path.name}: expected a line '{key}: ...', got none")
    image, line = keys["image"]
    if not image or image[0] in "[{&*!|>":
        raise BuildingError(f"{path.name}:{line}: expected the name of a picture, got {image!r}")
    resolution = _number(path, keys, "resolution", None)
    if not 0.001 <= resolution <= MAX_RESOLUTION_M:
        raise BuildingError(f"{path.name}:{keys['resolution'][1]}: expected a resolution of 0.001 to "
                            f"{MAX_RESOLUTION_M} metres a cell, got {keys['resolution'][0]}")
    occupied, free = _number(path, keys, "occupied_thresh", 0.65), _number(path, keys, "free_thresh", 0.196)
    for key, value in (("occupied_thresh", occupied), ("free_thresh", free)):
        if not 0.0 <= value <= 1.0:
            raise BuildingError(f"{path.name}:{keys[key][1]}: expected {key} from 0 to 1, got {keys[key][0]}")
    if free >= occupied:
        line = keys.get("free_thresh", keys.get("occupied_thresh", ("", 0)))[1]
        raise BuildingError(f"{path.name}:{line}: expected free_thresh below occupied_thresh, "
                            f"got {free} and {occupied}")
    mode, line = keys.get("mode", ("trinary", 0))
    if mode.lower() not in MODES:
        raise BuildingError(f"{path.name}:{line}: expected mode {', '.join(MODES)}, got {mode!r}")
    return MapFile(path.parent / image, resolution, _origin(path, *keys["origin"]), _switch(path, keys), occupied, free,
                   mode.lower())


def _read_lines(path: Path) -> dict[str, tuple[str, int]]:
    """The value and line of each key."""
    try:
        if path.stat().st_size > MAX_YAML_BYTES:
            raise BuildingError(f"{path.name}: expected a map.yaml of a few lines, got {path.stat().st_size} bytes")
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise BuildingError(f"{path.name}: expected a text file of lines 'key: value', got bytes that are no UTF-8"
                            ) from None
    except OSError as error:
        raise BuildingError(f"{path.name}: expected a file to read, got: {error.strerror}") from None
    lines = [(_uncomment(line).rstrip(), number) for number, line in enumerate(text.splitlines(), 1)]
    lines = [(line, number) for line, number in lines if line.strip() and line.strip() not in ("---", "...")
             and not line.startswith("%")]
    keys: dict[str, tuple[str, int]] = {}
    at = ""
    for line, number in lines:
        is_item = line.lstrip().startswith("- ") or (line[0] in " \t" and at)
        if is_item and at:  # a list or value that goes on over lines
            value, first = keys[at]
            item = line.strip().removeprefix("- ").strip()
            if line.lstrip().startswith("- "):
                value = f"{value.removesuffix(']')}, {item}]" if value else f"[{item}]"
            else:
                value = f"{value} {item}".strip()
            keys[at] = value, first
            continue
        key, colon, value = line.partition(":")
        if not colon or line[0] in " \t" or (value and value[0] not in " \t"):
            raise BuildingError(f"{path.name}:{number}: expected a line 'key: value', got {line.strip()[:60]!r}")
        at = key.strip().strip("\"'")
        if at in keys:
            raise BuildingError(f"{path.name}:{number}: expected each key once, got {at!r} again "
                                f"(first on line {keys[at][1]})")
        keys[at] = _unquote(value.strip()), number
    return keys


def _uncomment(line: str) -> str:
    """The line without its comment: from a # at its start or after a space, outside quotes."""
    quote = ""
    for index, letter in enumerate(line):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'" and (index == 0 or line[index - 1] in " \t[,"):
            quote = letter
        elif letter == "#" and (index == 0 or line[index - 1] in " \t"):
            return line[:index]
    return line


def _unquote(value: str) -> str:
    return value[1:-1] if len(value) >= 2 and value[0] == value[-1] and value[0] in "\"'" else value


def _number(path: Path, keys: dict[str, tuple[str, int]], key: str, otherwise: float | None) -> float:
    if key not in keys and otherwise is not None:
        return otherwise
    value, line = keys[key]
    return _finite(path, line, key, value)


def _finite(path: Path, line: int, key: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        raise BuildingError(f"{path.name}:{line}: expected a number for {key}, got {value[:60]!r}") from None
    if not math.isfinite(number):
        raise BuildingError(f"{path.name}:{line}: expected a finite number for {key}, got {value!r}")
    return number


def _origin(path: Path, value: str, line: int) -> tuple[float, float, float]:
    parts = value.strip("[] ").split(",") if value.startswith("[") and value.endswith("]") else []
    if len(parts) != 3:
        raise BuildingError(f"{path.name}:{line}: expected origin: [x, y, yaw], got {value[:60]!r}")
    x, y, yaw = (_finite(path, line, "origin", part.strip()) for part in parts)
    return x, y, yaw


def _switch(path: Path, keys: dict[str, tuple[str, int]]) -> bool:
    value, line = keys.get("negate", ("0", 0))
    if value.lower() not in ("0", "1", "true", "false"):
        raise BuildingError(f"{path.name}:{line}: expected negate 0 or 1, got {value[:60]!r}")
    return value.lower() in ("1", "true")
