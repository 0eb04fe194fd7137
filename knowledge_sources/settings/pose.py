"""Settings of the pose solvers (§6.2)."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_sources.settings.setting import setting


@dataclass(frozen=True, slots=True)
class PoseSettings:
    """The numbers of the pose solvers (§6.2)."""

    # All solvers
    max_beside_px: float = setting(
        5.0, "px", "How far beyond the end of its model line an observed segment may lie.", "engineering judgement")
    outlier_sigmas: float = setting(
        3.0, "1", "A line further than this many standard deviations from its model line is an outlier.", "§6.2.4")
    max_residual_sigmas: float = setting(
        1.5, "1", "Lines whose noise is this many times the stated one no longer decide a pose (of six unknowns).",
        "experiment covariance")
    shared_px: float = setting(
        0.3, "px", "Error shared by all lines of a picture: of calibration and survey (six unknowns).",
        "engineering judgement, experiment covariance")

    # A prior without a covariance
    max_chi2_sigmas: float = setting(
        3.0, "1", "How far a sum of squares may exceed its mean where a pose explains its lines, in deviations.",
        "Morozov's discrepancy principle")

    # A robot on the floor, from lines
    floor_widenings: tuple[float, ...] = setting(
        (4.0, 2.0, 1.0, 1.0), "1", "Factors on the squared bound on inliers in that refinement, round by round.",
        "engineering judgement")

    # A robot on the floor, from points
    point_outlier_sigmas: float = setting(
        4.0, "1", "A point further than this many standard deviations off is an outlier.", "engineering judgement")

    # Lines of a model that is inexact
    shared_prior_factor: float = setting(
        3.0, "1", "A prior of the same model is loosened by so many times what the model's errors make uncertain.",
        "engineering judgement")
    marginal_spread: float = setting(
        1.4, "1", "Factor on the standard deviations of such a pose, for segments matched to a wrong line nearby.",
        "engineering judgement, after a few poses on generated floors")
    displaced_widths_px: tuple[float, ...] = setting(
        (12.0, 8.0, 5.0, 3.0, 2.0, 1.5), "px", "Widths of the loss by which displacements of the model are fitted.",
        "engineering judgement")
    displaced_steps: int = setting(2, "count", "Steps of that fit at each width.", "engineering judgement")
    displaced_pair_px: float = setting(
        2.5, "px", "Largest distance of a segment from its line, once that is displaced.", "engineering judgement")
    displaced_unit_px: float = setting(
        20.0, "px", "A segment of this length weighs like one measurement.", "engineering judgement")
