"""Where exactly is the camera, near a prior, and is it sure? Match, solve, look again closer, and judge (§6).

The whole picture's segments are matched within what the prior allows; from the pose solved from them the model is
projected anew, edges are looked for only round it, matched and solved again. The verdict does not rest on a small
covariance alone, which looks the same at a wrong place.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from knowledge_sources.methods.features.lines import SIGMA_ACROSS_PX, LineSegments, find_lines, remove_duplicates
from knowledge_sources.methods.matching import match_in_space
from knowledge_sources.methods.pose import PoseEstimate, med_r_and_t, trunc_r_and_t
from knowledge_sources.methods.verification.agreement import Agreement, compute_agreement
from world_models.camera import Camera
from world_models.frames import Pose

Floats = NDArray[np.float64]

LEAST_LENGTH_PX = 8.0
"""Model lines that project shorter than this are not looked for."""
BAND_PX = 6.0
NEARER = 0.15
"""After the first round the pose may still be off by so much of the prior's deviations."""
FAR_PX, CLOSE_PX = (5.0, 1.5), (3.0, 1.0)
"""Of the first and the second match: the restricted space, and the deviation of an end about its line."""
PROBABILITY = 0.999
"""That one of the subsets drawn is free of outliers."""
LEAST_PAIRS = 6
LEAST_ACCOUNTED, MOST_P_FALSE = 6, 1e-4
"""Fewer lines accounted for, or likelier by chance: refuted."""
LEAST_COVERAGE = 2.0 / 3.0
"""The whole picture's segments cover more of what is in view at the right pose; with less nothing is verified."""
WRONG_SIGMAS = 2.0
"""The poses that show what agrees by chance are so many of the prior's deviations away."""
SURE_SIGMAS = 3.0
"""So many deviations of the pose must fit into the tolerance."""
CHALLENGES = 3
"""So often a pose gives way to a better one that is found from it; what has not come to rest then is not verified."""


class PoseVerdict(Enum):
    """What a picture says of a pose."""

    VERIFIED = "verified"
    REFUTED = "refuted"
    NOT_TESTABLE = "not testable"


@dataclass(frozen=True, slots=True, eq=False)
class CameraFix:
    """A camera pose and how far it is to be trusted.

    Attributes:
        estimate: the pose, with its covariance and what was rejected; one line a matched pair.
        pairs: (p, 2) index into the model lines, index into ``segments_px``.
        segments_px: (k, 2, 2) what was found round the model.
        evidence: which of the model lines are accounted for, and how easily by chance.
        coverage: part of their length in view that is, 0..1.
        verdict: refuted if what agrees may well agree by chance; verified only if most of the model is accounted
            for and the pose's covariance, with the residuals' own deviation, fits into the tolerance.
    """

    estimate: PoseEstimate
    pairs: NDArray[np.intp]
    segments_px: Floats
    evidence: Agreement
    coverage: float
    verdict: PoseVerdict

    @property
    def camera_from_world(self) -> Pose:
        """The pose."""
        return self.estimate.camera_from_world


def locate_camera(
    model_lines_world: Any,
    image: Any,
    camera: Camera,
    prior: Pose,
    prior_covariance: Any,
    *,
    tolerance_m: float,
    tolerance_rad: float,
    rng: np.random.Generator,
    segments: LineSegments | None = None,
) -> CameraFix | None:
    """The pose near the prior that the picture shows, ``None`` if too little matches to tell any.

    A pose that was found stands only if, sought again from there with the whole doubt of the prior, no other place
    comes out of which the picture shows more: at a wrong place, where most of the model lies on edges by chance, the
    right one is near enough to be found.

    Args:
        model_lines_world: (m, 2, 3) [m]. image: (h, w) grey levels. prior: ``camera_from_world``.
        prior_covariance: (6, 6) of its left perturbation. rng: draws subsets of lines.
        tolerance_m, tolerance_rad: how well the pose must be known to be verified.
        segments: those of the whole image, if they are known already.
    """
    model, spread = np.asarray(model_lines_world, float), np.asarray(prior_covariance, float)
    everything = (find_lines(image) if segments is None else segments).segments_px

    def located(start: Pose) -> CameraFix | None:
        return _located(model, image, camera, start, spread, everything, tolerance_m, tolerance_rad, rng)

    best = located(prior)
    for _ in range(CHALLENGES):
        rival = None if best is None else located(best.camera_from_world)
        if best is None or rival is None or rival.coverage <= best.coverage:
            return best
        if _same_place(rival.camera_from_world, best.camera_from_world, tolerance_m, tolerance_rad):
            return rival
        best = rival
    unsettled = best is not None and best.verdict is PoseVerdict.VERIFIED
    return replace(best, verdict=PoseVerdict.NOT_TESTABLE) if best is not None and unsettled else best


def _located(
    model: Floats, image: Any, camera: Camera, prior: Pose, spread: Floats, everything: Floats, tolerance_m: float,
    tolerance_rad: float, rng: np.random.Generator,
) -> CameraFix | None:
    """The pose that the picture shows within the prior's reach, judged by itself."""
    rough = _solved(model, everything, camera, prior, spread, FAR_PX, trunc_r_and_t, rng)
    if rough is None:
        return None
    pose = rough[0].camera_from_world
    near = _sought(model, image, camera, pose)
    fine = _solved(model, near, camera, pose, NEARER**2 * spread, CLOSE_PX, med_r_and_t, rng)
    if fine is None:
        return None
    return _judged(model, camera, *fine, near, everything, spread, tolerance_m, tolerance_rad)


def _same_place(pose: Pose, other: Pose, tolerance_m: float, tolerance_rad: float) -> bool:
    apart = float(np.linalg.norm(pose.inverse().translation - other.inverse().translation))
    return apart <= tolerance_m and pose.angle_to(other) <= tolerance_rad


def _in_view(model: Floats, camera: Camera, pose: Pose) -> NDArray[np.intp]:
    """Indices of the model lines that are seen from a pose at some length."""
    px, visible = camera.project_segments(model, pose)
    visible[visible] = np.linalg.norm(px[visible, 1] - px[visible, 0], axis=1) >= LEAST_LENGTH_PX
    return np.flatnonzero(visible)


def _sought(model: Floats, image: Any, camera: Camera, pose: Pose) -> Floats:
    """(k, 2, 2) edges in bands round the model lines as seen from a pose."""
    shown = camera.project_segments(model[_in_view(model, camera, pose)], pose)[0]
    return remove_duplicates(find_lines(image, shown, band_px=BAND_PX)).segments_px


def _solved(
    model: Floats, segments: Floats, camera: Camera, prior: Pose, spread: Floats, reach_px: tuple[float, float],
    solver: Callable[..., PoseEstimate], rng: np.random.Generator,
) -> tuple[PoseEstimate, NDArray[np.intp]] | None:
    """A robust pose of the matched pairs (p, 2), a model line's fragments being one landmark.

    ``reach_px``: of the match, the restricted space and the deviation of an end.
    """
    lines = _in_view(model, camera, prior)
    if len(lines) < LEAST_PAIRS:
        return None
    pair_px, sigma_px = reach_px
    match = match_in_space(model[lines], segments, camera, prior, spread, pair_px=pair_px, sigma_px=sigma_px)
    if len(match.pairs) < LEAST_PAIRS:
        return None
    i, k = lines[match.pairs[:, 0]], match.pairs[:, 1]
    found = solver(
        model[i], segments[k], camera, match.camera_from_world, landmark_ids=i.tolist(), sigma_px=SIGMA_ACROSS_PX,
        probability=PROBABILITY, rng=rng,
    )
    return found, np.stack([i, k], axis=1)


def _judged(
    model: Floats, camera: Camera, fine: PoseEstimate, pairs: NDArray[np.intp], near: Floats, everything: Floats,
    spread: Floats, tolerance_m: float, tolerance_rad: float,
) -> CameraFix:
    """With the evidence: agreement is counted with the whole image's segments, which were not sought at this pose."""
    wrong = _wrong_poses(fine.camera_from_world, spread)
    displaced = np.array([camera.project_segments(model, pose)[0] for pose in wrong])
    here = camera.project_segments(model, fine.camera_from_world)[0]
    lengths = np.linalg.norm(here[:, 1] - here[:, 0], axis=1)
    here[~(np.nan_to_num(lengths) >= LEAST_LENGTH_PX)] = np.nan
    found = compute_agreement(here, everything, displaced)
    coverage = found.covered_length(lengths)
    if found.matched < LEAST_ACCOUNTED or found.p_false > MOST_P_FALSE:
        verdict = PoseVerdict.REFUTED
    elif fine.ok and coverage >= LEAST_COVERAGE and _is_sharp(_as_seen(fine), tolerance_m, tolerance_rad):
        verdict = PoseVerdict.VERIFIED
    else:
        verdict = PoseVerdict.NOT_TESTABLE
    return CameraFix(fine, pairs, near, found, coverage, verdict)


def _as_seen(fine: PoseEstimate) -> Floats:
    """The covariance with the deviation that the inliers' residuals show in place of the assumed one."""
    squares = (fine.residuals_px[fine.inliers] / SIGMA_ACROSS_PX) ** 2
    freedom = max(squares.size - 6, 1)
    return np.asarray(fine.covariance * float(np.sum(squares)) / freedom)


def _is_sharp(covariance: Floats, tolerance_m: float, tolerance_rad: float) -> bool:
    """Whether the pose's worst deviations fit into the tolerances."""
    turn, shift = (float(np.linalg.eigvalsh(covariance[a : a + 3, a : a + 3])[-1]) for a in (0, 3))
    return SURE_SIGMAS * math.sqrt(turn) <= tolerance_rad and SURE_SIGMAS * math.sqrt(shift) <= tolerance_m


def _wrong_poses(pose: Pose, spread: Floats) -> list[Pose]:
    """Poses nearby at which the camera is not, turned and shifted: what agrees there agrees by chance."""
    root = WRONG_SIGMAS * np.linalg.cholesky(spread)
    steps = [sign * root[:, i] + root[:, j] for i in range(3) for j in range(3, 6) for sign in (1.0, -1.0)]
    return [pose.perturbed(step[:3], step[3:]) for step in steps]
