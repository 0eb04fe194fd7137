"""The files of a ROS map, read and written: ``map.yaml`` and its picture of free, occupied and unknown cells.

http://wiki.ros.org/map_server, "Map format". The keys of the ``map.yaml`` are those of ``map_server`` and of nav2;
others are passed over. It is read strictly: flat ``key: value`` lines, each fault with its file and line. A storey of a
world is written as map_server writes it: trinary, 254 is free, 0 occupied, 205 unknown.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from harvey_buildings.fitting.building_plan import BuildingError, Floats
from world_models.building.world import World
from world_models.files.regular_files import read_regular

MODES = ("trinary", "scale", "raw")
YES, NO = ("1", "true", "yes", "on", "y"), ("0", "false", "no", "off", "n")
"""A switch as YAML's readers take it."""
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
        text = read_regular(path, MAX_YAML_BYTES).decode("utf-8-sig")
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
        number = float(value.encode("ascii"))  # no digits of other scripts
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
    if value.lower() not in (*YES, *NO):
        raise BuildingError(f"{path.name}:{line}: expected negate 0 or 1, got {value[:60]!r}")
    return value.lower() in YES


Cells = NDArray[np.int8]
FREE, OCCUPIED, UNKNOWN = np.int8(0), np.int8(1), np.int8(-1)
SAVED_UNKNOWN = 50 / 255
"""Occupancy of the grey that savers write for unknown, 205."""
MAX_CELLS = 100_000_000
MAX_BYTES = 500_000_000
PICTURES = (".pgm", ".png")


def explain_bare_picture(path: Path) -> str:
    """What to do with a picture that no ``map.yaml`` names."""
    lines = "\n".join(f"  {line.format(image=path.name)}" for line in EXAMPLE)
    return (f"{path.name}: expected the map.yaml of a ROS map, got a picture alone, which does not say how large a "
            f"cell is. Write {path.stem}.yaml beside it, with your resolution in metres a cell, and import that:\n"
            f"{lines}")


def read_cells(file: MapFile) -> Cells:
    """(rows, columns) of FREE, OCCUPIED, UNKNOWN; row 0 is at the top, the largest y. Raises BuildingError.

    ``trinary`` and ``scale``: map_server, "Value Interpretation": occupancy p = (255 - x) / 255, or x / 255 where
    ``negate``; a colour counts by the mean of its channels. ``raw``: x from 0 to 100 is the occupancy in percent.
    A transparent pixel is unknown, in ``scale`` one that is not quite opaque too. (The map server's trinary mode counts
    the alpha channel as a colour.) So is a cell of 205 (50 where ``negate``) whatever the thresholds: savers write it
    for unknown, and Nav2's, until 2025, with a ``free_thresh`` of 0.25, which would make it free.
    """
    picture, alpha = _read_picture(file.image)
    if file.mode == "raw":
        p = picture / 100.0
        seen = picture <= 100.0
    else:
        p = picture / 255.0 if file.negate else (255.0 - picture) / 255.0
        seen = np.abs(p - SAVED_UNKNOWN) > 1e-3
    cells = np.full(p.shape, UNKNOWN)
    cells[seen & (p < file.free)] = FREE
    cells[seen & (p > file.occupied)] = OCCUPIED
    if alpha is not None:
        cells[alpha < (1.0 if file.mode == "scale" else 0.5)] = UNKNOWN
    return cells


def _read_picture(path: Path) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
    """(rows, columns) mean of the colour channels, 0 to 255, and the alpha channel where there is one, 0 to 1."""
    try:
        data = read_regular(path, MAX_BYTES)
    except FileNotFoundError:
        raise BuildingError(f"{path.name}: expected the picture that the map.yaml names, got none at {path}") from None
    except OSError as error:
        raise BuildingError(f"{path.name}: expected a picture to read, got: {error.strerror}") from None
    if data[:2] in (b"P2", b"P5"):
        return _read_pgm(path.name, data), None
    return _read_png(path.name, data)


def _read_png(name: str, data: bytes) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
    """The colour mean, 0 to 255, and alpha, 0 to 1, of a PNG with 1 to 16 bits a channel."""
    from matplotlib.image import imread

    _check_png_size(name, data)
    try:
        image = np.asarray(imread(BytesIO(data), format="png"), dtype=np.float32)
    except (OSError, ValueError, SyntaxError, EOFError) as error:
        raise BuildingError(f"{name}: expected a picture (PGM or PNG) that is whole, got one that cannot be read: "
                            f"{str(error)[:80]}") from None
    if image.ndim == 2:
        return 255.0 * image, None
    return 255.0 * image[..., :3].mean(axis=2, dtype=np.float32), image[..., 3] if image.shape[2] == 4 else None


def _check_png_size(name: str, data: bytes) -> None:
    """Refuse a PNG that says it is huge or has no end before it is unpacked."""
    if data[:8] != b"\x89PNG\r\n\x1a\n" or len(data) < 24:
        raise BuildingError(f"{name}: expected a picture as PGM (P2, P5) or PNG, got another kind of file")
    width, height = int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    if width * height > MAX_CELLS:
        raise BuildingError(f"{name}: expected at most {MAX_CELLS} cells, got {width} x {height}")
    if b"IEND" not in data[-64:]:
        raise BuildingError(f"{name}: expected a whole PNG picture, got one that is cut short")


def _read_pgm(name: str, data: bytes) -> NDArray[np.float32]:
    """(rows, columns) of a PGM, plain (P2) or binary (P5), scaled to 0..255 (netpbm, "PGM Format Specification")."""
    at = 2
    numbers: list[int] = []
    while len(numbers) < 3:
        start = at
        while at < len(data) and data[at : at + 1].isspace():
            at += 1
        if data[at : at + 1] == b"#":
            end = data.find(b"\n", at)
            at = end if end >= 0 else len(data)
            continue
        digits = at
        while digits < len(data) and data[digits : digits + 1].isdigit():
            digits += 1
        if digits == at or digits - at > 9 or start == at:
            raise BuildingError(f"{name}: expected the width, height and largest value of a PGM, got "
                                f"{data[at : at + 12]!r}")
        numbers.append(int(data[at:digits]))
        at = digits
    width, height, largest = numbers
    if not 0 < width * height <= MAX_CELLS:
        raise BuildingError(f"{name}: expected 1 to {MAX_CELLS} cells, got {width} x {height}")
    if not 0 < largest < 65536:
        raise BuildingError(f"{name}: expected a largest value of 1 to 65535, got {largest}")
    if data[:2] == b"P2":
        try:
            values = np.array(data[at:].split()[: width * height], dtype=np.float32)
        except ValueError:
            raise BuildingError(f"{name}: expected a plain PGM of numbers, got other letters") from None
    else:
        body = data[at + 1 :]
        values = np.frombuffer(body[: len(body) // 2 * 2] if largest > 255 else body, ">u2" if largest > 255 else "u1")
    if len(values) < width * height:
        raise BuildingError(f"{name}: expected {width} x {height} cells, got {len(values)}: the file is cut short")
    picture = values[: width * height].reshape(height, width).astype(np.float32)
    return picture if largest == 255 else picture * np.float32(255.0 / largest)


FREE_VALUE, OCCUPIED_VALUE, UNKNOWN_VALUE = 254, 0, 205
MARGIN_M = 0.5
WALL_M = 0.1
"""Walls are drawn so far from the floor beside them; what is behind is unknown."""
MIN_WALL_CELLS = 1.5
"""So walls have no gaps at corners."""
SEAM_M = 0.01
"""Doorways reach so far into their rooms, so that no row of cells between them is lost."""
RESOLUTIONS_M = (0.005, 0.5)

YAML = """\
# {world}{storey}, by harvey world export. The map's frame is the world's: metres, x to the east, y to the north.
image: {image}
mode: trinary
resolution: {resolution:g}
origin: [{x:.6f}, {y:.6f}, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""

Mask = NDArray[np.bool_]


def write_ros_map(world: World, rooms: Sequence[str], out: Path, resolution_m: float, with_things: bool) -> str:
    """Write ``out`` (.yaml) and its picture (.pgm) of these rooms; return what was written. Raises OSError, ValueError.

    Args:
        rooms: of one storey.
        resolution_m: side of a cell.
        with_things: whether things that the robot could hit are occupied.
    """
    low, shape = _bounds(world, rooms, resolution_m)
    inside = _fill([world.outline(room) for room in rooms], low, shape, resolution_m)
    doors = {door.name: door for room in rooms for door in world.doorways_of(room)}
    thresholds = [shapely.Polygon(door.thresholds_world.reshape(-1, 2)) for door in doors.values()]
    seams = [np.asarray(t.buffer(SEAM_M, join_style="mitre").exterior.coords) for t in thresholds]
    inside |= _fill(seams, low, shape, resolution_m)
    things = _fill((foot for room in rooms for foot in world.obstacles(room)) if with_things else (), low, shape,
                   resolution_m)
    thick = max(WALL_M / resolution_m, MIN_WALL_CELLS)
    is_wall = ~inside & (ndimage.distance_transform_edt(~inside) <= thick)
    picture = np.full(shape, UNKNOWN_VALUE, np.uint8)
    picture[inside] = FREE_VALUE
    picture[is_wall | (inside & things)] = OCCUPIED_VALUE
    image = out.with_suffix(".pgm")
    rows, columns = shape
    image.write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + picture[::-1].tobytes())
    storey = f", floor at {world.floor_m(rooms[0]):.2f} m"
    out.write_text(YAML.format(world=world.name, storey=storey, image=image.name, resolution=resolution_m, x=low[0],
                               y=low[1]), encoding="utf-8")
    return f"{len(rooms)} rooms in {columns} x {rows} cells of {resolution_m:g} m, picture {image.name}"


def _bounds(world: World, rooms: Sequence[str], resolution_m: float) -> tuple[Floats, tuple[int, int]]:
    """The lower left corner of the grid [m, world], and its rows and columns. Raises ValueError."""
    low_m, high_m = RESOLUTIONS_M
    if not low_m <= resolution_m <= high_m:
        raise ValueError(f"expected a resolution of {low_m:g} to {high_m:g} metres a cell, got {resolution_m:g}")
    corners = np.concatenate([world.outline(room) for room in rooms])
    low = np.floor((corners.min(axis=0) - MARGIN_M) / resolution_m) * resolution_m
    columns, rows = np.ceil((corners.max(axis=0) + MARGIN_M - low) / resolution_m).astype(int).tolist()
    if rows * columns > MAX_CELLS:
        raise ValueError(f"expected at most {MAX_CELLS} cells, got {columns} x {rows}: choose larger ones")
    return np.asarray(low), (rows, columns)


def _fill(polygons: Iterable[Floats], low: Floats, shape: tuple[int, int], cell_m: float) -> Mask:
    """The cells, row 0 at the smallest y, whose middles are in one of the polygons (k, 2) [m, world]."""
    mask = np.zeros(shape, bool)
    for corners in polygons:
        first = np.clip(np.floor((corners.min(axis=0) - low) / cell_m).astype(int), 0, None)
        last = np.clip(np.ceil((corners.max(axis=0) - low) / cell_m).astype(int), 0, shape[::-1])
        x, y = (low[axis] + (np.arange(first[axis], last[axis]) + 0.5) * cell_m for axis in (0, 1))
        window = mask[first[1] : last[1], first[0] : last[0]]
        polygon = shapely.Polygon(corners)
        shapely.prepare(polygon)
        window |= shapely.contains_xy(polygon, *np.meshgrid(x, y))
    return mask
