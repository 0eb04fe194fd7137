"""Overview: several runs side by side, one row a run, in a recording of its own.

It is made from the runs' recordings alone: what each was busy with, its milestones, its error and its way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from logs.reader import Series, read_series
from logs.recording import paths
from logs.recording.logger import BACKGROUND, window
from logs.recording.loggers.lanes import GAP, style
from logs.recording.palette import ACTIVITIES, BELIEVED, DONE, MATCHED, REJECTED, VERDICTS, Colour, faint
from logs.recording.stream import RecordingStream
from logs.run_errors import RecordingError
from world_models.words import metres

FOUND = "found itself"
MARKED: Mapping[str, Colour] = {**VERDICTS, FOUND: BELIEVED}
"""What is marked in a run's row of milestones."""
MARK_CYCLES = 5
"""A mark lasts so long, to be seen."""
HEIGHT_M = 0.2
"""Ways are drawn so high above the floor."""
MOST_MM = 150.0
ABOVE, SOUTH, LEAST_M = 1.15, 0.3, 8.0
"""The eye's height and way to the south, in lengths of the diagonal of all places, which counts as so much at least."""
PLAYED_PER_S = 20.0
"""Cycles, when the overview plays."""
COLUMNS = ("run", "scenario", "seed", "outcome", "error", "milestones", "refuted", "relocated", "collisions", "cycles")


@dataclass(frozen=True, slots=True)
class RunFiles:
    """A run to be shown.

    Attributes:
        name: of its row.
        recording: its recording.
        result: what its ``result.json`` holds; empty where there is none.
    """

    name: str
    recording: Path
    result: Mapping[str, Any]

    @property
    def outcome(self) -> str:
        return str(self.result.get("outcome", "unfinished"))

    @property
    def colour(self) -> Colour:
        """Of its line and its way."""
        return {"reached": MATCHED, "unfinished": DONE}.get(self.outcome, REJECTED)


def write_overview(runs: Sequence[RunFiles], path: Path, title: str) -> list[str]:
    """Write the overview of some runs, in their order.

    Returns:
        what is missing: a line for each recording that could not be read, of which only the result is shown.

    Raises:
        RecordingError: the overview cannot be written.
        ValueError: there are no runs.
    """
    if not runs:
        raise ValueError("expected at least one run, got none")
    tales, missing = [], []
    for run in runs:
        try:
            tales.append((run, _Tale.of(run.recording)))
        except RecordingError as error:
            missing.append(str(error))
    places = [place for _, tale in tales for _, place in tale.way]
    stream = RecordingStream(path, f"overview {title}", title, overview_blueprint(places))
    try:
        stream.fix(paths.SUMMARY, rr.TextDocument(summary(runs), media_type="text/markdown"))
        for number, (run, tale) in enumerate(tales):
            _draw(stream, number, run, tale)
        stream.fix(paths.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        if tales:
            stream.copy(tales[0][0].recording, f"/{paths.BUILDING}/**")
    finally:
        stream.close()
    return missing


def summary(runs: Sequence[RunFiles]) -> str:
    """The runs as a markdown table, and how many of them arrived."""
    reached = sum(run.outcome == "reached" for run in runs)
    table = [" | ".join(COLUMNS), "|".join("---" for _ in COLUMNS), *(" | ".join(_cells(run)) for run in runs)]
    return "\n".join([f"**{reached} of {len(runs)} reached their goal.**", "", *table])


def _cells(run: RunFiles) -> Iterator[str]:
    r = run.result
    milestones, error_m = r.get("milestones") or {}, r.get("final_error_m")
    values = (run.name, r.get("scenario"), r.get("seed"), run.outcome,
              metres(error_m) if isinstance(error_m, float) else None, milestones.get("verified"),
              milestones.get("refuted"), r.get("relocalizations"), r.get("collisions"), r.get("decisions"))
    yield from ("-" if value is None else str(value) for value in values)


@dataclass(frozen=True, slots=True)
class _Tale:
    """What the overview takes from a recording: activities, turning points, errors, places; each over cycles."""

    activities: Series
    marks: Series
    errors: Series
    way: Series

    @staticmethod
    def of(path: Path) -> _Tale:
        """Raises RecordingError where it cannot be read."""
        true_way = read_series(path, paths.TRUE_ROBOT, "Transform3D:translation")
        return _Tale(
            read_series(path, paths.HARVEY, "StateChange:state"), read_series(path, paths.CHAPTERS, "TextLog:level"),
            read_series(path, paths.POSITION, "Measurements:values") if true_way else [],
            true_way or read_series(path, paths.BELIEVED_ROBOT, "Transform3D:translation"))


def _draw(stream: RecordingStream, number: int, run: RunFiles, tale: _Tale) -> None:
    """What one run leaves in the overview: two lanes, a curve and a way."""
    part = rr.escape_entity_path_part(f"{number:03}_{run.name}")  # rows are sorted by name
    for path, states, styles in ((f"{paths.MOODS_OF}/{part}", tale.activities, ACTIVITIES),
                                 (f"{paths.MILESTONES}/{part}", [*_marks(tale.marks)], MARKED)):
        stream.fix(path, style(styles))
        for cycle, state in states:
            stream.at(cycle, 0.0)
            stream.log(path, rr.StateChange, state=[state])
    path = f"{paths.OFF}/{part}"
    stream.fix(path, rr.SeriesLines(names=[run.name], colors=[run.colour], widths=[1.5]))
    for cycle, (ahead_mm, left_mm) in tale.errors:
        stream.at(cycle, 0.0)
        stream.log(path, rr.Scalars, scalars=[math.hypot(ahead_mm, left_mm)])
    path = f"{paths.FLEET}/{part}"
    stream.fix(path, rr.Points3D.from_fields(colors=[run.colour], radii=0.25))
    strip = np.array([(x, y, z + HEIGHT_M) for _, (x, y, z) in tale.way], float).reshape(-1, 3)
    stream.fix(f"{path}/way", rr.LineStrips3D([strip], colors=[faint(run.colour, 120)], radii=0.03))
    for cycle, place in tale.way:
        stream.at(cycle, 0.0)
        stream.log(path, rr.Points3D, positions=[place])


def _marks(chapters: Series) -> Iterator[tuple[int, str]]:
    """Milestones and the moments when it found itself again."""
    marks = [(cycle, FOUND if word == "found" else word) for cycle, word in chapters if word in (*VERDICTS, "found")]
    for number, (cycle, word) in enumerate(marks):
        yield cycle, word
        following = marks[number + 1][0] if number + 1 < len(marks) else cycle + MARK_CYCLES + 1
        if following > cycle + MARK_CYCLES:
            yield cycle + MARK_CYCLES, GAP


def overview_blueprint(places: Sequence[Sequence[float]]) -> Any:
    """Outcomes and map to the left, one row a run to the right, errors below; ``places`` (x, y, z) are to be seen.

    The eye stands above the middle of all places, a little to the south.
    """
    known = np.array([*places] or [(0.0, 0.0, 0.0)], float)
    low, high = known.min(axis=0), known.max(axis=0)
    (x, y, _), size = (low + high) / 2, max(LEAST_M, float(np.linalg.norm(high - low)))
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=[x, y - SOUTH * size, ABOVE * size], look_target=[x, y, 0.0],
        eye_up=[0.0, 0.0, 1.0])
    busy = rrb.StateTimelineView(
        origin=f"/{paths.MOODS_OF}", name="Drives blue, looks yellow, plans orange, doubts violet, lost red")
    milestones = rrb.StateTimelineView(
        origin=f"/{paths.MILESTONES}", name="Milestones: verified green, refuted red, found itself blue")
    off = rrb.TimeSeriesView(
        origin=f"/{paths.OFF}", name="How far the belief is from the truth [mm]",
        axis_y=rrb.ScalarAxis(range=(0.0, MOST_MM)), plot_legend=rrb.PlotLegend(visible=False))
    table = rrb.TextDocumentView(origin=f"/{paths.SUMMARY}", name="How they ended")
    where = rrb.Spatial3DView(
        origin=f"/{paths.WORLD}", name="All robots, and their ways", line_grid=False,
        contents=["$origin/**", f"- /{paths.NAMES}"], background=BACKGROUND, eye_controls=eye)
    return window(rrb.Horizontal(
        rrb.Vertical(table, where, row_shares=[5, 4]),
        rrb.Vertical(rrb.Horizontal(busy, milestones), off, row_shares=[3, 1]), column_shares=[4, 7]), PLAYED_PER_S)
