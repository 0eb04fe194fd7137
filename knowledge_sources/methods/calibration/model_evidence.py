"""What a picture says of the model's exactness: evidence for each of the rivals that would explain it."""

from __future__ import annotations

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.calibration.camera_state import compute_first_covariance, compute_least_covariance
from knowledge_sources.methods.pose import FOCAL, HEIGHT, Given, JointFit, fit_rivals
from world_models.building.model_errors import INEXACT_M, LineErrors
from world_models.entries import CameraState, Evidence, Explanation
from world_models.entries.difference import MODEL, RivalKind
from world_models.frames import Pose2

MAX_LOG_RATIO = 4.6
"""Most that one picture says for one rival: one in a hundred is matched to other lines altogether."""
MIN_STRANGE = 1.0
"""A picture is worth telling where another rival explains it so much better than chance."""
APART_M, APART_RAD = 1.0, float(np.radians(20.0))
"""Pictures from so far apart show other lines, or the same ones otherwise."""


def find_model_evidence(
    lines_world: Floats, segments_px: Floats, errors: LineErrors, camera: CameraState, belief: Pose2,
    covariance: Floats, seen_s: float,
) -> Evidence:
    """What matched lines (n, 2, 3) [m] and segments (n, 2, 2) say for a wrong model, a wrong camera, or neither.

    Every picture is weighed from the camera as it was set up: what was learnt of it before may be the model's error.
    """
    nominal = camera.as_nominal()
    given = Given(lines_world, segments_px, nominal.pinhole, nominal.mount, belief, covariance)
    fits = fit_rivals(given, compute_first_covariance(nominal), compute_least_covariance(), errors)
    best = max(fit.log_likelihood for fit in fits.values())
    told = tuple(_explain(kind, fit, max(fit.log_likelihood - best + MAX_LOG_RATIO, 0.0)) for kind, fit in fits.items())
    shows = f"{int(fits['wall'].near.sum())} of {len(lines_world)} lines where they would be"
    return Evidence(MODEL, shows, told, belief.x_m, belief.y_m, belief.heading_rad, APART_M, APART_RAD, seen_s)


def is_strange(evidence: Evidence) -> bool:
    """Whether chance explains it clearly less well than something else."""
    ratios = {e.kind: e.log_ratio for e in evidence.explanations}
    return max(ratios.values()) - ratios["chance"] > MIN_STRANGE


def _explain(kind: RivalKind, fit: JointFit, log_ratio: float) -> Explanation:
    if kind == "wall":
        elsewhere = f"walls and doors some {100.0 * INEXACT_M:.0f} cm elsewhere"
        return Explanation(kind, elsewhere, log_ratio, 0.0, INEXACT_M)
    if kind == "chance":
        return Explanation(kind, "what is measured, by chance", log_ratio)
    is_lens = kind == "focal length"
    off, sigma = (float(v[FOCAL if is_lens else HEIGHT]) for v in (fit.state, fit.sigmas))
    words = f"a focal length {100.0 * off:+.1f}% otherwise" if is_lens else f"a camera {100.0 * off:+.1f} cm higher"
    return Explanation(kind, words, log_ratio, off, sigma)
