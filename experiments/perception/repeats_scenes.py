"""Structures that repeat themselves, seen by a camera: stairs, shelves, colonnades, window fronts, tiles, doors.

Flights are as in photographs: seen in part, from the front or diagonally, steps hidden, many edges missed; the model
has a part of the flight, or more than is seen, and is a little wrong. Boxes do not repeat, but have only nine edges.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.features import LineSegments
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
    """What repeats itself, or does not.

    Attributes:
        lines: (m, 2, 3) of the model [m]. pitch: by which they repeat themselves [m].
        eye, target: (3,) from where to where it is looked.
        seen: (n, 2, 3) what is there; None: the model. marks: whether others are put on it.
        detection: part of the lines that is found. prior: sigma and error (3,) of the prior's place [m]; None: drawn.
    """

    lines: Array
    pitch: float
    eye: Array
    target: Array
    seen: Array | None = None
    marks: bool = True
    detection: float = DETECTION
    prior: tuple[float, Array] | None = None


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


def build_flight(rng: Rng) -> Structure:
    """A flight of which the model has a part, or more than is seen, with doubled edges and the side's lines."""
    rise, run, wide = rng.uniform(0.14, 0.2), rng.uniform(0.24, 0.6), rng.uniform(1.0, 2.5)
    count = int(rng.integers(8, 17))
    nosing = rng.uniform(0.02, 0.05) if rng.uniform() < 0.5 else 0.0
    has_sides = rng.uniform() < 0.6

    def build(first: int, last: int, scale: float) -> list[Any]:
        lines: list[Any] = []
        for n in range(first, last):
            y, z = n * run * scale, (n + 1) * rise * scale
            for height in (z, z - rise * scale, *([z - nosing] if nosing else [])):
                lines.append([[0.0, y, height], [wide, y, height]])
            if has_sides:
                lines += [[[x, y, z - rise], [x, y, z]] for x in (0.0, wide)]
                lines += [[[x, y, z], [x, y + run, z]] for x in (0.0, wide)]
        return lines

    low, high = (int(at) for at in rng.integers(0, 4, 2))  # steps that the model lacks, or that are hidden
    first, last, hidden = 0, count, [n for n in (low - 1, count - high) if rng.uniform() < 0.5]
    if rng.uniform() < 0.5:
        first, last = low, count - high
    else:
        hidden += [*range(low), *range(count - high, count)]
    if rng.uniform() < 0.4:  # something stands before a few steps
        begin = int(rng.integers(0, count))
        hidden += range(begin, begin + int(rng.integers(1, 4)))
    seen = [line for n in range(count) if n not in hidden for line in build(n, n + 1, 1.0)]
    if rng.uniform() < 0.5:  # lines that do not repeat: walls beside the flight, and a door or a picture
        beside = [[[x, -1.0, 0.0], [x, -1.0, 2.5]] for x in (0.0, wide)]
        beside += _rectangle(rng.uniform(0.0, wide), rng.uniform(0.5, 1.5), *rng.uniform(0.3, 1.0, 2))
        seen += beside
    else:
        beside = []
    middle = np.array([wide, count * run, count * rise]) / 2.0
    diagonal = rng.uniform(-1.5, 1.5) if rng.uniform() < 0.5 else 0.0
    eye = np.array([wide * rng.uniform(0.2, 0.8) + diagonal * wide, -rng.uniform(1.0, 4.0), rng.uniform(1.0, 1.8)])
    pitch = math.hypot(rise, run)
    along, stairs = np.array([0.0, run, rise]), rng.choice([0.0, 1.0, 2.0]) * rng.choice([-1.0, 1.0])
    sigma = rng.uniform(0.1, max(0.11, 1.5 * pitch))
    model = np.array([*build(first, last, 1.0 + rng.normal(0.0, 0.004)), *beside])
    return Structure(model, pitch, eye, middle * rng.uniform(0.3, 1.3), np.array(seen), False,
                     rng.uniform(0.6, 0.9), (sigma, stairs * along + rng.normal(0.0, 0.04, 3)))


def build_box(rng: Rng) -> Structure:
    """The nine edges of a box that are seen from a corner, tracked to a few centimetres."""
    size = rng.uniform(0.2, 0.8, 3)
    corners = [size * [a, b, c] for a in (0, 1) for b in (0, 1) for c in (0, 1)]
    edges = [(a, b) for a in range(8) for b in range(a) if (a ^ b) in (1, 2, 4) and 3 not in (a, b)]
    target, away = size / 2.0, np.array([-rng.uniform(0.4, 1.0), -rng.uniform(0.6, 1.2), rng.uniform(0.4, 1.0)])
    sigma = rng.uniform(0.01, 0.05)
    return Structure(np.array([[corners[a], corners[b]] for a, b in edges]), float(size.min()),
                     target + away * rng.uniform(0.8, 2.5), target, None, False, rng.uniform(0.85, 1.0),
                     (sigma, rng.normal(0.0, sigma, 3)))


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
    "tiles": build_tiles, "doors": build_doors, "flight": build_flight, "box": build_box,
}


def draw_scene(kind: str, seed: int) -> RepeatScene:
    """A structure with up to six unrelated rectangles on it, its segments in a picture, and a prior."""
    rng = np.random.default_rng((seed, sorted(KINDS).index(kind)))
    while True:
        thing = KINDS[kind](rng)
        marks = _draw_marks(thing.lines, int(rng.integers(0, 7)) if thing.marks else 0, rng)
        model, there = (np.concatenate([lines, marks]) for lines in (
            thing.lines, thing.lines if thing.seen is None else thing.seen))
        truth = _look(thing.eye, thing.target, rng)
        seen, visible = CAMERA.project_segments(there, truth)
        if np.count_nonzero(visible) >= MIN_VIEW_LINES or (kind == "box" and visible.all()):
            break
    if thing.prior is None:
        sigma = thing.pitch * rng.uniform(0.1, MAX_PITCHES / 2.0)
        off = sigma * np.clip(rng.normal(size=3), -2.0, 2.0)
        off *= min(1.0, MAX_PITCHES * thing.pitch / max(float(np.linalg.norm(off)), 1e-9))
    else:
        sigma, off = thing.prior[0], truth.rotation @ thing.prior[1]
    turn_rad = PRIOR_RAD * np.clip(rng.normal(size=3), -2.0, 2.0)
    segments = find_segments(seen[visible], thing.detection, rng)
    covariance = np.diag(np.repeat([PRIOR_RAD, sigma], 3) ** 2)
    return RepeatScene(kind, thing.pitch, model, segments, truth, truth.perturbed(turn_rad, off), covariance)


def find_segments(lines_px: Array, detection: float, rng: Rng) -> Array:
    """Segments (k, 2, 2) of lines (n, 2, 2): some missed, in one to three pieces, with noise, among clutter."""
    pieces = []
    for start, end in lines_px[rng.uniform(size=len(lines_px)) < detection]:
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
