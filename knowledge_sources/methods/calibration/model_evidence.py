"""What a picture says of the model's exactness: evidence for each of the rivals that would explain it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from knowledge_sources.methods.arrays import Floats
from knowledge_sources.methods.belief import weigh_rivals
from knowledge_sources.methods.calibration.camera_state import compute_first_covariance, compute_least_covariance
from knowledge_sources.methods.pose import CameraEstimate, estimate_camera_and_pose
from knowledge_sources.methods.pose.solution_separation import LINE_SIGMA_PX
from world_models.building.model_errors import INEXACT_M, MEASURED_M, LineErrors
from world_models.camera import CAMERA_UNKNOWNS
from world_models.entries import CameraState, Evidence, Explanation
from world_models.entries.difference import MODEL, RivalKind
from world_models.frames import Pose2

HEIGHT, FOCAL = (CAMERA_UNKNOWNS.index(name) for name in ("height_m", "focal"))
IS_OF_LENS = np.equal.outer(np.arange(len(CAMERA_UNKNOWNS)) >= FOCAL, [True] * len(CAMERA_UNKNOWNS))
"""(7, 7) of a diagonal covariance what is the lens's."""
MAX_LOG_RATIO = 4.6
"""Most that one picture says for one rival: one in a hundred is matched to other lines altogether."""
MIN_STRANGE = 1.0
"""A picture is worth telling where another rival explains it so much better than chance."""
MIN_P_DOUBTED = 0.5  # from here on a pose is solved for with a model that is inexact
APART_M, APART_RAD = 1.0, float(np.radians(20.0))
"""Pictures from so far apart show other lines, or the same ones otherwise."""


def find_model_evidence(
    lines_world: Floats, segments_px: Floats, errors: LineErrors, camera: CameraState, belief: Pose2,
    covariance: Floats, seen_s: float, about: str = MODEL,
) -> Evidence:
    """What matched lines (n, 2, 3) [m] and segments (n, 2, 2) say for a wrong model, a wrong camera, or neither.

    Every picture is weighed from the camera as it was set up: what was learnt of it before may be the model's error.
    A camera that is mounted otherwise may have another lens too: it was taken for another one. Doors may stand beside
    with each of them: of each door that is a difference of its own.
    """
    as_set_up = camera.as_nominal()
    fit = partial(estimate_camera_and_pose, lines_world, segments_px, as_set_up.pinhole, as_set_up.mount, belief,
                  covariance, sigma_px=LINE_SIGMA_PX)
    nominal, opened = compute_least_covariance(), compute_first_covariance(as_set_up)
    fine, coarse = (errors.restate(sigma_m).restate_doors(INEXACT_M) for sigma_m in (MEASURED_M, INEXACT_M))
    freest = (fit(opened, errors=coarse).world_from_robot,)
    lens = np.where(IS_OF_LENS, opened, nominal)
    fits: dict[RivalKind, CameraEstimate] = {
        "chance": fit(nominal, errors=fine, starts=freest), "wall": fit(nominal, errors=coarse, starts=freest),
        "focal length": fit(lens, errors=fine, starts=freest), "mounting": fit(opened, errors=fine, starts=freest)}
    best = max(found.log_likelihood for found in fits.values())
    told = tuple(_explain(kind, found, max(found.log_likelihood - best + MAX_LOG_RATIO, 0.0))
                 for kind, found in fits.items())
    shows = f"{int(fits['wall'].inliers.sum())} of {len(lines_world)} lines where they would be"
    return Evidence(about, shows, told, belief.x_m, belief.y_m, belief.heading_rad, APART_M, APART_RAD, seen_s)


def is_strange(evidence: Evidence) -> bool:
    """Whether chance explains it clearly less well than something else."""
    ratios = {e.kind: e.log_ratio for e in evidence.explanations}
    return max(ratios.values()) - ratios["chance"] > MIN_STRANGE


def is_model_doubted(evidence: Sequence[Evidence]) -> bool:
    """Whether the model is inexact more probably than not, so that a pose is solved for as if it were."""
    wall = weigh_rivals(MODEL, evidence).find("wall")
    return wall is not None and wall.p > MIN_P_DOUBTED


def _explain(kind: RivalKind, found: CameraEstimate, log_ratio: float) -> Explanation:
    if kind == "wall":
        elsewhere = f"walls and doors some {100.0 * INEXACT_M:.0f} cm elsewhere"
        return Explanation(kind, elsewhere, log_ratio, 0.0, INEXACT_M)
    if kind == "chance":
        return Explanation(kind, "what is measured, by chance", log_ratio)
    unknown = FOCAL if kind == "focal length" else HEIGHT
    off, sigma = float(found.step[unknown]), float(np.sqrt(found.covariance[unknown, unknown]))
    what = "a focal length {:+.1f}% otherwise" if unknown == FOCAL else "a camera mounted otherwise, {:+.1f} cm higher"
    return Explanation(kind, what.format(100.0 * off), log_ratio, off, sigma)
