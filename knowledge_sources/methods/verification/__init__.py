"""Is the robot at this pose? Evidence from a picture, and the probability that the pose is wrong.

In reading order:

* :mod:`line_check`: the model lines that should be visible from a pose, how many of them segments cover, against how
  many would be covered by chance (a contrario); and how precise a pose from these lines would be.
* :mod:`predicted_colors`: the faces that should be visible, and their colors.
* :mod:`color_check`: whether the faces in view have the model's colors, relative to each other.
* :mod:`pose_confidence`: both checks, and the distance from the belief, as eight numbers; logistic regression of these
  to the probability of a wrong pose (``verification_weights.toml``, fitted by ``harvey experiment
  milestones-calibrate``).
* :mod:`weigh`: all of it for one picture of a milestone, and the verdict by that place alone.
"""

from knowledge_sources.methods.verification.color_check import check_colors, predict_color_check
from knowledge_sources.methods.verification.line_check import (
    Agreement, DISPLACEMENT_M, LINE_INDEPENDENCE, LINE_TOLERANCE_PX, LINE_TOLERANCE_RAD, MAX_LINE_WEIGHT_PX,
    MIN_COVERED_FRACTION, MIN_MATCHED_LINES, check_lines, compute_agreement, compute_coverage, compute_log_ratio,
    compute_p_false, compute_p_share, compute_view_quality, find_distinct, find_errors, find_tolerances_px, list_names,
    predict_lines, take_distinct,
)
from knowledge_sources.methods.verification.pose_confidence import (
    EVIDENCE_NAMES, EvidenceWeights, MOTION_TOLERANCE_SIGMAS, POSE_CONFIDENCE, PoseConfidence, PoseEvidence, TERMS,
    WEIGHTS_FILE, compute_evidence, compute_terms,
)
from knowledge_sources.methods.verification.predicted_colors import RAYS, cast_rays, predict_face_colors
from knowledge_sources.methods.verification.view_quality import (
    CHECK_TOLERANCE_M, LOOK_TURNS_RAD, MAX_SIGMA_PART, MAX_SIGMA_RAD, MIN_LINES, choose_heading, find_untried,
    list_seen_locales, predict_milestone, turn_headings,
)
from knowledge_sources.methods.verification.weigh import (
    Before, MAX_FOLLOWED_PX, MAX_INEXACT_LOOKS, MAX_MILESTONE_LOOKS, P_WRONG_FOLLOWED, P_WRONG_IN_DOUBT,
    P_WRONG_STANDING, P_WRONG_UNFOLLOWED, PictureEvidence, Verdict, Weighed, certify, compute_coverage_elsewhere,
    is_last_look, judge_place, tell_odds, weigh_picture,
)

__all__ = [
    "CHECK_TOLERANCE_M", "DISPLACEMENT_M", "EVIDENCE_NAMES", "LINE_INDEPENDENCE", "LINE_TOLERANCE_PX",
    "LINE_TOLERANCE_RAD", "LOOK_TURNS_RAD", "MAX_FOLLOWED_PX", "MAX_INEXACT_LOOKS", "MAX_LINE_WEIGHT_PX",
    "MAX_MILESTONE_LOOKS",
    "MAX_SIGMA_PART", "MAX_SIGMA_RAD", "MIN_COVERED_FRACTION", "MIN_LINES", "MIN_MATCHED_LINES",
    "MOTION_TOLERANCE_SIGMAS", "POSE_CONFIDENCE", "P_WRONG_FOLLOWED", "P_WRONG_IN_DOUBT", "P_WRONG_STANDING",
    "P_WRONG_UNFOLLOWED", "RAYS", "TERMS", "WEIGHTS_FILE", "Agreement", "Before", "EvidenceWeights",
    "PictureEvidence", "PoseConfidence", "PoseEvidence", "Verdict", "Weighed", "cast_rays", "certify",
    "check_colors", "check_lines", "choose_heading", "compute_agreement", "compute_coverage",
    "compute_coverage_elsewhere", "compute_evidence", "compute_log_ratio", "compute_p_false", "compute_p_share",
    "compute_terms", "compute_view_quality", "find_distinct", "find_errors", "find_tolerances_px",
    "find_untried", "is_last_look", "judge_place", "list_names", "list_seen_locales", "predict_color_check",
    "predict_face_colors", "predict_lines", "predict_milestone", "take_distinct", "tell_odds", "turn_headings",
    "weigh_picture",
]
