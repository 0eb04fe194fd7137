"""Structures that repeat themselves, seen by a camera: stairs, shelves, colonnades, window fronts, tiles, doors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.features.lines import LineSegments
from world_models.camera import Camera
from world_models.frames import Pose

Array = NDArray[np.float64]
Rng = np.random.Generator

CAMERA = Camera.from_field_of_view(math.radians(60.0))
CAMERA_AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rows: the camera's right, down and forward in a world of x to the right, y ahead and z up, without any turn."""
NOISE_PX, DETECTION, MAX_CLUTTER = 0.3, 0.92, 120
LONG_PX, SHORT_PX = 40.0, 6.0
"""Lines longer than the first may be in pieces; none shorter than the second are found."""
PRIOR_RAD = math.radians(1.5)
MAX_PITCHES = 3.0
"""Largest error of a prior along the repetition."""
MIN_VIEW_LINES = 12


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """Lines (m, 2, 3) [m] that repeat themselves by ``pitch`` [m], and from where (3,) to where (3,) it is looked."""

    lines: Array
    pitch: float
    eye: Array
    target: Array


@dataclass(frozen=True, slots=True, eq=False)
class RepeatScene:
    """One picture of a structure.

    Attributes:
        model: (m, 2, 3) [m]. segments_px: (k, 2, 2) as found. truth, prior: ``camera_from_world``.
        covariance: (6, 6) of the prior's left perturbation.
    """

    kind: str
    pitch: float
    model: Array
    segments_px: Array
    truth: Pose
    prior: Pose
    covariance: Array


def build_stairs(rng: Rng) -> Structure:
    """Treads with their lower edges, the side's zigzag, and at times a handrail with posts."""
    rise, run, wide = rng.uniform(0.14, 0.2), rng.uniform(0.24, 0.32), rng.uniform(1.0, 2.5)
    count = int(rng.integers(7, 14))
    lines: list[Any] = []
    for n in range(count):
        y, z = n * run, (n + 1) * rise
        lines += [[[0.0, y, z], [wide, y, z]], [[0.0, y, z - rise], [wide, y, z - rise]]]
        lines += [[[x, y, z - rise], [x, y, z]] for x in (0.0, wide)]
        lines += [[[x, y, z], [x, y + run, z]] for x in (0.0, wide)]
    if rng.uniform() < 0.7:  # a handrail on one side, which begins and ends somewhere
        x, (first, last) = rng.choice([0.0, wide]), np.sort(rng.uniform(0.0, count, 2))
        ends = [np.array([x, at * run, at * rise + 0.9]) for at in (first, last)]
        lines += [[ends[0], ends[1]], *([end, end - [0.0, 0.0, 0.9]] for end in ends)]
    eye = np.array([rng.uniform(0.2, wide - 0.2), -rng.uniform(1.2, 3.0), rng.uniform(1.2, 1.7)])
    middle = np.array([wide, count * run, count * rise]) / 2.0
    return Structure(np.array(lines), math.hypot(rise, run), eye, middle)


def build_shelves(rng: Rng) -> Structure:
    """Boards between uprights, several bays."""
    pitch, bay, boards, bays = rng.uniform(0.25, 0.5), rng.uniform(0.7, 1.2), rng.integers(4, 8), rng.integers(2, 5)
    lines = [[[0.0, 0.0, z + d], [bays * bay, 0.0, z + d]] for z in pitch * np.arange(boards) for d in (0.0, 0.02)]
    high, sides = (boards - 1) * pitch, bay * np.arange(bays + 1)
    lines += [[[x + d, 0.0, 0.0], [x + d, 0.0, high]] for x in sides for d in (0.0, 0.03)]
    return _before(np.array(lines), pitch, rng)


def build_colonnade(rng: Rng) -> Structure:
    """Columns of two edges each, with bases."""
    pitch, high, thick = rng.uniform(1.0, 3.0), rng.uniform(2.5, 4.0), rng.uniform(0.2, 0.4)
    lines = []
    for x in pitch * np.arange(rng.integers(4, 8)):
        lines += [[[x + d, 0.0, 0.0], [x + d, 0.0, high]] for d in (0.0, thick)]
        lines += [[[x, 0.0, z], [x + thick, 0.0, z]] for z in (0.2, high)]
    return _before(np.array(lines), pitch, rng)


def build_windows(rng: Rng) -> Structure:
    """A front of windows in storeys."""
    pitch, storey = rng.uniform(1.0, 3.0), rng.uniform(2.6, 3.4)
    wide, high = rng.uniform(0.4, 0.75) * pitch, rng.uniform(1.0, 1.8)
    lines = []
    for x in pitch * np.arange(rng.integers(3, 8)):
        for z in storey * np.arange(rng.integers(1, 4)) + 0.8:
            lines += _rectangle(x, z, wide, high)
    return _before(np.array(lines), pitch, rng)


def build_tiles(rng: Rng) -> Structure:
    """A tiled floor and a back wall."""
    pitch, across, along = rng.uniform(0.3, 1.0), rng.integers(5, 9), rng.integers(5, 9)
    lines = [[[x, 0.0, 0.0], [x, along * pitch, 0.0]] for x in pitch * np.arange(across + 1)]
    lines += [[[0.0, y, 0.0], [across * pitch, y, 0.0]] for y in pitch * np.arange(along + 1)]
    wide = across * pitch
    eye = np.array([wide * rng.uniform(0.3, 0.7), -rng.uniform(0.5, 2.0), rng.uniform(1.2, 1.8)])
    return Structure(np.array(lines), pitch, eye, np.array([wide / 2.0, along * pitch / 2.0, 0.0]))


def build_doors(rng: Rng) -> Structure:
    """Doors in a row, and the edges of floor and ceiling."""
    pitch, count = rng.uniform(1.2, 3.0), rng.integers(4, 9)
    lines = [line for x in pitch * np.arange(count) for line in _rectangle(x, 0.0, 0.9, 2.0)[1:]]
    lines += [[[-0.5, 0.0, z], [count * pitch, 0.0, z]] for z in (0.0, 2.6)]
    return _before(np.array(lines), pitch, rng)


KINDS: Mapping[str, Callable[[Rng], Structure]] = {
    "stairs": build_stairs, "shelves": build_shelves, "colonnade": build_colonnade, "windows": build_windows,
    "tiles": build_tiles, "doors": build_doors,
}


def draw_scene(kind: str, seed: int) -> RepeatScene:
    """A structure with up to six unrelated rectangles on it, its segments in a picture, and a prior."""
    rng = np.random.default_rng((seed, sorted(KINDS).index(kind)))
    while True:
        thing = KINDS[kind](rng)
        model = np.concatenate([thing.lines, _draw_marks(thing.lines, int(rng.integers(0, 7)), rng)])
        truth = _look(thing.eye, thing.target, rng)
        seen, visible = CAMERA.project_segments(model, truth)
        if np.count_nonzero(visible) >= MIN_VIEW_LINES:
            break
    sigma = thing.pitch * rng.uniform(0.1, MAX_PITCHES / 2.0)
    deviations = np.array([PRIOR_RAD] * 3 + [sigma] * 3)
    off = deviations * np.clip(rng.normal(size=6), -2.0, 2.0)
    off[3:] *= min(1.0, MAX_PITCHES * thing.pitch / max(float(np.linalg.norm(off[3:])), 1e-9))
    segments = find_segments(seen[visible], rng)
    return RepeatScene(
        kind, thing.pitch, model, segments, truth, truth.perturbed(off[:3], off[3:]), np.diag(deviations**2))


def find_segments(lines_px: Array, rng: Rng) -> Array:
    """Segments (k, 2, 2) of lines (n, 2, 2): some missed, in one to three pieces, with noise, among clutter."""
    pieces = []
    for start, end in lines_px[rng.uniform(size=len(lines_px)) < DETECTION]:
        length = max(float(np.linalg.norm(end - start)), 1.0)
        pieces_here = int(rng.integers(0, 3)) if length > LONG_PX else 0
        cuts = np.concatenate([[0.0], np.sort(rng.uniform(0.1, 0.9, pieces_here)), [1.0]])
        gaps = rng.uniform(0.5, 2.0, (len(cuts) - 1, 2)) / length * [1.0, -1.0]
        pieces += [np.stack([start + a * (end - start), start + b * (end - start)])
                   for a, b in np.stack([cuts[:-1], cuts[1:]], axis=1) + gaps if (b - a) * length > SHORT_PX]
    found = np.array(pieces).reshape(-1, 2, 2)
    along = found[:, 1] - found[:, 0]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    found = found + rng.normal(0.0, NOISE_PX, (len(found), 2, 1)) * across[:, None]
    clutter = int(rng.integers(0, MAX_CLUTTER))
    first, angle = rng.uniform(0.0, 511.0, (clutter, 2)), rng.uniform(0.0, math.pi, clutter)
    reach = (rng.exponential(20.0, (clutter, 1)) + 8.0) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.concatenate([found, np.stack([first, first + reach], axis=1)])


def _before(lines: Array, pitch: float, rng: Rng) -> Structure:
    """A structure in the plane y = 0, seen from in front."""
    low, high = lines.reshape(-1, 3).min(axis=0), lines.reshape(-1, 3).max(axis=0)
    middle, wide = (low + high) / 2.0, float(high[0] - low[0])
    eye = middle + np.array([rng.uniform(-0.3, 0.3) * wide, -rng.uniform(0.5, 1.1) * max(wide, 1.5), 0.0])
    eye[2] = rng.uniform(1.2, 1.8)
    return Structure(lines, pitch, eye, middle + np.array([rng.uniform(-0.2, 0.2) * wide, 0.0, 0.0]))


def _draw_marks(lines: Array, count: int, rng: Rng) -> Array:
    """(4 count, 2, 3) rectangles in upright planes across the structure: pictures, signs, boxes."""
    low, high = lines.reshape(-1, 3).min(axis=0), lines.reshape(-1, 3).max(axis=0)
    marks = []
    for _ in range(count):
        x, y, z = low + rng.uniform(size=3) * (high - low)
        sides = np.array(_rectangle(x, z, *rng.uniform(0.15, 0.6, 2)))
        marks.append(sides + np.array([0.0, y, 0.0]))
    return np.concatenate(marks) if marks else np.zeros((0, 2, 3))


def _rectangle(x: float, z: float, wide: float, high: float) -> list[list[list[float]]]:
    """Bottom, top, left and right, in the plane y = 0."""
    right, top = x + wide, z + high
    return [[[x, 0.0, z], [right, 0.0, z]], [[x, 0.0, top], [right, 0.0, top]], [[x, 0.0, z], [x, 0.0, top]],
            [[right, 0.0, z], [right, 0.0, top]]]


def _look(eye: Array, target: Array, rng: Rng) -> Pose:
    """The ``camera_from_world`` of a camera at an eye (3,) that looks about at a target (3,)."""
    away = target - eye
    yaw, pitch = math.atan2(-away[0], away[1]), math.atan2(away[2], math.hypot(away[0], away[1]))
    turn = Pose.from_rotation_vector([0.0, 0.0, -yaw], np.zeros(3)).rotation
    level = CAMERA_AXES @ turn
    rotation = Pose.from_rotation_vector([-pitch, 0.0, 0.0], np.zeros(3)).rotation @ level
    wobble = Pose.from_rotation_vector(rng.normal(0.0, 0.04, 3), np.zeros(3)).rotation @ rotation
    return Pose(wobble, -wobble @ eye)


def to_line_segments(segments_px: Array) -> LineSegments:
    """Segments (k, 2, 2) as the line finder would give them."""
    count = len(segments_px)
    return LineSegments(
        segments_px, np.full(count, NOISE_PX), np.full(count, 0.01), np.full(count, 50.0), np.full(count, -1))
