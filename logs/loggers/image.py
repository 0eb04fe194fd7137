"""What is drawn over the camera's picture: lines expected, found and matched, and the templates that are followed."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from logs.mirror import Mirror, Moment
from logs.palette import EXPECTED, FOUND, MATCHED, PLANNED, REJECTED, Colour
from logs.paths import DRIFTS, IMAGE, WINDOWS
from logs.paths import EXPECTED as EXPECTED_PATH
from logs.paths import MATCHED as MATCHED_PATH
from logs.paths import SEGMENTS as SEGMENTS_PATH
from logs.tape import Tape
from world_models.body import Frame
from world_models.camera import Camera, clip_segments
from world_models.percepts import LineMatch, PoseFix, Segments, Track, Tracks
from world_models.task import Milestone

DRIFT_SCALE = 5.0
"""Drifts of a few pixels would not show: their arrows are drawn longer, and the view's legend says so."""

NAMES_PATH, REJECTED_PATH = f"{IMAGE}/names", f"{IMAGE}/rejected"
STYLES = ((EXPECTED_PATH, EXPECTED, 1.5), (SEGMENTS_PATH, FOUND, 1.0), (MATCHED_PATH, MATCHED, 2.0),
          (REJECTED_PATH, REJECTED, 2.0))
"""Lines of each kind: where, colour and half width on the screen."""

MOST_NAMES = 6

Floats = NDArray[np.float64]


class Image:
    """Logs the overlays of the newest frame, and takes them away when the next one comes."""

    def __init__(self, camera: Camera) -> None:
        self._size = camera.width, camera.height
        self._shown: dict[str, None] = {}

    def begin(self, tape: Tape) -> None:
        for path, colour, width in STYLES:
            tape.fix(path, rr.LineStrips2D.from_fields(colors=[colour], radii=rr.Radius.ui_points(width)))

    def log(self, tape: Tape, moment: Moment) -> None:
        if moment.touched(Frame):
            self._wipe(tape, moment.mirror)
        for milestone in moment.changed(Milestone)[-1:]:
            self._expected(tape, milestone.value)
        for segments in moment.changed(Segments)[-1:]:
            self._lines(tape, SEGMENTS_PATH, segments.value.segments_px)
        for match in moment.changed(LineMatch)[-1:]:
            self._lines(tape, MATCHED_PATH, match.value.segments_px)
        for fix in moment.changed(PoseFix)[-1:]:
            self._inliers(tape, moment.mirror, fix.value)
        for tracks in moment.changed(Tracks)[-1:]:
            self._tracks(tape, tracks.value)

    def _wipe(self, tape: Tape, mirror: Mirror) -> None:
        """A new picture: nothing found in the last one holds; what is expected does while its milestone is open."""
        last = mirror.latest(Milestone)
        keep = (EXPECTED_PATH, NAMES_PATH) if last and last.value.status == "expected" else ()
        for path in [path for path in self._shown if path not in keep]:
            tape.log(path, rr.Clear(recursive=False))
            del self._shown[path]

    def _show(self, tape: Tape, path: str, what: Any) -> None:
        tape.log(path, what)
        self._shown[path] = None

    def _lines(self, tape: Tape, path: str, segments_px: Any) -> None:
        lines, inside = clip_segments(segments_px, *self._size)
        self._show(tape, path, rr.LineStrips2D(lines[inside].astype(np.float32)))

    def _expected(self, tape: Tape, milestone: Milestone) -> None:
        if milestone.status == "turning" or not milestone.expected_px:
            return
        lines = np.array(milestone.expected_px, float).reshape(-1, 2, 2)
        self._lines(tape, EXPECTED_PATH, lines)
        self._show(tape, NAMES_PATH, _names(milestone, *clip_segments(lines, *self._size)))

    def _inliers(self, tape: Tape, mirror: Mirror, fix: PoseFix) -> None:
        match = mirror.get(fix.match)
        if match is not None and isinstance(match.value, LineMatch):
            self._lines(tape, MATCHED_PATH, match.value.segments_px[fix.inliers])
            self._lines(tape, REJECTED_PATH, match.value.segments_px[~fix.inliers])

    def _tracks(self, tape: Tape, tracks: Tracks) -> None:
        items = [track for track in tracks.items if self._inside(track.predicted_px)]
        self._show(tape, WINDOWS, self._windows(items, tracks.half_px))
        self._show(tape, DRIFTS, self._drifts(items))

    def _inside(self, point_px: tuple[float, float]) -> bool:
        return all(0 <= value < size for value, size in zip(point_px, self._size, strict=True))

    def _windows(self, items: list[Track], half_px: int) -> Any:
        """The searched templates where they were found, red where they were expected and not found."""
        middles = np.array([track.found_px or track.predicted_px for track in items], float).reshape(-1, 2)
        low, high = middles - half_px, middles + half_px
        low, high = (np.clip(corner, 0.0, np.array(self._size) - 1.0) for corner in (low, high))
        return rr.Boxes2D(mins=low, sizes=high - low, colors=[_track_colour(track) for track in items],
                          radii=rr.Radius.ui_points(1.5), labels=[track.landmark for track in items],
                          show_labels=len(items) <= MOST_NAMES)

    def _drifts(self, items: list[Track]) -> Any:
        pairs = [(t.predicted_px, t.found_px) for t in items if t.found_px]
        ends = np.array(pairs, float).reshape(-1, 2, 2)
        ends[:, 1] = ends[:, 0] + DRIFT_SCALE * (ends[:, 1] - ends[:, 0])
        ends, inside = clip_segments(ends, *self._size)
        ends = ends[inside]
        return rr.Arrows2D(origins=ends[:, 0], vectors=ends[:, 1] - ends[:, 0], colors=[PLANNED],
                           radii=rr.Radius.ui_points(1.5))


def _track_colour(track: Track) -> Colour:
    return FOUND if track.found_px else REJECTED


def _names(milestone: Milestone, lines: Floats, inside: NDArray[np.bool_]) -> Any:
    """The names of the landmarks that show most, each at the middle of its longest line."""
    best: dict[str, tuple[float, Floats]] = {}
    for number, landmark in enumerate(milestone.landmark_of):
        length = float(np.linalg.norm(lines[number, 1] - lines[number, 0])) if inside[number] else 0.0
        name = milestone.landmarks[landmark]
        if length > best.get(name, (0.0,))[0]:
            best[name] = length, lines[number].mean(axis=0)
    largest = sorted(best, key=lambda name: -best[name][0])[:MOST_NAMES]
    return rr.Points2D([best[name][1] for name in largest], labels=largest, show_labels=True, colors=[EXPECTED],
                       radii=rr.Radius.ui_points(2.0))
