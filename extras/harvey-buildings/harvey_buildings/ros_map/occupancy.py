"""The cells of a ROS map: which are free, occupied and unknown, as the map server reads the picture."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from harvey_buildings.building_plan import BuildingError
from harvey_buildings.ros_map.map_yaml import EXAMPLE, MapFile

Cells = NDArray[np.int8]
FREE, OCCUPIED, UNKNOWN = np.int8(0), np.int8(1), np.int8(-1)
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
    A transparent pixel is unknown. (The map server's trinary mode counts the alpha channel as a colour.)
    """
    picture, alpha = _read_picture(file.image)
    if file.mode == "raw":
        p = picture / 100.0
        seen = picture <= 100.0
    else:
        p = picture / 255.0 if file.negate else (255.0 - picture) / 255.0
        seen = np.ones(p.shape, bool)
    cells = np.full(p.shape, UNKNOWN)
    cells[seen & (p < file.free)] = FREE
    cells[seen & (p > file.occupied)] = OCCUPIED
    if alpha is not None:
        cells[alpha < 0.5] = UNKNOWN
    return cells


def _read_picture(path: Path) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
    """(rows, columns) mean of the colour channels, 0 to 255, and the alpha channel where there is one, 0 to 1."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise BuildingError(f"{path.name}: expected a picture of at most {MAX_BYTES} bytes, got "
                                f"{path.stat().st_size}")
        data = path.read_bytes()
    except FileNotFoundError:
        raise BuildingError(f"{path.name}: expected the picture that the map.yaml names, got none at {path}") from None
    except (OSError, ValueError) as error:
        raise BuildingError(f"{path.name}: expected a picture to read, got: {error}") from None
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
        raise BuildingError(f"{name}: expected a picture as PGM (P2, P5) or PNG, got bytes that start with "
                            f"{data[:8]!r}")
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
