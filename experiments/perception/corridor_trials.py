"""One disturbed pose in a photograph of the corridor: who finds back, and what is said of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from experiments.paper.pose_peer import Peer
from experiments.perception.corridor_data import SHOWN, Corridor, CorridorFrame, load_corridor
from harvey.errors import BadInput
from knowledge_sources.methods.features.lines import LineSegments, find_lines
from knowledge_sources.methods.localization.locate_camera import LEAST_LENGTH_PX, CameraFix, PoseVerdict, locate_camera
from knowledge_sources.methods.matching import match_lines
from knowledge_sources.methods.pose import med_r_and_t
from knowledge_sources.settings import DEFAULT
from world_models.frames import Pose

Array = NDArray[np.float64]

SHIFT_STEPS, TURN_RAD = 0.5, math.radians(3.0)
BACK_STEPS, BACK_RAD = 0.05, math.radians(0.3)
PEER_LIMIT_PX = 3.0


@dataclass(frozen=True, slots=True)
class Disturbance:
    """How the reference poses are disturbed: ``scale`` times the stated errors, or up to that; and how often."""

    name: str
    scale: float
    up_to: bool
    seeds: int
    quick_seeds: int


@dataclass(frozen=True, slots=True)
class Attempt:
    """A disturbance of a frame; its seed decides it."""

    test: Disturbance
    frame: int
    seed: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Trial:
    """What came of it: who came back, and what ours said of itself.

    Attributes:
        shift_steps, turn_rad: how far off ours is. verdict: ours of itself, the value of a :class:`PoseVerdict`.
    """

    back: bool
    verdict: str
    peer_back: bool
    paper_back: bool
    shift_steps: float
    turn_rad: float

    @property
    def is_verified(self) -> bool:
        """Whether it said that it was right."""
        return self.verdict == PoseVerdict.VERIFIED.value

    @property
    def is_silent(self) -> bool:
        """Whether it was wrong and said that it was right."""
        return not self.back and self.is_verified


def tried(attempt: Attempt) -> Trial:
    """Ours, the paper's way and the peer from one disturbed pose."""
    data, (prior, rng) = _corridor(), disturbed(attempt)
    frame, segments = data.frames[attempt.frame], segments_of(attempt.frame)
    ours = found_from(attempt.frame, prior, rng)
    shift, turn = _errors(prior if ours is None else ours.camera_from_world, frame, data.step)
    peer = Peer.found()
    return Trial(
        back=shift <= BACK_STEPS and turn <= BACK_RAD,
        verdict=(PoseVerdict.NOT_TESTABLE if ours is None else ours.verdict).value,
        peer_back=peer is not None and ours is not None
        and _is_back(_peers(peer, data, frame, ours, prior), frame, data.step),
        paper_back=_is_back(_papers(data, frame, segments, prior, rng), frame, data.step),
        shift_steps=shift,
        turn_rad=turn,
    )


def disturbed(attempt: Attempt) -> tuple[Pose, np.random.Generator]:
    """The reference pose moved and turned in random directions, and the generator that goes on from there."""
    rng, data, test = np.random.default_rng(attempt.seed), _corridor(), attempt.test
    axes = rng.normal(size=(2, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    sizes = test.scale * (rng.uniform(size=2) if test.up_to else np.ones(2))
    pose = data.frames[attempt.frame].camera_from_world
    return pose.perturbed(TURN_RAD * sizes[0] * axes[0], SHIFT_STEPS * data.step * sizes[1] * axes[1]), rng


def found_from(number: int, prior: Pose, rng: np.random.Generator) -> CameraFix | None:
    """Ours, from a pose believed to 0.5 step and 3 degrees: 2 deviations."""
    data = _corridor()
    frame = data.frames[number]
    return locate_camera(
        data.model_lines, frame.image, frame.camera, prior, _spread(data.step), tolerance_m=BACK_STEPS * data.step,
        tolerance_rad=BACK_RAD, rng=rng, segments=segments_of(number),
    )


def in_view(lines: Array, frame: CorridorFrame, pose: Pose) -> tuple[Array, Array]:
    """Model lines (n, 2, 3) in view at some length, and where (n, 2, 2)."""
    px, visible = frame.camera.project_segments(lines, pose)
    long = np.nan_to_num(np.linalg.norm(px[:, 1] - px[:, 0], axis=1)) >= LEAST_LENGTH_PX
    return lines[visible & long], px[visible & long]


@cache
def segments_of(number: int) -> LineSegments:
    """What the line finder finds in a whole photograph."""
    return find_lines(_corridor().frames[number].image)


@cache
def _corridor() -> Corridor:
    data = load_corridor()
    if data is None:
        raise BadInput(f"expected the photographs in {SHOWN}, there are none")
    return data


def _spread(step: float) -> Array:
    """(6, 6) covariance of a belief."""
    return np.diag([(TURN_RAD / 2.0) ** 2] * 3 + [(SHIFT_STEPS * step / 2.0) ** 2] * 3)


def _papers(
    data: Corridor, frame: CorridorFrame, segments: LineSegments, prior: Pose, rng: np.random.Generator
) -> Pose:
    """§6 once through: the projected model moved rigidly in the picture, then Med R and T."""
    model, px = in_view(data.model_lines, frame, prior)
    match = match_lines(px, segments.segments_px, strategy="first", replace=False, peaks=1)
    i, k = match.pairs.T
    return med_r_and_t(
        model[i], segments.segments_px[k], frame.camera, prior, landmark_ids=i.tolist(),
        sigma_px=DEFAULT.features.sigma_across_px, probability=0.999, rng=rng,
    ).camera_from_world


def _peers(peer: Peer, data: Corridor, frame: CorridorFrame, ours: CameraFix, prior: Pose) -> Pose:
    """PoseLib's LO-RANSAC on the pairs that we matched."""
    i, k = ours.pairs.T
    return peer.ransac(data.model_lines[i], ours.segments_px[k], frame.camera, prior, limit_px=PEER_LIMIT_PX)


def _errors(pose: Pose, frame: CorridorFrame, step: float) -> tuple[float, float]:
    """How far off the camera is [steps] and how far turned [rad]."""
    truth = frame.camera_from_world
    apart = pose.inverse().translation - truth.inverse().translation
    return float(np.linalg.norm(apart)) / step, pose.angle_to(truth)


def _is_back(pose: Pose, frame: CorridorFrame, step: float) -> bool:
    shift, turn = _errors(pose, frame, step)
    return shift <= BACK_STEPS and turn <= BACK_RAD
