"""Looks: of each picture by which a place was verified, what a journal says was expected and found; and how far off.

A run may have believed that a wall or a door stands elsewhere than its file says. All lines of a look are those of the
file: what the run had moved is moved back.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.calibration import compute_camera_covariance
from knowledge_sources.methods.features import SIGMA_ACROSS_PX
from logs.run_directory import RunDirectory
from logs.run_errors import BadInput
from logs.run_head import RunHead
from logs.timeline import Timeline
from world_models.building.geometry.landmarks import Landmark
from world_models.building.locale_frame import FrameChange, LocaleFrame
from world_models.building.world import World
from world_models.camera import Camera, CameraMount, move_camera
from world_models.entries import (
    CameraState,
    Certificate,
    Hypothesis,
    LineMatch,
    Milestone,
    Obstacle,
    PoseFix,
    Segments,
)
from world_models.files.world_files import fingerprint
from world_models.frames import Pose2

Floats = NDArray[np.float64]

READ = (CameraState, Certificate, Hypothesis, LineMatch, Milestone, Obstacle, PoseFix, Segments)
SAME_LINE_M = 0.002
"""A visible piece lies no further than this from the line of which it is a piece [m]."""
LIGHTS = ("dark", "middling", "bright")
FOUND = 0.5
"""A line of which more than this part is accounted for is found."""


@dataclass(frozen=True, eq=False, slots=True)
class SeenPicture:
    """One picture of a verified place: m lines were expected, and p pairs of a line and a segment found.

    Attributes:
        run: digest of the journal; cycle: of the certificate.
        pose: ``world_from_robot`` by this picture. covariance: (3, 3) of it.
        camera, mount: with which that was found; the height of the mount is above the world's plan z = 0.
        camera_covariance: (7, 7) of them, over :data:`~world_models.camera.CAMERA_UNKNOWNS`.
        marks: (m) the landmark of each line; numbers: (m,) its number in the landmark.
        pieces_world: (m, 2, 3) the visible pieces, where the file has them [m].
        found, hidden: (m,) masks: which were found; and which stand behind something that the run has found there.
        pairs: (p,) index of the line. segments_px: (p, 2, 2). every_px: (s, 2, 2) all segments of the picture.
        brightness, contrast: of the picture, 0..255.
    """

    run: str
    cycle: int
    locale: str
    pose: Pose2
    covariance: Floats
    camera: Camera
    mount: CameraMount
    camera_covariance: Floats
    marks: tuple[Landmark, ...]
    numbers: NDArray[np.int64]
    pieces_world: Floats
    found: NDArray[np.bool_]
    hidden: NDArray[np.bool_]
    pairs: NDArray[np.int64]
    segments_px: Floats
    every_px: Floats
    brightness: float
    contrast: float

    @property
    def distances_m(self) -> Floats:
        """(m,) from the robot to the middle of each piece, on the plan [m]."""
        return np.asarray(np.linalg.norm(self.pieces_world.mean(axis=1)[:, :2] - self.pose.position, axis=1))


def read_looks(world: World, path: Path, runs: Sequence[RunDirectory]) -> tuple[SeenPicture, ...]:
    """The looks of all runs; the same whatever their order, and of a run that is given twice once.

    Args:
        path: the world's file; the runs are of it.

    Raises BadInput where a run cannot be read, or is of another world.
    """
    digest = fingerprint(path)
    known: dict[str, RunDirectory] = {}
    for run in runs:
        head = RunHead.read(run.path)
        if head.world_sha256 != digest:
            raise BadInput(f"{run.path}: expected a run with the world file {path} as it is now, got one with "
                           f"{head.world} (SHA-256 {head.world_sha256[:8]}, and here {digest[:8]})")
        known[hashlib.sha256(run.journal.read_bytes()).hexdigest()] = run
    marks = {mark.name: mark for mark in world.landmarks}
    return tuple(look for name in sorted(known)
                 for look in _Reader(world, marks, name).read(Timeline(known[name].journal)))


@dataclass
class _Reader:
    """Reads one journal.

    Attributes:
        newest: the newest value of each entry, by its id.
        changes: what the run believes otherwise than the file says, by locale.
    """

    world: World
    marks: Mapping[str, Landmark]
    run: str
    newest: dict[str, Any] = field(default_factory=dict)
    changes: dict[str, tuple[FrameChange, ...]] = field(default_factory=dict)
    held: Hypothesis | None = None
    camera: CameraState | None = None

    def read(self, timeline: Timeline) -> Iterator[SeenPicture]:
        for record in timeline.of_kind(*READ, LocaleFrame):
            value: Any = record.value
            self.newest[record.id] = value
            if record.kind is LocaleFrame:
                self.changes[value.locale] = value.changes
            elif isinstance(value, CameraState):
                self.camera = value
            elif isinstance(value, Hypothesis):
                self.held = value if value.is_held else self.held
            elif isinstance(value, Certificate) and value.verdict == "verified" and value.fix in self.newest:
                yield from self._build(value, record.cycle)

    def _build(self, certificate: Certificate, cycle: int) -> Iterator[SeenPicture]:
        """The look of a verified place; none where nothing was matched."""
        fix: PoseFix = self.newest[certificate.fix]
        match: LineMatch = self.newest[fix.match]
        milestone, segments = self.newest[match.milestone], self.newest[match.segments]
        if self.camera is None or self.held is None or not len(match.pairs):
            return
        camera = self.camera.moved(fix.camera_step) if fix.camera_step else self.camera
        floor_m = self.world.floor_m(self.held.locale)
        mount = replace(camera.mount, height_m=camera.mount.height_m + floor_m)
        lines = {i: line for i in range(len(milestone.expected)) if (line := self._find_line(milestone, i)) is not None}
        place = {i: k for k, i in enumerate(lines)}
        pairs = [k for k, (i, _) in enumerate(match.pairs.tolist()) if i in place]
        if not pairs:
            return
        marks, numbers, found_pieces = zip(*lines.values(), strict=True)
        pieces = np.array(found_pieces)
        yield SeenPicture(
            self.run, cycle, self.held.locale, fix.world_from_robot, np.asarray(fix.covariance), camera.pinhole, mount,
            compute_camera_covariance(self.camera),
            tuple(marks), np.array(numbers, np.int64), pieces, np.asarray(match.coverage)[list(lines)] > FOUND,
            self._find_hidden(fix.world_from_robot, pieces),
            np.array([place[int(match.pairs[k, 0])] for k in pairs], np.int64), match.segments_px[pairs],
            segments.segments_px, segments.brightness, segments.contrast)

    def _find_line(self, milestone: Milestone, i: int) -> tuple[Landmark, int, Floats] | None:
        """Of which line an expected piece is one, and where it is by the file; None where that is not known."""
        mark = self.marks.get(milestone.landmarks[milestone.landmark_of[i]])
        if mark is None or not len(mark.lines_world):
            return None
        piece, filed = np.array(milestone.expected[i], float), mark.lines_world
        moved = self._move(mark, filed)
        starts, along = moved[:, 0], moved[:, 1] - moved[:, 0]
        lengths = np.linalg.norm(along, axis=1)
        along = along / lengths[:, None]
        at = np.einsum("nei,ni->ne", piece[None] - starts[:, None], along)
        off = np.linalg.norm(piece[None] - starts[:, None] - at[..., None] * along[:, None], axis=2).max(axis=1)
        beyond = np.maximum(0.0, np.maximum(-at, at - lengths[:, None])).max(axis=1)
        number = int(np.argmin(off + beyond))
        if off[number] + beyond[number] > SAME_LINE_M:
            return None
        ends = filed[number, 1] - filed[number, 0]
        return mark, number, np.asarray(filed[number, 0] + (at[number] / lengths[number])[:, None] * ends)

    def _move(self, mark: Landmark, lines_world: Floats) -> Floats:
        """The lines of a landmark where the run believed them to be."""
        thing = next((thing for thing in self.world.things_of(mark.locale) if thing.name == mark.name), None)
        for change in self.changes.get(mark.locale, ()):
            if change.what == "beside":
                whole = None if thing is None else change.shift.moves_thing(thing)
                lines_world = change.shift.move(lines_world, whole)
        return lines_world

    def _find_hidden(self, pose: Pose2, pieces: Floats) -> NDArray[np.bool_]:
        """(m,) which pieces have their middle behind a thing that was found on the floor, as seen from there."""
        import shapely  # slow to import

        there = [shapely.Polygon(value.footprint) for value in self.newest.values()
                 if isinstance(value, Obstacle) and value.status == "there" and len(value.footprint) > 2]
        sights = [shapely.LineString([pose.position, piece.mean(axis=0)[:2]]) for piece in pieces]
        return np.array([any(sight.crosses(thing) for thing in there) for sight in sights], bool)


def light_of(look: SeenPicture) -> str:
    """``dark``, ``middling`` or ``bright``, by thirds of what a picture can show."""
    return LIGHTS[min(2, math.floor(look.brightness / 256.0 * 3.0))]


STEPS, MOVE_M = (1e-4, 1e-4, 1e-5, 1e-5, 1e-5, 1e-5, 1e-4, 1e-5, 1e-2, 1e-2), 1e-4
"""Steps of pose, camera and lines by which slopes are measured, in the units of what is off."""
SIGMA_PX = SIGMA_ACROSS_PX
"""Standard deviation of a segment's end across its line [px]."""


def measure_offsets(look: SeenPicture, pose: Pose2, camera_step: Floats, pieces_world: Floats) -> Floats:
    """(p, 2) how far both ends of each segment lie beside their lines [px].

    Args:
        camera_step: (7,) of :data:`~world_models.camera.CAMERA_UNKNOWNS`.
        pieces_world: (p, 2, 3) where the line of each pair is [m].
    """
    ends = _project(look, pose, camera_step, pieces_world)
    along = ends[:, 1] - ends[:, 0]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(np.einsum("pei,pi->pe", look.segments_px - ends[:, :1], across))


def _project(look: SeenPicture, pose: Pose2, camera_step: Floats, pieces_world: Floats) -> Floats:
    camera, mount = move_camera(look.camera, look.mount, camera_step)
    return np.asarray(camera.project((mount.camera_from_robot @ pose.lifted().inverse()).apply(pieces_world)))


def match_again(
    look: SeenPicture, pose: Pose2, camera_step: Floats, pieces_world: Floats, within_px: float
) -> SeenPicture:
    """The look with each of its segments paired with the line that it lies on, and with no other.

    Args:
        pieces_world: (m, 2, 3) where the visible piece of each expected line is [m].
        within_px: both ends of a segment lie no further beside its line.
    """
    off, shared, lengths, _ = _lay_beside(look, pose, camera_step, pieces_world)
    off = np.where(shared > 0.5 * lengths, off, np.inf)
    nearest = np.argmin(off, axis=0)
    kept = np.flatnonzero(off[nearest, np.arange(off.shape[1])] < within_px)
    return replace(look, pairs=nearest[kept], segments_px=look.every_px[kept])


def measure_support(
    look: SeenPicture, pose: Pose2, camera_step: Floats, pieces_world: Floats, within_px: float
) -> float:
    """How many of the lines (m, 2, 3) segments lie on, each by the part of its length on which they do."""
    off, shared, _, line_px = _lay_beside(look, pose, camera_step, pieces_world)
    covered = np.sum(np.where(off < within_px, np.maximum(shared, 0.0), 0.0), axis=1)
    return float(np.sum(np.minimum(1.0, covered / line_px)))


def _lay_beside(
    look: SeenPicture, pose: Pose2, camera_step: Floats, pieces_world: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Of m lines and s segments: how far a segment's further end lies beside the line, and what length they share
    (m, s); the lengths along the line of the segments (m, s), and of the lines (m,) [px]."""
    ends = _project(look, pose, camera_step, pieces_world)
    along = ends[:, 1] - ends[:, 0]
    line_px = np.linalg.norm(along, axis=1)
    along = along / line_px[:, None]
    to = look.every_px[None] - ends[:, None, :1]
    off = np.abs(to[..., 1] * along[:, None, None, 0] - to[..., 0] * along[:, None, None, 1]).max(axis=2)
    at = np.sort(np.einsum("msei,mi->mse", to, along), axis=2)
    shared = np.minimum(at[..., 1], line_px[:, None]) - np.maximum(at[..., 0], 0.0)
    return off, shared, at[..., 1] - at[..., 0], line_px


def measure_slopes(look: SeenPicture, pose: Pose2, camera_step: Floats, pieces_world: Floats) -> tuple[Floats, Floats]:
    """By how much the offsets change with pose and camera, (p, 2, 10), and with the place of each line, (p, 2, 3)."""
    here = measure_offsets(look, pose, camera_step, pieces_world)
    by_state, state = [], np.concatenate([pose.vector, camera_step])
    for i, step in enumerate(STEPS):
        moved = state + step * np.eye(len(STEPS))[i]
        offsets = measure_offsets(look, Pose2(*moved[:3].tolist()), moved[3:], pieces_world)
        by_state.append((offsets - here) / step)
    by_place = [(measure_offsets(look, pose, camera_step, pieces_world + MOVE_M * np.eye(3)[i]) - here) / MOVE_M
                for i in range(3)]
    return np.stack(by_state, axis=-1), np.stack(by_place, axis=-1)
