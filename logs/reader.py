"""Reading a recording back: pictures, the true way, and whatever else was logged."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader
from rerun.error_utils import RerunWarning

from logs.recording.loggers.picture_overlays import NUMBER
from logs.recording.paths import IMAGE, TRUE_ROBOT
from logs.run_errors import RecordingError

ROW_ID = "rerun.controls.RowId"
JPEG = "EncodedImage:blob"
TRANSLATION, QUATERNION = "Transform3D:translation", "Transform3D:quaternion"
CYCLE = "cycle"
"""The timeline of a recording."""
Series = list[tuple[int, Any]]
"""(cycle, value) in the order of time."""


def read_frames(path: Path) -> dict[int, bytes]:
    """The pictures of a recording: number -> JPEG bytes, as the camera delivered them.

    Raises RecordingError where the file is no recording, or is damaged.
    """
    return {row[NUMBER].as_py(): row[JPEG].values.to_numpy().tobytes() for row in _rows(path, IMAGE, (NUMBER, JPEG))}


def read_true_track(path: Path) -> list[tuple[int, float, float, float]]:
    """Where the robot truly was: (cycle, x [m], y [m], heading [rad]) wherever it had moved, in the world frame.

    Raises RecordingError where the file is no recording, or is damaged.
    """
    track = []
    for row in _rows(path, TRUE_ROBOT, (TRANSLATION, QUATERNION), CYCLE):
        (x_m, y_m, _), (_, _, sine, cosine) = row[TRANSLATION].as_py(), row[QUATERNION].as_py()
        track.append((row[CYCLE], x_m, y_m, 2.0 * math.atan2(sine, cosine)))
    return track


def read_series(path: Path, entity: str, component: str) -> Series:
    """(cycle, value) of a component in the order in which it was logged; a value of many is a list.

    Raises RecordingError where the file is no recording, or is damaged.
    """
    found: list[tuple[bytes, int, Any]] = []
    for batch in _batches(path, entity):
        if component in batch.schema.names:
            found += zip(*(batch.column(name).to_pylist() for name in (ROW_ID, CYCLE, component)), strict=True)
    in_order = sorted((row for row in found if row[2]), key=lambda row: row[0])
    return [(cycle, values[0] if len(values) == 1 else values) for _, cycle, values in in_order]


def damage_of(path: Path) -> str | None:
    """What is wrong with a recording, as where a crash cut it off; None for a whole one. Its contents are not read."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RerunWarning)
            RrdReader(path).stream()
    except RerunWarning:
        return "it has no end"
    except Exception as error:  # the reader's errors have no common type; the cause is in the file in any case
        return str(error)
    return None


def _rows(path: Path, entity: str, components: tuple[str, ...], timeline: str = "") -> list[dict[str, Any]]:
    """The rows of an entity that have all these components, in the order in which they were logged.

    Each has its time on a timeline too, where one is named.
    """
    rows = [row for batch in _batches(path, entity) for row in _complete(batch, components, timeline)]
    return [row for _, row in sorted(rows, key=lambda pair: pair[0])]


def _batches(path: Path, entity: str) -> list[Any]:
    """What was logged at an entity path. Raises RecordingError."""
    if not path.is_file():
        raise RecordingError(f"{path}: expected a recording, got no such file")
    try:
        with warnings.catch_warnings():  # a recording without its footer, as a crash leaves it, is read as well
            warnings.simplefilter("ignore", RerunWarning)
            reader = RrdReader(path)
        chunks = reader.stream().filter(content=f"/{entity}", is_static=False)
        return [chunk.to_record_batch() for chunk in chunks]
    except Exception as error:  # as above
        raise RecordingError(f"{path}: expected a whole Rerun recording, got: {error} (harvey repair {path.parent} "
                             "draws it again)") from None


def _complete(batch: Any, components: tuple[str, ...], timeline: str) -> Iterator[tuple[bytes, dict[str, Any]]]:
    """(row id, components) of the rows of a batch that have all of the components."""
    if not set(components) <= set(batch.schema.names):
        return
    for number, row_id in enumerate(batch.column(ROW_ID)):
        cells = [batch.column(name)[number].values for name in components]
        if all(cell is not None and len(cell) for cell in cells):
            row = {name: cell[0] for name, cell in zip(components, cells, strict=True)}
            yield row_id.as_py(), row | ({timeline: batch.column(timeline)[number].as_py()} if timeline else {})
