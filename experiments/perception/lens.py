"""Lines through a distorting lens: rectify the picture first, or the ends of the segments afterwards?

Cards with known edges are rendered through lenses. Their edges are found both ways and compared with where a camera
without distortion would see them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from experiments.generated.scenes import Patch, PatchFace
from experiments.report import Cell, Report
from knowledge_sources.methods.features.lines import find_lines
from knowledge_sources.methods.features.picture import Rectifier, read_picture
from sim.render.optics import Optics
from sim.render.renderer import Renderer
from sim.render.sensor import SensorParameters, compress_jpeg, expose
from world_models.camera import Camera
from world_models.frames import Pose

CARDS, QUICK_CARDS = 60, 12
LENSES: tuple[tuple[str, tuple[float, ...] | None], ...] = (
    ("none", None), ("k1 = -0.1", (-0.1, 0.01, 0.0, 0.0)), ("k1 = -0.2", (-0.2, 0.05, 0.001, -0.0005)),
    ("k1 = -0.35", (-0.35, 0.12, 0.0, 0.0)), ("k1 = +0.1", (0.1, 0.0, 0.0, 0.0)),
)
TEXTURE_M, MAX_OFFSET_PX, MAX_TURN_RAD = 1e6, 3.0, 0.05
COLUMNS = ("lens", "rectified", "edges found %", "segments per edge", "error px, RMS")
Floats = NDArray[np.float64]


def run(quick: bool, seed: int) -> Report:
    """Measure the same cards with every lens."""
    plain = Camera(400.0, 400.0, 255.5, 255.5, 512, 512)
    cards = QUICK_CARDS if quick else CARDS
    rows: list[tuple[Cell, ...]] = []
    found: dict[tuple[str, str], Floats] = {}
    for name, distortion in LENSES:
        lens = replace(plain, distortion=distortion)
        for way in ("picture", "ends") if distortion else ("-",):
            measured = _measure(lens, way, np.random.default_rng(seed), cards)
            found[name, way] = measured
            rows.append((name, way, 100.0 * float(measured[0]), float(measured[1]), float(measured[2])))
    lenses = [name for name, distortion in LENSES if distortion]
    return Report(
        "Edges seen through a distorting lens", COLUMNS, tuple(rows),
        notes=(
            f"{cards} cards, seed {seed}, 512 x 512 px, f = 400 px, blur 0.5 px, noise, JPEG quality 92.",
            "picture: it is rectified (cubic) before segments are found, as in missions. ends: segments are found in "
            "the distorted picture, and their ends rectified.",
            "edges found: share of the edges' length that lies on a segment; error: of a segment's ends, across the "
            "true edge.",
        ),
        claims=(
            ("rectifying the picture finds no less of the edges than rectifying ends",
             all(found[n, "picture"][0] >= found[n, "ends"][0] - 0.005 for n in lenses)),
            ("and its errors are no larger",
             all(found[n, "picture"][2] <= found[n, "ends"][2] for n in lenses)),
            ("its error is at most 0.05 px larger than without distortion",
             all(found[n, "picture"][2] <= found["none", "-"][2] + 0.05 for n in lenses)),
        ),
    )


def _measure(lens: Camera, way: str, rng: np.random.Generator, cards: int) -> Floats:
    """Measure the share of edges found, the segments per edge, and the RMS error [px]."""
    optics, pinhole = Optics.of(lens), lens.pinhole
    rectified = Rectifier(lens, pinhole)
    covered, length, pieces = 0.0, 0.0, 0
    errors: list[Floats] = []
    for _ in range(cards):
        renderer, corners = _card(rng)
        radiance = optics.radiance(renderer, Pose.identity())
        raw = read_picture(compress_jpeg(expose(radiance, SensorParameters(), rng), 92)).grey
        segments = find_lines(raw if way == "ends" else rectified.rectify(raw)).segments_px
        if way == "ends":
            segments = pinhole.project(lens.rays(segments))
        for edge in range(4):
            a, b = pinhole.project(corners[[edge, (edge + 1) % 4]])
            on, off = _compare_to_edge(segments, a, b)
            covered, length = covered + on, length + float(np.linalg.norm(b - a))
            pieces, errors = pieces + len(off), [*errors, off.ravel()]
    off = np.concatenate(errors)
    return np.array([covered / length, pieces / (4.0 * cards), np.sqrt(np.mean(off**2))])


def _card(rng: np.random.Generator) -> tuple[Renderer, Floats]:
    """A bright card before a dark wall, fully in view, and its corners (4, 3) [m]."""
    square = np.array([(-1.0, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, -1.0, 0.0), (-1.0, -1.0, 0.0)]) * rng.uniform(0.5, 0.9)
    place = (*rng.uniform(-0.5, 0.5, 2), rng.uniform(3.0, 4.5))
    corners = Pose.from_rotation_vector(rng.uniform(-0.4, 0.4, 3), place).apply(square)
    wall = np.array([(-60.0, 60.0, 9.0), (60.0, 60.0, 9.0), (60.0, -60.0, 9.0), (-60.0, -60.0, 9.0)])
    faces = (PatchFace((Patch("wall", wall, (0.1, 0.1, 0.1), "plain", TEXTURE_M),)),
             PatchFace((Patch("card", corners, (0.7, 0.7, 0.7), "plain", TEXTURE_M),)))
    return Renderer.of_faces(faces), corners


def _compare_to_edge(segments: Floats, a: Floats, b: Floats) -> tuple[float, Floats]:
    """Length of the edge a-b covered by segments [px], and the offsets (k, 2) of their ends across it [px]."""
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length
    across = np.array([-along[1], along[0]])
    t, off = (segments - a) @ along, (segments - a) @ across
    level = np.abs(off[:, 1] - off[:, 0]) < MAX_TURN_RAD * np.maximum(np.abs(t[:, 1] - t[:, 0]), 1e-9)
    near = np.all(np.abs(off) < MAX_OFFSET_PX, axis=1)
    here = level & near & np.all((t > -MAX_OFFSET_PX) & (t < length + MAX_OFFSET_PX), axis=1)
    marks = np.linspace(0.0, length, 400)
    low, high = t[here].min(axis=1), t[here].max(axis=1)
    seen = np.any((marks >= low[:, None] - 1.0) & (marks <= high[:, None] + 1.0), axis=0)
    return length * float(np.mean(seen)), off[here]
