"""The exact pose of a camera near a prior, with six unknowns (§6): match, solve, look again closer, and judge.

The segments of the whole picture are matched within what the prior allows. From the pose solved from them the model is
projected again, edges are searched in bands around it, matched and solved again. The verdict does not rest on the
covariance alone, which looks the same at a wrong place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
from scipy.special import bdtr

from experiments.paper.pose_solvers import trunc_r_and_t
from experiments.perception.rivals import (
    DETECTION_RATE,
    MIN_LINE_LENGTH_PX,
    PoseScore,
    compute_pose_score,
    find_self_motions,
    project_leaders,
)
from knowledge_sources.methods.arrays import Floats, Indices
from knowledge_sources.methods.features import SIGMA_ACROSS_PX, LineSegments, find_lines
from knowledge_sources.methods.matching import CameraParameters, build_camera_parameters, match_in_space
from knowledge_sources.methods.pose import MIN_NOISE_PART, PoseEstimate, med_r_and_t, r_and_t_ml
from knowledge_sources.methods.verification import Agreement, compute_agreement, compute_p_false
from world_models.camera import Camera
from world_models.frames import Pose

CAMERA_BAND_PX = 6.0  # half-width of the bands that are searched for edges around the first pose
MAX_DUPLICATE_OFFSET_PX = 0.7  # px; largest distance across at which a segment repeats a longer one
MAX_DUPLICATE_OVERHANG_PX = 3.0  # px; largest distance beyond the ends at which it does
CAMERA_SECOND_PRIOR = 0.15  # standard deviation of the first pose, as a part of the prior's
CAMERA_NEAR_PRIOR = 0.5  # the same of a second try from the prior, where nothing is verified from the whole of it
CAMERA_START_SIGMAS = 1.5  # shifts of further tries along its axes, in the prior's deviations; to its corners, one
CAMERA_COARSE_PAIR_PX = 5.0  # restricted space of the first match (§6.1.4)
CAMERA_COARSE_SIGMA_PX = 1.5  # deviation of an end of a pair of the first match
CAMERA_FINE_PAIR_PX = 3.0  # restricted space of the second match (§6.1.4)
CAMERA_FINE_SIGMA_PX = 1.0  # deviation of an end of a pair of the second match
CAMERA_PROBABILITY = 0.999  # probability that one of the drawn subsets is free of outliers (§6.2.4)
CAMERA_MIN_PAIRS = 6  # fewest matched pairs that are solved for a pose
CAMERA_MIN_MATCHED_LINES = 6  # fewest matched lines of a pose not refuted
CAMERA_MAX_P_FALSE = 1e-4  # largest chance of a pose that is not refuted
CAMERA_MIN_COVERAGE = 2.0 / 3.0  # smallest covered part of the model of a verified pose
CAMERA_DISPLACEMENT_SIGMAS = 2.0  # displacement of the poses at which chance is counted, in the prior's deviations
CAMERA_TOLERANCE_SIGMAS = 3.0  # standard deviations of a verified pose that fit into the tolerance
CAMERA_MAX_RESTARTS = 5  # most times that a pose is replaced by a better one found from it
CAMERA_MAX_P_MISSED = 1e-3  # largest chance that a right pose shows so few of its lines, of a refuted pose
RIVAL_MIN_LEAD = 5.0  # log likelihood ratio by which a verified pose leads every rival, and
RIVAL_LEAD_PER_LINE = 0.25  # so much for each line: those of one thing are hidden, missed or displaced together
RIVAL_MAX_PRIOR = 2.0  # log likelihood ratio that the prior says at most, as priors are wrong too
RIVAL_MAX_REFINED = 10  # most rivals that are refined, the likeliest

RESTLESS = "each pose that is found leads to a better one"


class PoseVerdict(Enum):
    """What a picture says of a pose."""

    VERIFIED = "verified"
    REFUTED = "refuted"
    NOT_TESTABLE = "not testable"


@dataclass(frozen=True, slots=True, eq=False)
class AliasRisk:
    """Another pose.

    Attributes:
        lead: log likelihood ratio of the pose in question to this one; negative where this one is better.
        needed: the lead from which the pose in question may be verified.
    """

    camera_from_world: Pose
    lead: float
    needed: float


@dataclass(frozen=True, slots=True, eq=False)
class CameraFix:
    """A camera pose and how far it can be trusted.

    Attributes:
        estimate: the pose, its covariance and the rejected pairs; one line for each pair.
        pairs: (p, 2) index of the model line, index into ``segments_px``.
        segments_px: (k, 2, 2) found around the projected model.
        evidence: which of the model lines are matched, and how many would be by chance.
        coverage: covered part of their length in view, 0..1.
        verdict: refuted if the agreement may well be by chance, and a right pose would hardly show so few lines;
            verified only if most of the model is covered, the covariance, scaled by the residuals, fits into the
            tolerance, and no other pose explains comparably much.
        rival: the pose that explains most besides, where the model repeats itself.
        reason: why it is not verified, in words; "" where it is.
    """

    estimate: PoseEstimate
    pairs: Indices
    segments_px: Floats
    evidence: Agreement
    coverage: float
    verdict: PoseVerdict
    reason: str = ""
    rival: AliasRisk | None = None

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
    """Find the pose near the prior that the picture shows; None if too few lines are matched.

    The search is repeated from each pose that it finds, with the whole covariance of the prior, until no other pose
    covers more of the model: at a wrong place, where most of the model lies on edges by chance, the right place is near
    enough to be found. A pose that does not come to rest is not verified.

    Args:
        model_lines_world: (m, 2, 3) [m].
        image: (h, w) grey levels; None where the segments are all that is known of it.
        prior, prior_covariance: ``camera_from_world`` and (6, 6) of its left perturbation.
        tolerance_m, tolerance_rad: how precise a verified pose must be.
        rng: draws subsets of lines.
        segments: those of the whole image, if they are known already.
    """
    segments_px = (find_lines(image) if segments is None else segments).segments_px
    spread = np.asarray(prior_covariance, float)
    search = CameraSearch(
        build_camera_parameters(prior, spread), np.asarray(model_lines_world, float), image, camera, spread,
        segments_px, tolerance_m, tolerance_rad, rng)
    best = search.locate(prior, spread)
    root = np.linalg.cholesky(spread)[3:, 3:]
    corners = np.stack(np.meshgrid(*[[1.0, -1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3) @ root.T
    away = CAMERA_START_SIGMAS * root.T
    for shift in (np.zeros(3), *away, *-away, *corners):  # starts are sparse in a wide prior, and may see nothing
        if best is not None and best.verdict is PoseVerdict.VERIFIED:
            break
        near = search.locate(prior.perturbed(np.zeros(3), shift), CAMERA_NEAR_PRIOR**2 * spread)
        best = search.choose(best, near)
    for _ in range(CAMERA_MAX_RESTARTS):
        best, is_better = search.look_elsewhere(best)
        if best is None or not is_better:
            return best
    if best is not None and best.verdict is PoseVerdict.VERIFIED:
        return replace(best, verdict=PoseVerdict.NOT_TESTABLE, reason=RESTLESS)
    return best


@dataclass(frozen=True, slots=True, eq=False)
class CameraSearch:
    """One picture, one model and one prior; see :func:`locate_camera`."""

    prior: CameraParameters
    model: Floats
    image: Any
    camera: Camera
    covariance: Floats
    segments_px: Floats
    tolerance_m: float
    tolerance_rad: float
    rng: np.random.Generator

    def look_elsewhere(self, best: CameraFix | None) -> tuple[CameraFix | None, bool]:
        """A better pose, from here or where the model repeats itself; else the same, compared with its rivals."""
        if best is None:
            return None, False
        pose = best.camera_from_world
        other = self.choose(best, self.locate(pose, self.covariance))
        if other is not None and other is not best:
            if not self.is_same(other.camera_from_world, pose):
                return other, True
            best, pose = other, other.camera_from_world
        others, spread = find_self_motions(self.model, self.camera, pose)
        rivals = self.find_rivals(pose, best.evidence.chance, others, spread)
        if rivals and rivals[0].lead < rivals[0].needed:  # and one repetition further, from the likeliest of them
            others, _ = find_self_motions(self.model, self.camera, rivals[0].camera_from_world)
            rivals += self.find_rivals(pose, best.evidence.chance, others, spread)
        for rival in sorted(rivals, key=lambda rival: rival.lead):
            there = self.locate(rival.camera_from_world, spread) if rival.lead < rival.needed else None
            if there is not None and self.is_same(there.camera_from_world, pose):
                continue  # looked at closely, it is this pose
            if there is not None and rival.lead < 0.0:
                return there, True
            best = replace(best, rival=rival)
            if best.verdict is PoseVerdict.VERIFIED and rival.lead < rival.needed:
                away = np.linalg.norm(pose.inverse().translation - rival.camera_from_world.inverse().translation)
                reason = f"a pose {100.0 * away:.0f} cm away explains comparably much"
                best = replace(best, verdict=PoseVerdict.NOT_TESTABLE, reason=reason)
            break
        return best, False

    def find_rivals(self, pose: Pose, chance: float, others: Sequence[Pose], spread: Floats) -> list[AliasRisk]:
        """Which of ``others``, with covariance ``spread`` (6, 6), explain the picture too, the likeliest first.

        ``chance`` is the probability that a line is found at a wrong pose.
        """
        own = self._score(pose, chance)
        best = sorted(others, key=lambda at: -self._score(at, chance).log_likelihood)[:RIVAL_MAX_REFINED]
        needed, rivals = RIVAL_MIN_LEAD + RIVAL_LEAD_PER_LINE * own.count, []
        for other in best:
            near = self._solve(
                self.segments_px, other, spread, (CAMERA_COARSE_PAIR_PX, CAMERA_COARSE_SIGMA_PX), trunc_r_and_t)
            refined = other if near is None else near[0].camera_from_world
            if not self.is_same(other, pose) and not self.is_same(refined, pose):
                rivals += [AliasRisk(at, own.log_likelihood - self._score(at, chance).log_likelihood, needed)
                           for at in (other, refined)]
        return sorted(rivals, key=lambda rival: rival.lead)

    def choose(self, best: CameraFix | None, other: CameraFix | None) -> CameraFix | None:
        """The pose that explains more; not the better covered one: where little is in view, little is amiss."""
        if best is None or other is None:
            return best or other
        chance = max(best.evidence.chance, other.evidence.chance)
        one, two = (self._score(fix.camera_from_world, chance).log_likelihood for fix in (best, other))
        return other if two > one else best

    def _score(self, at: Pose, chance: float) -> PoseScore:
        """How much picture and prior support a pose."""
        found = compute_pose_score(project_leaders(self.model, self.camera, at), self.segments_px, chance)
        step = self.prior.compute_step(at)
        far = min(0.5 * float(step @ self.prior.information @ step), RIVAL_MAX_PRIOR)
        return replace(found, log_likelihood=found.log_likelihood - far)

    def locate(self, prior: Pose, covariance: Floats) -> CameraFix | None:
        """The pose that the picture shows within a prior, with its own verdict."""
        coarse = CAMERA_COARSE_PAIR_PX, CAMERA_COARSE_SIGMA_PX
        fine = CAMERA_FINE_PAIR_PX, CAMERA_FINE_SIGMA_PX
        rough = self._solve(self.segments_px, prior, covariance, coarse, trunc_r_and_t)
        if rough is None:
            return None
        pose = rough[0].camera_from_world
        near = self._find_near(pose)
        solved = self._solve(near, pose, CAMERA_SECOND_PRIOR**2 * covariance, fine, med_r_and_t)
        return None if solved is None else self._judge(self._state_as_seen(*solved, near), solved[1], near)

    def is_same(self, pose: Pose, other: Pose) -> bool:
        """Whether two poses are within the tolerances."""
        apart = float(np.linalg.norm(pose.inverse().translation - other.inverse().translation))
        return apart <= self.tolerance_m and pose.angle_to(other) <= self.tolerance_rad

    def _find_visible(self, pose: Pose) -> Indices:
        """Indices of the model lines that are visible from a pose at some length."""
        px, visible = self.camera.project_segments(self.model, pose)
        length = np.linalg.norm(px[visible, 1] - px[visible, 0], axis=1)
        visible[visible] = length >= MIN_LINE_LENGTH_PX
        return np.flatnonzero(visible)

    def _find_near(self, pose: Pose) -> Floats:
        """(k, 2, 2) edges in bands around the model lines as seen from a pose."""
        shown = self.camera.project_segments(self.model[self._find_visible(pose)], pose)[0]
        if self.image is None:
            return self.segments_px
        found = find_lines(self.image, shown, band_px=CAMERA_BAND_PX)
        return remove_duplicates(found).segments_px

    def _solve(
        self, segments_px: Floats, prior: Pose, covariance: Floats, reach_px: tuple[float, float],
        solver: Callable[..., PoseEstimate],
    ) -> tuple[PoseEstimate, Indices] | None:
        """A robust pose of the matched pairs (p, 2), the fragments of a model line being one landmark.

        ``reach_px``: of the match, the restricted space and the deviation of an end.
        """
        lines = self._find_visible(prior)
        if len(lines) < CAMERA_MIN_PAIRS:
            return None
        pair_px, sigma_px = reach_px
        match = match_in_space(
            self.model[lines], segments_px, self.camera, prior, covariance, pair_px=pair_px,
            sigma_px=sigma_px)
        if len(match.pairs) < CAMERA_MIN_PAIRS:
            return None
        i, k = lines[match.pairs[:, 0]], match.pairs[:, 1]
        estimate = solver(
            self.model[i], segments_px[k], self.camera, match.camera_from_world, landmark_ids=i.tolist(),
            sigma_px=SIGMA_ACROSS_PX, probability=CAMERA_PROBABILITY, rng=self.rng)
        return estimate, np.stack([i, k], axis=1)

    def _judge(self, estimate: PoseEstimate, pairs: Indices, near: Floats) -> CameraFix:
        """The verdict, by the segments of the whole image, which were not searched for at this pose."""
        agreement, coverage = self.measure_agreement(estimate.camera_from_world)
        verdict, reason = self._decide(estimate, agreement, coverage)
        return CameraFix(estimate, pairs, near, agreement, coverage, verdict, reason=reason)

    def measure_agreement(self, pose: Pose) -> tuple[Agreement, float]:
        """Which model lines agree with the picture at a pose, and the covered part of their length."""
        here = project_leaders(self.model, self.camera, pose)
        lengths = np.linalg.norm(here[:, 1] - here[:, 0], axis=1)
        once = self.model[~np.isnan(lengths)]
        displaced = np.array([self.camera.project_segments(once, wrong)[0] for wrong in self._displace(pose)])
        agreement = compute_agreement(here, self.segments_px, displaced)
        return agreement, agreement.covered_length(lengths)

    def _decide(self, estimate: PoseEstimate, agreement: Agreement, coverage: float) -> tuple[PoseVerdict, str]:
        """The verdict by this pose alone, and why it is not verified."""
        best_possible = compute_p_false(agreement.visible, agreement.visible, agreement.chance)
        if agreement.visible < CAMERA_MIN_MATCHED_LINES or best_possible > CAMERA_MAX_P_FALSE:
            return PoseVerdict.NOT_TESTABLE, f"{agreement.visible} lines in view: too few to tell the place by"
        if agreement.matched < CAMERA_MIN_MATCHED_LINES or agreement.p_false > CAMERA_MAX_P_FALSE:
            found = f"{agreement.matched} of {agreement.visible} lines are found; at a wrong place"
            found = f"{found} {agreement.chance:.0%} are"
            if bdtr(agreement.matched, agreement.visible, DETECTION_RATE) > CAMERA_MAX_P_MISSED:
                return PoseVerdict.NOT_TESTABLE, found
            return PoseVerdict.REFUTED, found
        if not estimate.ok:
            return PoseVerdict.NOT_TESTABLE, estimate.reason or ""
        if coverage < CAMERA_MIN_COVERAGE:
            return PoseVerdict.NOT_TESTABLE, f"{coverage:.0%} of the lines' length is found"
        if not self._is_precise(estimate.covariance):
            return PoseVerdict.NOT_TESTABLE, "not precise enough"
        return PoseVerdict.VERIFIED, ""

    def _state_as_seen(self, estimate: PoseEstimate, pairs: Indices, near: Floats) -> PoseEstimate:
        """The estimate with the covariance that the noise of its own residuals gives, and the shared error."""
        kept, sigma_px = estimate.inliers, SIGMA_ACROSS_PX
        squares = (estimate.residuals_px[kept] / sigma_px) ** 2
        if not estimate.ok or squares.size <= 6:
            return estimate
        i, k = pairs[kept].T
        seen = math.sqrt(float(np.sum(squares)) / (squares.size - 6))
        seen_px = sigma_px * max(seen, MIN_NOISE_PART)
        again = r_and_t_ml(
            self.model[i], near[k], self.camera, estimate.camera_from_world, sigma_px=seen_px)
        return replace(estimate, covariance=again.covariance) if again.ok else estimate

    def _is_precise(self, covariance: Floats) -> bool:
        """Whether the worst deviations fit into the tolerances."""
        sigmas = CAMERA_TOLERANCE_SIGMAS
        turn, shift = (float(np.linalg.eigvalsh(covariance[a : a + 3, a : a + 3])[-1]) for a in (0, 3))
        return sigmas * math.sqrt(turn) <= self.tolerance_rad and sigmas * math.sqrt(shift) <= self.tolerance_m

    def _displace(self, pose: Pose) -> list[Pose]:
        """Eighteen wrong poses nearby, turned and shifted: what agrees there agrees by chance."""
        root = CAMERA_DISPLACEMENT_SIGMAS * np.linalg.cholesky(self.covariance)
        steps = [sign * root[:, i] + root[:, j] for i in range(3) for j in range(3, 6) for sign in (1.0, -1.0)]
        return [pose.perturbed(step[:3], step[3:]) for step in steps]


def remove_duplicates(found: LineSegments, offset_px: float = MAX_DUPLICATE_OFFSET_PX) -> LineSegments:
    """Drop segments that repeat a longer one; the others, longest first (non-maximum suppression).

    An edge that lies in the bands of two predictions is found twice. A segment is a repeat if both its ends lie on the
    longer one, within ``offset_px`` across and MAX_DUPLICATE_OVERHANG_PX along, and its brighter side
    is the same.
    """
    ordered = found.take(np.argsort(-found.lengths_px, kind="stable"))
    start, delta = ordered.segments_px[:, 0], ordered.segments_px[:, 1] - ordered.segments_px[:, 0]
    length, overhang = ordered.lengths_px, MAX_DUPLICATE_OVERHANG_PX
    along = delta / length[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    on = np.ones((len(found), len(found)), bool)  # [i, j]: segment j lies on segment i
    for end in (0, 1):
        places = ordered.segments_px[:, end].T
        t, o = (axis @ places - np.sum(axis * start, axis=1)[:, None] for axis in (along, across))
        on &= (np.abs(o) <= offset_px) & (t >= -overhang) & (t <= length[:, None] + overhang)
    bright_right = along * np.sign(ordered.contrast)[:, None]
    on &= bright_right @ bright_right.T > 0.0
    return ordered.take(~np.any(np.triu(on, 1), axis=0))
