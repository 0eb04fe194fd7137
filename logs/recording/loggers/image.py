"""What is drawn over the camera's picture: lines expected, found and matched, the templates that are followed, and what
is known to stand before the camera."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from logs.recording.board_mirror import Mirror, Moment
from logs.recording.logger import Logger, Subject
from logs.recording.palette import DONE, EXPECTED, FOUND, MATCHED, NOT_TESTABLE, PLANNED, REJECTED, Colour
from logs.recording.paths import DRIFTS, LANDMARK_NAMES, OBSTRUCTION, WAITING, WINDOWS
from logs.recording.paths import EXPECTED as EXPECTED_PATH
from logs.recording.paths import MATCHED as MATCHED_PATH
from logs.recording.paths import REJECTED as REJECTED_PATH
from logs.recording.paths import SEGMENTS as SEGMENTS_PATH
from logs.recording.stream import RecordingStream
from world_models.camera import clip_segments
from world_models.entries.body import Frame
from world_models.entries.obstacle import Obstruction
from world_models.entries.percepts import LineMatch, PoseFix, Segments, Track, Tracks
from world_models.entries.task import Milestone
from world_models.frames import frozen
from world_models.words import without_locale

DRIFT_SCALE = 5.0
"""Drifts of a few pixels would not show: their arrows are drawn longer, and the view's legend says so."""

STYLES = ((EXPECTED_PATH, EXPECTED, 1.5), (SEGMENTS_PATH, FOUND, 1.0), (MATCHED_PATH, MATCHED, 2.0),
          (REJECTED_PATH, REJECTED, 2.0), (OBSTRUCTION, NOT_TESTABLE, 2.0))
"""Lines of each kind: where, colour and half width on the screen."""

MOST_NAMES = 6

LABEL_PX, LABEL_HIGH_PX = 80.0, 26.0
"""Half a long name's width, and a name's height: nearer to the border it is moved inwards; nearer to another, left out.
"""

NO_LINES, NO_POINTS = frozen(np.zeros((0, 2, 2))), frozen(np.zeros((0, 2)))

Floats = NDArray[np.float64]


class Image(Logger):
    """Logs the overlays of the newest frame, and takes them away when the next one comes."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        camera = subject.camera
        self._size = camera.width, camera.height
        self._lens, self._pinhole = camera, camera.pinhole
        self._shown: dict[str, None] = {}
        self._waits = False

    def begin(self, stream: RecordingStream) -> None:
        for path, colour, width in STYLES:
            stream.fix(path, rr.LineStrips2D.from_fields(colors=[colour], radii=rr.Radius.ui_points(width)))
        thin = rr.Radius.ui_points(1.5)
        stream.fix(LANDMARK_NAMES, rr.Points2D.from_fields(show_labels=True, colors=[EXPECTED], radii=thin))
        stream.fix(WINDOWS, rr.Boxes2D.from_fields(radii=thin))
        stream.fix(DRIFTS, rr.Arrows2D.from_fields(colors=[PLANNED], radii=thin))

        stream.fix(WAITING, rr.Points2D.from_fields(show_labels=True, colors=[DONE], radii=thin))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        if not self._waits and not moment.mirror.all(Frame):
            self._wait(stream, [np.divide(self._size, 2)], ["no picture yet"])
        if moment.touched(Frame):
            if self._waits:
                self._wait(stream, NO_POINTS, ())
            self._wipe(stream, moment.mirror)
        if moment.touched(Obstruction):
            self._obstruction(stream, moment.mirror)
        for milestone in moment.changed(Milestone)[-1:]:
            self._log_expected(stream, milestone.value)
        for segments in moment.changed(Segments)[-1:]:
            self._lines(stream, SEGMENTS_PATH, segments.value.segments_px)
        for match in moment.changed(LineMatch)[-1:]:
            self._lines(stream, MATCHED_PATH, match.value.segments_px)
        for fix in moment.changed(PoseFix)[-1:]:
            self._inliers(stream, moment.mirror, fix.value)
        for tracks in moment.changed(Tracks)[-1:]:
            self._tracks(stream, tracks.value)

    def _wait(self, stream: RecordingStream, spots: Any, labels: Sequence[str]) -> None:
        self._waits = bool(labels)
        stream.log(WAITING, rr.Points2D, positions=np.array(spots, float).reshape(-1, 2), labels=labels)

    def _wipe(self, stream: RecordingStream, mirror: Mirror) -> None:
        """A new picture: nothing found in the last one holds; what is expected does while its milestone is open."""
        last = mirror.latest(Milestone)
        keep = (EXPECTED_PATH, LANDMARK_NAMES) if last and last.value.status == "expected" else ()
        for path in [path for path in self._shown if path not in keep]:
            del self._shown[path]
            if path == LANDMARK_NAMES:
                stream.log(path, rr.Points2D, positions=NO_POINTS, labels=())
            elif path == WINDOWS:
                self._log_windows(stream, [], 0)
            elif path == DRIFTS:
                stream.log(path, rr.Arrows2D, origins=NO_POINTS, vectors=NO_POINTS)
            else:
                stream.log(path, rr.LineStrips2D, strips=NO_LINES)

    def _obstruction(self, stream: RecordingStream, mirror: Mirror) -> None:
        """It moves with the camera: its outline stays from picture to picture."""
        known = mirror.latest(Obstruction)
        corners = np.zeros((0, 2)) if known is None else np.array(known.value.outline_px, float)
        sides, inside = self._clip(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1))
        stream.log(OBSTRUCTION, rr.LineStrips2D, strips=sides[inside].astype(np.float32))

    def _lines(self, stream: RecordingStream, path: str, segments_px: Any) -> None:
        lines, inside = self._clip(np.asarray(segments_px))
        self._log_lines(stream, path, lines[inside])

    def _log_lines(self, stream: RecordingStream, path: str, lines: Floats) -> None:
        stream.log(path, rr.LineStrips2D, strips=lines.astype(np.float32))
        self._shown[path] = None

    def _clip(self, lines: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Lines (n, 2, 2) cut at the picture's border, and which of them are left; most need no cut."""
        lines = lines.reshape(-1, 2, 2)
        if lines.size == 0 or (lines.min() >= 0.0 and (lines.max(axis=(0, 1)) <= np.subtract(self._size, 1.0)).all()):
            return self._bent(lines), np.ones(len(lines), bool)
        lines, inside = clip_segments(lines, *self._size)
        return self._bent(lines), inside

    def _bent(self, pixels: Floats) -> Floats:
        """Where points (..., 2) of the rectified picture, which knowledge sources see, lie in the camera's."""
        return pixels if self._pinhole is self._lens else self._lens.project(self._pinhole.rays(pixels))

    def _log_expected(self, stream: RecordingStream, milestone: Milestone) -> None:
        if milestone.status == "turning" or not milestone.expected_px:
            return
        lines = np.array(milestone.expected_px, float).reshape(-1, 2, 2)
        clipped, inside = self._clip(lines)
        self._log_lines(stream, EXPECTED_PATH, clipped[inside])
        names = _largest(milestone, clipped, inside, self._size[0])
        spots = np.array(list(names.values()), float).reshape(-1, 2)
        stream.log(LANDMARK_NAMES, rr.Points2D, positions=spots, labels=[without_locale(name) for name in names])
        self._shown[LANDMARK_NAMES] = None

    def _inliers(self, stream: RecordingStream, mirror: Mirror, fix: PoseFix) -> None:
        match = mirror.get(fix.match)
        if match is not None and isinstance(match.value, LineMatch):
            self._lines(stream, MATCHED_PATH, match.value.segments_px[fix.inliers])
            self._lines(stream, REJECTED_PATH, match.value.segments_px[~fix.inliers])

    def _tracks(self, stream: RecordingStream, tracks: Tracks) -> None:
        items = [track for track in tracks.items if self._inside(track.predicted_px)]
        self._log_windows(stream, items, tracks.half_px)
        self._log_drifts(stream, items)

    def _inside(self, point_px: tuple[float, float]) -> bool:
        return all(0 <= value < size for value, size in zip(point_px, self._size, strict=True))

    def _log_windows(self, stream: RecordingStream, items: list[Track], half_px: int) -> None:
        """The searched templates where they were found, red where they were expected and not found."""
        middles = self._bent(np.array([track.found_px or track.predicted_px for track in items], float).reshape(-1, 2))
        last = np.subtract(self._size, 1.0)
        low, high = np.clip(middles - half_px, 0.0, last), np.clip(middles + half_px, 0.0, last)
        names = [without_locale(track.landmark) if len(items) <= MOST_NAMES else "" for track in items]
        stream.log(WINDOWS, rr.Boxes2D, centers=(low + high) / 2, half_sizes=(high - low) / 2, labels=names,
                 colors=[_track_colour(track) for track in items])
        self._shown[WINDOWS] = None

    def _log_drifts(self, stream: RecordingStream, items: list[Track]) -> None:
        """From where a template was expected towards where it was found, drawn longer."""
        ends = np.array([(t.predicted_px, t.found_px) for t in items if t.found_px], float).reshape(-1, 2, 2)
        ends[:, 1] = ends[:, 0] + DRIFT_SCALE * (ends[:, 1] - ends[:, 0])
        ends, inside = self._clip(ends)
        ends = ends[inside]
        stream.log(DRIFTS, rr.Arrows2D, origins=ends[:, 0], vectors=ends[:, 1] - ends[:, 0])
        self._shown[DRIFTS] = None


def _track_colour(track: Track) -> Colour:
    return FOUND if track.found_px else REJECTED


def _largest(
    milestone: Milestone, lines: Floats, inside: NDArray[np.bool_], width: int
) -> dict[str, tuple[float, float]]:
    """The landmarks that show most, each at the middle of its longest line, as far as their names do not overlap."""
    lengths = np.where(inside, np.hypot(*(lines[:, 1] - lines[:, 0]).T), 0.0)
    best: dict[str, tuple[float, float]] = {}
    for number in np.argsort(-lengths, kind="stable"):
        name = milestone.landmarks[milestone.landmark_of[number]]
        if lengths[number] <= 0.0 or len(best) >= MOST_NAMES:
            break
        u, v = lines[number].mean(axis=0).tolist()
        u = min(max(u, LABEL_PX), width - LABEL_PX)
        if name not in best and all(abs(u - x) > 2 * LABEL_PX or abs(v - y) > LABEL_HIGH_PX for x, y in best.values()):
            best[name] = u, v
    return best


LOGGERS = (Image,)
