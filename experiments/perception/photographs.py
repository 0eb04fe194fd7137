"""The corridor photographs (Oxford VGG) with their surveyed lines: poses recovered in them, and pictures of those."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from experiments.paper.paper_matching import match_as_paper
from experiments.paper.pose_peer import Peer
from experiments.perception.locate_camera import CameraFix, PoseVerdict, locate_camera
from experiments.perception.rivals import MIN_LINE_LENGTH_PX
from experiments.report import OURS, PEER, chart
from experiments.shared_data import CORRIDOR, data_path, describe_absence
from harvey.errors import BadInput
from knowledge_sources.methods.features import SIGMA_ACROSS_PX, LineSegments, find_lines, read_picture
from knowledge_sources.methods.pose import med_r_and_t
from world_models.camera import Camera
from world_models.frames import Pose

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class CorridorFrame:
    """A photograph (h, w), its camera, its reference pose and its publishers' segments (k, 2, 2)."""

    image: NDArray[np.uint8]
    camera: Camera
    camera_from_world: Pose
    segments_px: Array


@dataclass(frozen=True, slots=True, eq=False)
class Corridor:
    """Model lines (m, 2, 3) in the survey's own unit of length, and the frames."""

    model_lines: Array
    frames: tuple[CorridorFrame, ...]

    @property
    def step(self) -> float:
        """Mean distance of the camera between frames."""
        places = np.array([frame.camera_from_world.inverse().translation for frame in self.frames])
        return float(np.mean(np.linalg.norm(np.diff(places, axis=0), axis=1)))


def load_corridor(folder: Path | None = None) -> Corridor | None:
    """Load the data; ``None`` if there are none.

    Raises:
        BadInput: the file is there but is not what it should be.
    """
    folder = folder or data_path(CORRIDOR)
    path = folder / "corridor.json"
    if not path.is_file():
        return None
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        model = np.asarray(data["model_lines"], float).reshape(-1, 2, 3)
        frames = tuple(_frame(folder, entry) for entry in data["frames"])
    except KeyError as missing:
        raise BadInput(f"{path}: expected a key {missing}, there is none") from None
    except (ValueError, TypeError, OSError) as wrong:
        raise BadInput(f"{path}: expected lines and frames of the corridor, got {wrong}") from None
    if len(frames) < 2:
        raise BadInput(f"{path}: expected at least 2 frames, got {len(frames)}")
    return Corridor(model, frames)


def _frame(folder: Path, entry: Mapping[str, Any]) -> CorridorFrame:
    pose = entry["camera_from_world"]
    return CorridorFrame(
        read_picture((folder / entry["image"]).read_bytes()).grey,
        Camera(*(entry[name] for name in ("fx", "fy", "cx", "cy", "width", "height"))),
        Pose(np.asarray(pose["rotation"], float), np.asarray(pose["translation"], float)),
        np.asarray(entry["segments"], float).reshape(-1, 2, 2),
    )


PERTURB_STEPS, PERTURB_RAD = 0.5, math.radians(3.0)
MAX_ERROR_STEPS, MAX_ERROR_RAD = 0.05, math.radians(0.3)
PEER_MAX_RESIDUAL_PX = 3.0


@dataclass(frozen=True, slots=True)
class Perturbation:
    """How the reference poses are perturbed: ``scale`` times the stated errors, or up to that; and how often."""

    name: str
    scale: float
    up_to: bool
    seeds: int
    quick_seeds: int


@dataclass(frozen=True, slots=True)
class Attempt:
    """A perturbation of a frame, determined by its seed."""

    test: Perturbation
    frame: int
    seed: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Trial:
    """Result of an attempt.

    Attributes:
        recovered: whether our pose is right; peer_recovered, paper_recovered: the same of the others.
        verdict: our own verdict, the value of a :class:`PoseVerdict`.
        shift_steps, turn_rad: error of our pose.
    """

    recovered: bool
    verdict: str
    peer_recovered: bool
    paper_recovered: bool
    shift_steps: float
    turn_rad: float

    @property
    def is_verified(self) -> bool:
        """Whether its own verdict is that it is right."""
        return self.verdict == PoseVerdict.VERIFIED.value

    @property
    def is_false_accept(self) -> bool:
        """Whether it is wrong and was verified."""
        return not self.recovered and self.is_verified


def run_attempt(attempt: Attempt) -> Trial:
    """Run ours, the paper's method and the peer from one perturbed pose."""
    data, (prior, rng) = _corridor(), perturb_reference(attempt)
    frame, segments = data.frames[attempt.frame], find_segments(attempt.frame)
    ours = locate_from(attempt.frame, prior, rng)
    shift, turn = _errors(prior if ours is None else ours.camera_from_world, frame, data.step)
    peer = Peer.find()
    return Trial(
        recovered=shift <= MAX_ERROR_STEPS and turn <= MAX_ERROR_RAD,
        verdict=(PoseVerdict.NOT_TESTABLE if ours is None else ours.verdict).value,
        peer_recovered=peer is not None and ours is not None
        and _is_recovered(_solve_as_peer(peer, data, frame, ours, prior), frame, data.step),
        paper_recovered=_is_recovered(_solve_as_paper(data, frame, segments, prior, rng), frame, data.step),
        shift_steps=shift,
        turn_rad=turn,
    )


def perturb_reference(attempt: Attempt) -> tuple[Pose, np.random.Generator]:
    """Move and turn the reference pose in random directions; returned with the generator for the rest."""
    rng, data, test = np.random.default_rng(attempt.seed), _corridor(), attempt.test
    axes = rng.normal(size=(2, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    sizes = test.scale * (rng.uniform(size=2) if test.up_to else np.ones(2))
    pose = data.frames[attempt.frame].camera_from_world
    return pose.perturbed(PERTURB_RAD * sizes[0] * axes[0], PERTURB_STEPS * data.step * sizes[1] * axes[1]), rng


def locate_from(number: int, prior: Pose, rng: np.random.Generator) -> CameraFix | None:
    """Our pose from a prior whose two standard deviations are 0.5 step and 3 degrees."""
    data = _corridor()
    frame = data.frames[number]
    return locate_camera(
        data.model_lines, frame.image, frame.camera, prior, _prior_covariance(data.step),
        tolerance_m=MAX_ERROR_STEPS * data.step, tolerance_rad=MAX_ERROR_RAD, rng=rng, segments=find_segments(number),
    )


def select_visible(lines: Array, frame: CorridorFrame, pose: Pose) -> tuple[Array, Array]:
    """Select model lines (n, 2, 3) in view and long enough, with their projections (n, 2, 2) [px]."""
    px, visible = frame.camera.project_segments(lines, pose)
    long = np.nan_to_num(np.linalg.norm(px[:, 1] - px[:, 0], axis=1)) >= MIN_LINE_LENGTH_PX
    return lines[visible & long], px[visible & long]


@cache
def find_segments(number: int) -> LineSegments:
    """Find the line segments of a whole photograph."""
    return find_lines(_corridor().frames[number].image)


@cache
def _corridor() -> Corridor:
    data = load_corridor()
    if data is None:
        raise BadInput(f"expected the photographs: {describe_absence(CORRIDOR)}")
    return data


def _prior_covariance(step: float) -> Array:
    """(6, 6) covariance of the prior."""
    return np.diag([(PERTURB_RAD / 2.0) ** 2] * 3 + [(PERTURB_STEPS * step / 2.0) ** 2] * 3)


def _solve_as_paper(
    data: Corridor, frame: CorridorFrame, segments: LineSegments, prior: Pose, rng: np.random.Generator
) -> Pose:
    """§6 once: rigid 2D match of the projected model, then Med R and T."""
    model, px = select_visible(data.model_lines, frame, prior)
    match = match_as_paper(px, segments.segments_px)
    i, k = match.pairs.T
    return med_r_and_t(
        model[i], segments.segments_px[k], frame.camera, prior, landmark_ids=i.tolist(),
        sigma_px=SIGMA_ACROSS_PX, probability=0.999, rng=rng,
    ).camera_from_world


def _solve_as_peer(peer: Peer, data: Corridor, frame: CorridorFrame, ours: CameraFix, prior: Pose) -> Pose:
    """PoseLib's LO-RANSAC on our pairs."""
    i, k = ours.pairs.T
    lines, segments = data.model_lines[i], ours.segments_px[k]
    return peer.ransac(lines, segments, frame.camera, prior, max_residual_px=PEER_MAX_RESIDUAL_PX)


def _errors(pose: Pose, frame: CorridorFrame, step: float) -> tuple[float, float]:
    """Position error [steps] and rotation error [rad]."""
    truth = frame.camera_from_world
    apart = pose.inverse().translation - truth.inverse().translation
    return float(np.linalg.norm(apart)) / step, pose.angle_to(truth)


def _is_recovered(pose: Pose, frame: CorridorFrame, step: float) -> bool:
    shift, turn = _errors(pose, frame, step)
    return shift <= MAX_ERROR_STEPS and turn <= MAX_ERROR_RAD


SIZE_IN = (7.0, 7.3)


def draw_attempt(data: Corridor, attempt: Attempt, path: Path) -> None:
    """Draw a photograph with the model from the perturbed pose (orange) and from the pose found (blue)."""
    frame = data.frames[attempt.frame]
    prior, rng = perturb_reference(attempt)
    found = locate_from(attempt.frame, prior, rng)
    verdict = "no pose found" if found is None else found.verdict.value
    with chart(path, f"Frame {attempt.frame}, {attempt.test.name}: {verdict}", "u [px]", "v [px]", SIZE_IN) as axes:
        axes.grid(visible=False)
        axes.imshow(frame.image, cmap="gray", vmin=0, vmax=255)
        perturbed = select_visible(data.model_lines, frame, prior)[1]
        axes.add_collection(_lines(perturbed, PEER, "model at the perturbed pose"))
        if found is not None:
            shown = select_visible(data.model_lines, frame, found.camera_from_world)[1]
            axes.add_collection(_lines(shown, OURS, "model at the pose found"))


def _lines(segments_px: Array, colour: str, label: str) -> LineCollection:
    return LineCollection(list(segments_px), colors=colour, linewidths=1.0, label=label)
