"""Where is the camera, given model lines and the image segments matched to them (§6.2)?

Every solver takes ``(model_lines_world (n, 2, 3), segments_px (n, 2, 2), camera, prior, *, landmark_ids, sigma_px)``,
``prior`` being a guess of ``camera_from_world``, and gives a :class:`PoseEstimate`:

* :func:`r_then_t`       rotation first, then translation (Liu et al., §6.2.1): the paper's baseline.
* :func:`r_and_t`        both at once (E1 or E2, §6.2.2): the wide basin.
* :func:`r_and_t_ml`     E1 to get there, image distances in pixels to finish: the smallest error.
* :func:`med_r_and_t`    least median of squares over 3-line or 3-landmark subsets (§6.2.4): to 45 % outliers.
* :func:`trunc_r_and_t`  a truncated loss over the same subsets: beyond 50 % outliers.

On the floor, with a known mount: :func:`planar_from_lines` and :func:`planar_from_points`.
"""

from knowledge_sources.methods.pose.estimate import PlanarEstimate, PoseEstimate
from knowledge_sources.methods.pose.med_r_and_t import med_r_and_t
from knowledge_sources.methods.pose.planar_from_lines import planar_from_lines
from knowledge_sources.methods.pose.planar_from_points import planar_from_points
from knowledge_sources.methods.pose.r_and_t import r_and_t
from knowledge_sources.methods.pose.r_and_t_ml import r_and_t_ml
from knowledge_sources.methods.pose.r_then_t import r_then_t
from knowledge_sources.methods.pose.trunc_r_and_t import trunc_r_and_t

__all__ = [
    "PlanarEstimate",
    "PoseEstimate",
    "med_r_and_t",
    "planar_from_lines",
    "planar_from_points",
    "r_and_t",
    "r_and_t_ml",
    "r_then_t",
    "trunc_r_and_t",
]
