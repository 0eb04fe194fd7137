"""A mission on one page: the viewer's pictures of its ten most telling moments, on one sheet with captions.

    python -m docs.tools.contact_sheet runs/bump-0/recording.rrd docs/moments-bump.jpg
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import shorten

from matplotlib.figure import Figure
from matplotlib.image import imread

from docs.tools.look import look
from docs.tools.moments import Moment, moments_of
from logs.run_errors import RecordingError

MOMENTS = 10
COLUMNS = 2
PICTURE_IN = (9.6, 5.4)
CAPTION_IN = 0.34
"""Sizes on the sheet [inches]; at PIXELS_PER_IN."""
PIXELS_PER_IN = 66
LETTERS = 104
"""So many fit into a caption."""
QUALITY = 60


def contact_sheet(recording: Path, sheet: Path, pictures: Path | None = None) -> tuple[list[Moment], list[str]]:
    """Write the sheet; gives the moments, and what the viewer's views reported on the way.

    Args:
        pictures: a folder in which the whole pictures are kept as well.

    Raises:
        RecordingError: the recording cannot be read, has no moments, or the viewer cannot start.
    """
    moments = moments_of(recording, MOMENTS)
    if not moments:
        raise RecordingError(f"{recording}: expected turning points, got none")
    with TemporaryDirectory() as spare:
        folder = pictures or Path(spare)
        reports = look(recording, folder, [moment.cycle for moment in moments])
        _montage(moments, folder, sheet)
    return moments, reports


def _montage(moments: Sequence[Moment], folder: Path, sheet: Path) -> None:
    """The pictures row by row, each with its caption above it."""
    rows = -(-len(moments) // COLUMNS)
    wide_in, high_in = PICTURE_IN[0] * COLUMNS, (PICTURE_IN[1] + CAPTION_IN) * rows
    figure = Figure(figsize=(wide_in, high_in), dpi=PIXELS_PER_IN, facecolor="white")
    for number, moment in enumerate(moments):
        row, column = divmod(number, COLUMNS)
        top = 1 - row / rows
        figure.text((column * PICTURE_IN[0] + 0.1) / wide_in, top - CAPTION_IN / 2 / high_in, caption(moment),
                    fontsize=12, verticalalignment="center")
        axes = figure.add_axes((column / COLUMNS, 1 - (row + 1) / rows, 0.996 / COLUMNS, PICTURE_IN[1] / high_in))
        axes.imshow(imread(folder / f"cycle-{moment.cycle}.png"), interpolation="lanczos", aspect="auto")
        axes.set_axis_off()
    figure.savefig(sheet, pil_kwargs={"quality": QUALITY, "optimize": True})


def caption(moment: Moment) -> str:
    """One line: when, what kind of moment, and what happens."""
    text = " ".join(moment.text.replace("$", "").split())
    return shorten(f"cycle {moment.cycle}  {moment.kind}: {text}", LETTERS, placeholder=" …")


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description="The ten most telling moments of a recording on one sheet.")
    parser.add_argument("recording", type=Path)
    parser.add_argument("sheet", type=Path, help="a .jpg file")
    parser.add_argument("--pictures", type=Path, help="a folder in which the whole pictures are kept as well")
    wanted = parser.parse_args()
    try:
        moments, reports = contact_sheet(wanted.recording, wanted.sheet, wanted.pictures)
    except (RecordingError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    print("\n".join(map(caption, moments)))
    print("\n".join(reports) or "no view reports anything")
    return 1 if reports else 0


if __name__ == "__main__":
    sys.exit(main())
