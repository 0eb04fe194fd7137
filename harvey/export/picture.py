"""The camera picture that a run had seen by a cycle, as a PNG file."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

from harvey.errors import BadInput
from harvey.run_files.records import EntryRecord, read_records
from harvey.run_files.run_directory import RunDirectory
from harvey.runner.replay import open_pictures
from world_models.entries.body import Frame


def find_picture(run: RunDirectory, cycle: int) -> EntryRecord:
    """The newest picture that the board had seen in a cycle. Raises BadInput where there is none, or no such cycle."""
    newest, first, last = None, 0, 0
    for decision in read_records(run.journal):
        last = decision.cycle
        for record in (*decision.observed, *decision.made):
            if record.type == Frame.__name__ and record.change == "Posted":
                first = first or last
                newest = record if last <= cycle else newest
    if first == 0:
        raise BadInput(f"--picture: expected a run with pictures, got {run.path}, which has none")
    if newest is None or cycle > last:
        raise BadInput(f"--picture: expected a cycle from the first picture to the end, {first} to {last}, got {cycle}")
    return newest


def write_picture(run: RunDirectory, record: EntryRecord, out: Path) -> tuple[int, int]:
    """Writes it as PNG with the pixels of the camera's JPEG; returns width and height [px]. Raises BadInput."""
    from PIL import Image, UnidentifiedImageError

    try:
        picture = Image.open(BytesIO(open_pictures(run)[record.value["number"]]))
        picture.load()
    except (UnidentifiedImageError, OSError) as error:
        raise BadInput(f"{record.id}: expected a picture of the camera as JPEG, got: {error}") from None
    try:
        picture.save(out, "PNG")
    except OSError as error:
        raise BadInput(f"{out}: expected a file to write to, got: {error.strerror or error}") from None
    return picture.size
