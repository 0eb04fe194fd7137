"""The camera's picture, as it came, so that a run can be decided again from its recording; and what is drawn over it.

Over it lie the lines that are expected, found and matched, the templates that are followed, what is known to stand
before the camera, and the floor: where it is free, what ends it (its boundary's colour), boxes round what stands on it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from blackboard import View
from logs.recording import paths
from logs.recording.logger import Held, Logger, Moment, Panel, Subject
from logs.recording.palette import DONE, EXPECTED, FOUND, FREE, MATCHED, NOT_TESTABLE, PLANNED, REJECTED, Colour, faint
from logs.recording.stream import Mixed, RecordingStream
from world_models.camera import clip_segments
from world_models.entries import (
    CameraPicture,
    DoorState,
    FloorEnd,
    FloorThing,
    FreeFloor,
    LineMatch,
    Milestone,
    Obstruction,
    PoseFix,
    Segments,
    Tracks,
)
from world_models.frames import Pose2, frozen
from world_models.words import without_locale

Floats = NDArray[np.float64]
NUMBER = "number"
"""The component next to an image that holds the frame's number."""
DELIVERED = Mixed(blob=rr.EncodedImage)
"""A picture and what is known about it."""
DRIFT_SCALE = 5.0
"""Drifts of a few pixels would not show: their arrows are drawn longer, and the view's legend says so."""
STYLES = ((paths.EXPECTED, EXPECTED, 1.5), (paths.SEGMENTS, FOUND, 1.0), (paths.MATCHED, MATCHED, 2.0),
          (paths.REJECTED, REJECTED, 2.0), (paths.OBSTRUCTION, NOT_TESTABLE, 2.0),
          (paths.FREE_IN_PICTURE, faint(FREE, 50), 2.0))
"""Lines of each kind: where, colour and half width on the screen. Those of the free floor go from its near side to its
far side, one a direction: together they are a translucent area."""
ENDS: Mapping[FloorEnd, Colour] = {"thing": REJECTED, "model": DONE, "sight": FREE}
"""Of the floor's boundary, by what ends the floor there."""
MOST_NAMES = 6
LABEL_PX, LABEL_HIGH_PX = 80.0, 26.0
"""Half a long name's width, and a name's height: nearer to the border it is moved inwards; nearer to another, left out.
"""
NO_LINES, NO_POINTS, NO_BOXES = (frozen(np.zeros(shape)) for shape in ((0, 2, 2), (0, 2), (0, 4)))


class Frames(Logger):
    """Logs each picture as it is delivered."""

    def panels(self) -> Sequence[Panel]:
        camera = self.subject.camera
        view = rrb.Spatial2DView(
            origin=paths.CAMERA, name="Eye: yellow expected, cyan found, green fits, red not",
            visual_bounds=rrb.VisualBounds2D(x_range=[0, camera.width], y_range=[0, camera.height]))
        return (Panel(view, "world", 2, 9),)

    def begin(self, stream: RecordingStream) -> None:
        camera = self.subject.camera
        stream.fix(paths.CAMERA, rr.Pinhole(image_from_camera=camera.matrix, width=camera.width, height=camera.height))
        stream.fix(paths.IMAGE, rr.EncodedImage.from_fields(media_type="image/jpeg"))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        for entry in moment.changed(CameraPicture):
            frame = entry.value
            stream.log(paths.IMAGE, DELIVERED, blob=[frame.jpeg], **{NUMBER: [frame.number]}, purpose=[frame.purpose],
                       entry=[str(entry.ref)])


class Overlays(Logger):
    """Logs what is drawn over the newest picture, and takes it away when the next one comes."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._lens, self._pinhole = subject.camera, subject.camera.pinhole
        self._size = subject.camera.width, subject.camera.height
        self._shown: dict[str, None] = {}
        self._waits = False

    def begin(self, stream: RecordingStream) -> None:
        thin = rr.Radius.ui_points(1.5)
        for path, colour, width in STYLES:
            stream.fix(path, rr.LineStrips2D.from_fields(colors=[colour], radii=rr.Radius.ui_points(width)))
        stream.fix(paths.FLOOR_BOUNDARY, rr.LineStrips2D.from_fields(radii=thin))
        for path, colour in ((paths.LANDMARK_NAMES, EXPECTED), (paths.WAITING, DONE)):
            stream.fix(path, rr.Points2D.from_fields(show_labels=True, colors=[colour], radii=thin))
        stream.fix(paths.WINDOWS, rr.Boxes2D.from_fields(radii=thin))
        stream.fix(paths.DRIFTS, rr.Arrows2D.from_fields(colors=[PLANNED], radii=thin))
        for path in (paths.THINGS, paths.DOOR_IN_PICTURE):
            stream.fix(path, rr.Boxes2D.from_fields(radii=thin, show_labels=True))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        if not self._waits and not moment.mirror.all(CameraPicture):
            self._waits = True
            stream.log(paths.WAITING, rr.Points2D, positions=np.divide(self._size, 2)[None], labels=["no picture yet"])
        if moment.touched(CameraPicture):
            if self._waits:
                self._waits = False
                stream.log(paths.WAITING, rr.Points2D, positions=NO_POINTS, labels=())
            self._wipe(stream, moment.mirror)
        if moment.touched(Obstruction):  # it moves with the camera: its outline stays from picture to picture
            known = moment.mirror.latest(Obstruction)
            corners = np.array(() if known is None else known.value.outline_px, float).reshape(-1, 2)
            self._log_lines(stream, paths.OBSTRUCTION, np.stack([corners, np.roll(corners, -1, axis=0)], axis=1))
        for milestone in moment.changed(Milestone)[-1:]:
            self._milestone(stream, milestone.value)
        for segments in moment.changed(Segments)[-1:]:
            self._log_lines(stream, paths.SEGMENTS, segments.value.segments_px)
        for match in moment.changed(LineMatch)[-1:]:
            self._log_lines(stream, paths.MATCHED, match.value.segments_px)
        for fix in moment.changed(PoseFix)[-1:]:
            if (solved := moment.mirror.get(fix.value.match)) is not None:
                self._log_lines(stream, paths.MATCHED, solved.value.segments_px[fix.value.inliers])
                self._log_lines(stream, paths.REJECTED, solved.value.segments_px[~fix.value.inliers])
        for tracks in moment.changed(Tracks)[-1:]:
            self._tracks(stream, tracks.value)
        for entry in moment.changed(FreeFloor):
            if entry.value.sense == "camera" and entry.value.bearings_rad and moment.held is not None:
                self._floor(stream, moment.held, entry.value)
        if doors := [entry.value for entry in moment.changed(DoorState)]:
            self._log_boxes(stream, paths.DOOR_IN_PICTURE, self._bounds(door.last.box_px for door in doors),
                            [FREE if door.is_passable else REJECTED for door in doors],
                            [f"{door.door}: {door.last.shows}" for door in doors])

    def _wipe(self, stream: RecordingStream, board: View) -> None:
        """A new picture: nothing found in the last one holds; what is expected does while its milestone is open."""
        last = board.latest(Milestone)
        keep = {paths.OBSTRUCTION}
        if last is not None and last.value.status == "expected":
            keep |= {paths.EXPECTED, paths.LANDMARK_NAMES}
        for path in [path for path in self._shown if path not in keep]:
            if path == paths.LANDMARK_NAMES:
                stream.log(path, rr.Points2D, positions=NO_POINTS, labels=())
            elif path in (paths.WINDOWS, paths.THINGS, paths.DOOR_IN_PICTURE):
                self._log_boxes(stream, path, NO_BOXES, [], [])
            elif path == paths.DRIFTS:
                stream.log(path, rr.Arrows2D, origins=NO_POINTS, vectors=NO_POINTS)
            else:
                stream.log(path, rr.LineStrips2D, strips=NO_LINES)
            del self._shown[path]

    def _milestone(self, stream: RecordingStream, milestone: Milestone) -> None:
        if milestone.status == "turning" or not milestone.expected_px:
            return
        lines, inside = self._log_lines(stream, paths.EXPECTED, np.array(milestone.expected_px, float))
        names = _largest(milestone, lines, inside, self._size[0])
        spots = np.array(list(names.values()), float).reshape(-1, 2)
        stream.log(paths.LANDMARK_NAMES, rr.Points2D, positions=spots, labels=[without_locale(name) for name in names])
        self._shown[paths.LANDMARK_NAMES] = None

    def _tracks(self, stream: RecordingStream, tracks: Tracks) -> None:
        """The searched templates where they were found, red where they were expected and not found; and from where each
        was expected an arrow towards where it was found, drawn longer."""
        items = [track for track in tracks.items
                 if all(0 <= value < size for value, size in zip(track.predicted_px, self._size, strict=True))]
        middles = self._bend(np.array([track.found_px or track.predicted_px for track in items], float).reshape(-1, 2))
        bounds = np.clip(np.hstack([middles - tracks.half_px, middles + tracks.half_px]), 0.0, self._last_px)
        names = [without_locale(track.landmark) if len(items) <= MOST_NAMES else "" for track in items]
        colours = [FOUND if track.found_px else REJECTED for track in items]
        self._log_boxes(stream, paths.WINDOWS, bounds, colours, names)
        ends = np.array([(t.predicted_px, t.found_px) for t in items if t.found_px], float).reshape(-1, 2, 2)
        ends[:, 1] = ends[:, 0] + DRIFT_SCALE * (ends[:, 1] - ends[:, 0])
        ends, inside = self._clip(ends)
        stream.log(paths.DRIFTS, rr.Arrows2D, origins=ends[inside, 0], vectors=ends[inside, 1] - ends[inside, 0])
        self._shown[paths.DRIFTS] = None

    def _floor(self, stream: RecordingStream, held: Held, floor: FreeFloor) -> None:
        near, far = np.array(floor.near_m, float), np.array(floor.far_m, float)
        is_free = far > near
        columns = np.stack([self._place(floor, held.world_from_robot, reach) for reach in (near, far)], axis=1)
        self._log_lines(stream, paths.FREE_IN_PICTURE, columns[is_free])
        ends = [ENDS[end] for end, free in zip(floor.ends, is_free, strict=True) if free]
        self._log_lines(stream, paths.FLOOR_BOUNDARY, np.array([*pairwise(columns[is_free, 1])], float), ends)
        self._log_boxes(stream, paths.THINGS, self._bounds(thing.box_px for thing in floor.things),
                        [REJECTED if thing.p_thing > 0.5 else EXPECTED for thing in floor.things],
                        [_label_of(thing) for thing in floor.things])

    def _place(self, floor: FreeFloor, world_from_robot: Pose2, reach_m: Floats) -> Floats:
        """(n, 2) pixels of the floor at these distances from the camera; nan behind it."""
        bearings = np.array(floor.bearings_rad, float)
        points = np.column_stack([floor.x_m + reach_m * np.cos(bearings), floor.y_m + reach_m * np.sin(bearings)])
        in_robot = world_from_robot.inverse().lifted().apply(np.insert(points, 2, 0.0, axis=1))
        in_camera = self.subject.mount.camera_from_robot.apply(in_robot)
        pixels = np.asarray(self._pinhole.project(in_camera), float)
        pixels[in_camera[:, 2] <= 0.0] = np.nan
        return pixels

    def _log_lines(
        self, stream: RecordingStream, path: str, lines: Floats, colours: Sequence[Colour] | None = None
    ) -> tuple[Floats, NDArray[np.bool_]]:
        """Log lines (n, 2, 2) cut at the border, each in its colour where there are any; gives what :meth:`_clip` does.
        """
        clipped, inside = self._clip(np.asarray(lines, float))
        coloured = {} if colours is None else {
            "colors": [colour for colour, shown in zip(colours, inside, strict=False) if shown]}
        stream.log(path, rr.LineStrips2D, strips=clipped[inside].astype(np.float32), **coloured)
        self._shown[path] = None
        return clipped, inside

    def _log_boxes(
        self, stream: RecordingStream, path: str, bounds: Floats, colours: Sequence[Colour], labels: Sequence[str]
    ) -> None:
        low, high = bounds[:, :2], bounds[:, 2:]
        stream.log(path, rr.Boxes2D, centers=(low + high) / 2, half_sizes=(high - low) / 2, labels=labels,
                   colors=colours)
        self._shown[path] = None

    def _clip(self, lines: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Lines (n, 2, 2) cut at the picture's border, and which of them are left; most need no cut."""
        lines = lines.reshape(-1, 2, 2)
        if lines.size == 0 or (lines.min() >= 0.0 and (lines.max(axis=(0, 1)) <= np.subtract(self._size, 1.0)).all()):
            return self._bend(lines), np.ones(len(lines), bool)
        known = np.isfinite(lines).all(axis=(1, 2))
        clipped, inside = clip_segments(np.nan_to_num(lines), *self._size)
        return self._bend(clipped), np.asarray(inside & known)

    def _bend(self, pixels: Floats) -> Floats:
        """Where points (..., 2) of the rectified picture, which knowledge sources see, lie in the camera's."""
        return pixels if self._pinhole is self._lens else self._lens.project(self._pinhole.rays(pixels))

    @property
    def _last_px(self) -> Floats:
        """Of the right and lower border, twice."""
        return np.tile(np.subtract(self._size, 1.0), 2)

    def _bounds(self, boxes: Iterable[tuple[float, float, float, float]]) -> Floats:
        """(n, 4) boxes as they lie in the camera's picture, cut at its border."""
        corners = self._bend(np.array([*boxes], float).reshape(-1, 2, 2))
        return np.clip(corners.reshape(-1, 4), 0.0, self._last_px)


def _label_of(thing: FloorThing) -> str:
    """``0.42 m high, 97%``."""
    high = f"{thing.height_m:.2f} m high, " if np.isfinite(thing.sigma_height_m) else ""
    return f"{high}{thing.p_thing:.0%}"


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


LOGGERS = (Frames, Overlays)
