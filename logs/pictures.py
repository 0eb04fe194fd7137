"""The camera's pictures of a run, by number; and the one that a cycle had seen, as a PNG file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from io import BytesIO
from pathlib import Path

from logs.mjpeg_file import Pictures
from logs.records import EntryRecord
from logs.run_directory import RunDirectory
from logs.run_errors import BadInput
from logs.timeline import Timeline
from world_models.entries import CameraPicture
from world_models.files.regular_files import MOST_BYTES


def open_pictures(run: RunDirectory) -> Mapping[int, bytes]:
    """The pictures of a run: from its camera file or, where it has none, from its recording.

    Raises:
        BadInput: the journal cannot be read, or the camera file is shorter than what it tells of.
        RecordingError: there is no camera file, and the recording cannot be read.
    """
    sizes = [_size(record) for record in Timeline(run.journal).of_kind(CameraPicture)]
    if sizes and not run.camera.is_file():
        from logs.reader import read_frames

        return read_frames(run.recording)
    pictures, there = Pictures(run.camera, sizes), camera_bytes(run)
    if there < pictures.end:
        raise BadInput(
            f"{run.camera}: expected {pictures.end} bytes of pictures that the journal tells of, got {there}")
    return pictures


def camera_bytes(run: RunDirectory) -> int:
    """Length of the camera file; 0 where there is none."""
    return run.camera.stat().st_size if run.camera.is_file() else 0


def _size(record: EntryRecord[CameraPicture]) -> tuple[int, int]:
    """Number and bytes of a picture that was seen."""
    try:
        number, size = int(record.fields["number"]), int(record.fields["jpeg"]["bytes"])
        if not 0 <= size <= MOST_BYTES:
            raise ValueError
        return number, size
    except (KeyError, TypeError, ValueError):
        raise BadInput(f"{record.ref}: expected a picture's number and length, got {record.fields!r}") from None


def find_picture(run: RunDirectory, cycle: int) -> EntryRecord[CameraPicture]:
    """The newest picture that the board had seen in a cycle. Raises BadInput where there is none, or no such cycle."""
    history = Timeline(run.journal)
    pictures = list(history.of_kind(CameraPicture))
    if not pictures:
        raise BadInput(f"--picture: expected a run with pictures, got {run.path}, which has none")
    first, last = pictures[0].cycle, history.cycles[-1]
    if not first <= cycle <= last:
        raise BadInput(f"--picture: expected a cycle from the first picture to the end, {first} to {last}, got {cycle}")
    return [picture for picture in pictures if picture.cycle <= cycle][-1]


LINE_COLOURS: Mapping[str, str] = {"found": "#9adfff", "expected": "#ffd84a", "agreed": "#54f08f"}
"""Of what is drawn over a picture, from the bottom up."""


def write_picture(
    run: RunDirectory, record: EntryRecord[CameraPicture], out: Path, lines: Mapping[str, Iterable[Sequence[float]]]
) -> tuple[int, int]:
    """Writes it as PNG with the pixels of the camera's JPEG, and lines over it; returns width and height [px].

    Args:
        lines: rows of u0, v0, u1, v1 [px] for each of :data:`LINE_COLOURS` that is there.

    Raises:
        BadInput: the picture is none, or cannot be written.
    """
    from PIL import Image, ImageDraw, UnidentifiedImageError

    try:
        picture = Image.open(BytesIO(open_pictures(run)[record.fields["number"]]))
        picture.load()
    except (UnidentifiedImageError, OSError) as error:
        raise BadInput(f"{record.id}: expected a picture of the camera as JPEG, got: {error}") from None
    draw = ImageDraw.Draw(picture)
    for kind, colour in LINE_COLOURS.items():
        for line in lines.get(kind, ()):
            draw.line(tuple(line), fill=colour, width=2)
    try:
        picture.save(out, "PNG")
    except OSError as error:
        raise BadInput(f"{out}: expected a file to write to, got: {error.strerror or error}") from None
    return picture.size
