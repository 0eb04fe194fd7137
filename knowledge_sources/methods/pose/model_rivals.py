"""Is the model wrong, or the camera? Both are weighed by one picture, so that neither is blamed for the other.

A corridor that is wider looks like a longer lens, and walls that stand elsewhere pull the focal length along. So pose,
camera and the model's modes (:class:`world_models.building.model_errors.LineErrors`) are fitted together, once for each
rival: with a camera as it was set up or with one that may be otherwise, and with a model that is right as measured or
one that is inexact. What a rival leaves free costs it: the likelihood is the marginal one, over all that is not known
(Laplace's approximation; MacKay, Information theory, inference and learning algorithms, 2003, chapter 28).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from knowledge_sources.methods.arrays import Floats, Mask
from knowledge_sources.methods.pose.camera_kernel import FOCAL, HEIGHT, measure_lines
from knowledge_sources.methods.pose.planar import to_pose2
from knowledge_sources.methods.pose.with_camera import FREE, POSE, UNKNOWNS, CameraEstimate, build_information
from world_models.building.model_errors import INEXACT_M, MEASURED_M, LineErrors
from world_models.camera import YAW, Camera, CameraMount
from world_models.entries.difference import RivalKind
from world_models.frames import Pose2

LINE_SIGMA_PX = 0.45
"""Deviation of a segment's end across its line, as protection levels have it."""
MAX_SQUARE = 18.0
"""Squared deviations of both ends up to which a line agrees: 3 sigma."""
WIDTHS_PX = (24.0, 12.0, 6.0, 3.0, 1.5)
"""Widths of the loss by which all is fitted, each for two steps."""
LAST_STEPS = 6
"""Steps on the lines that agree."""
NUDGE = 1e-9
"""Keeps a camera that is known exactly invertible."""


@dataclass(frozen=True, slots=True, eq=False)
class Given:
    """What one picture shows.

    Attributes:
        lines_world: (n, 2, 3) model lines [m]. segments_px: (n, 2, 2).
        camera, mount: before; belief, covariance: (3, 3) of the pose as a prior.
    """

    lines_world: Floats
    segments_px: Floats
    camera: Camera
    mount: CameraMount
    belief: Pose2
    covariance: Floats


@dataclass(frozen=True, slots=True, eq=False)
class JointFit:
    """Pose, camera and model as one picture shows them, under one rival.

    Attributes:
        state: (10,) pose, then the step of the camera's unknowns; covariance: (9, 9) of it, but for the yaw.
        amplitudes: (k,) of the modes, in standard deviations; near: (n,) lines that agree.
        log_likelihood: marginal, up to what all rivals share. camera_chi2: squared distance of the camera's step.
    """

    state: Floats
    covariance: Floats
    amplitudes: Floats
    near: Mask
    log_likelihood: float
    camera_chi2: float

    @property
    def sigmas(self) -> Floats:
        """(10,) standard deviations of the state; 0 of the yaw."""
        sigmas = np.zeros(UNKNOWNS)
        sigmas[FREE] = np.sqrt(np.diag(self.covariance))
        return sigmas


def fit_jointly(given: Given, camera_covariance: Floats, errors: LineErrors, start: Pose2) -> JointFit:
    """Fit pose, camera and model from a pose.

    Args:
        camera_covariance: (7, 7) over :data:`~world_models.camera.CAMERA_UNKNOWNS`; its yaw is not estimated.
    """
    shifts = errors.displacements[np.any(errors.displacements != 0.0, axis=(1, 2))]
    size, modes = len(FREE), len(shifts)
    prior = np.eye(size + modes)
    prior[:size, :size] = build_information(
        given.covariance, camera_covariance + NUDGE * np.eye(len(camera_covariance)))[np.ix_(FREE, FREE)]
    first = np.array([*given.belief.vector, *np.zeros(UNKNOWNS - POSE)])
    state = np.array([*start.vector, *first[POSE:]])
    state[2] = first[2] + np.remainder(state[2] - first[2] + np.pi, 2.0 * np.pi) - np.pi
    amplitudes = np.zeros(modes)
    for step in range(2 * len(WIDTHS_PX) + LAST_STEPS):
        distances, slopes = _measure(given, shifts, state, amplitudes)
        squares = np.sum(distances**2, axis=1)
        weights = (squares <= MAX_SQUARE).astype(float)
        if step < 2 * len(WIDTHS_PX):
            weights = 1.0 / (1.0 + 0.25 * squares * (LINE_SIGMA_PX / WIDTHS_PX[step // 2]) ** 2) ** 2
        weighted = slopes * weights[:, None, None]
        gradient = np.einsum("neu,ne->u", weighted, distances) + prior @ np.append((state - first)[FREE], amplitudes)
        moved = np.linalg.solve(np.tensordot(weighted, slopes, axes=((0, 1), (0, 1))) + prior, gradient)
        state[FREE] -= moved[:size]
        amplitudes = amplitudes - moved[size:]
    distances, slopes = _measure(given, shifts, state, amplitudes)
    squares = np.sum(distances**2, axis=1)
    near = squares <= MAX_SQUARE
    hessian = np.tensordot(slopes[near], slopes[near], axes=((0, 1), (0, 1))) + prior
    off = np.append((state - first)[FREE], amplitudes)
    cost = float(np.minimum(squares, MAX_SQUARE).sum() + off @ prior @ off)
    log_likelihood = 0.5 * (np.linalg.slogdet(prior)[1] - np.linalg.slogdet(hessian)[1] - cost)
    camera = slice(POSE, size)
    return JointFit(
        state, np.asarray(np.linalg.inv(hessian)[:size, :size], float), amplitudes, near, float(log_likelihood),
        float(off[camera] @ prior[camera, camera] @ off[camera]))


def to_camera_estimate(fit: JointFit, camera_covariance: Floats) -> CameraEstimate:
    """What a fit says of the camera, the model's errors integrated out; the yaw stays as it was (7, 7)."""
    kept = FREE[POSE:] - POSE
    covariance = np.zeros_like(camera_covariance)
    covariance[YAW, YAW] = camera_covariance[YAW, YAW]
    covariance[np.ix_(kept, kept)] = fit.covariance[POSE:, POSE:]
    slopes = np.zeros((POSE, len(camera_covariance)))
    slopes[:, kept] = fit.covariance[:POSE, POSE:] @ np.linalg.inv(fit.covariance[POSE:, POSE:])
    return CameraEstimate(
        to_pose2(fit.state[:POSE]), fit.covariance[:POSE, :POSE], slopes, fit.state[POSE:].copy(), covariance, fit.near,
        -2.0 * fit.log_likelihood, fit.camera_chi2)


def fit_rivals(given: Given, opened: Floats, nominal: Floats, errors: LineErrors) -> dict[RivalKind, JointFit]:
    """The fit of each rival of one picture, from the place where an inexact model and any camera would have it.

    A camera that is mounted otherwise may have another lens too: it was taken for another one.

    Args:
        opened, nominal: (7, 7) of a camera that may be otherwise, and of one as it was set up.
    """
    fine, coarse = errors.restate(MEASURED_M), errors.restate(INEXACT_M)
    there = to_pose2(fit_jointly(given, opened, coarse, given.belief).state[:POSE])
    is_of_lens = np.arange(len(nominal)) >= FOCAL - POSE
    lens = np.where(np.outer(is_of_lens, is_of_lens), opened, nominal)
    rivals: dict[RivalKind, tuple[Floats, LineErrors]] = {
        "chance": (nominal, fine), "wall": (nominal, coarse), "focal length": (lens, fine), "mounting": (opened, fine)}
    return {kind: fit_jointly(given, camera, model, there) for kind, (camera, model) in rivals.items()}


def _measure(given: Given, shifts: Floats, state: Floats, amplitudes: Floats) -> tuple[Floats, Floats]:
    """Distances (n, 2) in deviations, and their derivatives (n, 2, 9 + k) by the state and the modes."""
    c, m = given.camera, given.mount
    moved = given.lines_world + np.tensordot(amplitudes, shifts, axes=1)[:, None]
    distances, slopes = measure_lines(
        np.ascontiguousarray(moved), np.ascontiguousarray(given.segments_px), np.array([c.fx, c.fy, c.cx, c.cy]),
        np.array([m.height_m, m.forward_m, m.tilt_rad, m.roll_rad, m.yaw_rad]), state)
    by_modes = -np.einsum("nea,kna->nek", slopes[..., [0, 1, HEIGHT]], shifts)  # lines go there, or the camera back
    return distances / LINE_SIGMA_PX, np.concatenate([slopes[..., FREE], by_modes], axis=2) / LINE_SIGMA_PX
