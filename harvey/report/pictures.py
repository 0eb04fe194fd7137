"""The camera's pictures for a report: smaller, and with the lines that were expected and found in them."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any, Literal

import numpy as np

from harvey.errors import BadInput
from harvey.run_files.records import EntryRecord
from harvey.why.history import History
from harvey.why.links import reason
from harvey.why.sentences import value_of
from world_models.camera import Camera
from world_models.entries.percepts import LineMatch, PoseFix, Segments
from world_models.entries.task import Milestone

WIDTH_PX, QUALITY = 320, 55
MOST = 700
"""So many pictures are kept at the most: all that were judged, and of the others each so many'th."""


@dataclass(frozen=True, slots=True)
class Lenses:
    """Where pixels of the rectified picture, which the robot reasons in, lie in the camera's own."""

    camera: Camera | None

    def place(self, segments_px: Any) -> list[list[float]]:
        """(n, 2, 2) segments as rows of u0, v0, u1, v1, from the picture's upper left corner."""
        points = np.asarray(segments_px, float).reshape(-1, 2, 2)
        if self.camera is not None and self.camera.pinhole is not self.camera and len(points):
            points = self.camera.project(self.camera.pinhole.rays(points))
        rows: list[list[float]] = np.round(points + 0.5, 1).reshape(-1, 4).tolist()
        return rows


def read_pictures(
    history: History, pictures: Mapping[int, bytes], camera: Camera | None
) -> Iterator[dict[str, Any]]:
    """The pictures that are kept, each since the cycle in which it was seen, with its lines."""
    lines = _lines(history, Lenses(camera))
    frames = [record for record in history.of_kind("Frame") if record.change != "Retracted"]
    for record in _chosen(frames, lines):
        number = record.value.get("number")
        if number not in pictures:
            raise BadInput(f"{record.ref}: expected picture {number!r} among those of the run, got none")
        data, size = shrink(pictures[number], "WEBP")
        yield {"cycle": record.cycle, "ref": record.ref, "webp": data, "size": size, **lines.get(record.id, {})}


def _chosen(frames: Sequence[EntryRecord], lines: Mapping[str, Any]) -> Sequence[EntryRecord]:
    others = [record for record in frames if record.id not in lines]
    room = max(1, MOST - (len(frames) - len(others)))
    step = -(-len(others) // room)
    kept = {record.ref for record in others[::step or 1]}
    return [record for record in frames if record.id in lines or record.ref in kept]


def shrink(jpeg: bytes, kind: Literal["JPEG", "WEBP"] = "JPEG") -> tuple[str, tuple[int, int]]:
    """A picture as a smaller one in base 64, and its size before. Raises BadInput where it is none.

    WebP takes half the bytes of JPEG, and twice the time.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        picture = Image.open(BytesIO(jpeg))
        size = picture.size
        picture.draft("RGB", (WIDTH_PX, WIDTH_PX))
        picture.thumbnail((WIDTH_PX, WIDTH_PX))
        out = BytesIO()
        picture.convert("RGB").save(out, kind, quality=QUALITY, optimize=True)
    except (UnidentifiedImageError, OSError) as error:
        raise BadInput(f"expected a picture of the camera as JPEG, got: {error}") from None
    return base64.b64encode(out.getvalue()).decode("ascii"), size


def _lines(history: History, lenses: Lenses) -> dict[str, dict[str, Any]]:
    """By frame: what was found, what was expected of a milestone there, and what agreed with it."""
    found: dict[str, dict[str, Any]] = {}
    for record in history.of_kind("Segments"):
        if record.change != "Retracted":
            segments = value_of(record, Segments)
            found[segments.frame] = {"found": lenses.place(segments.segments_px)}
    for record in history.of_kind("PoseFix"):
        match = reason(history, record, "LineMatch")
        seen = None if match is None else reason(history, match, "Segments")
        expected = None if match is None else reason(history, match, "Milestone")
        if match is None or seen is None or record.change == "Retracted":
            continue
        frame, agreed = value_of(seen, Segments).frame, value_of(record, PoseFix).inliers
        found[frame]["agreed"] = lenses.place(value_of(match, LineMatch).segments_px[agreed])
        if expected is not None:
            milestone = value_of(expected, Milestone)
            found[frame] |= {"expected": lenses.place(milestone.expected_px), "milestone": milestone.name()}
    return found
