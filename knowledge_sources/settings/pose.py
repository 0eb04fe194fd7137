"""Settings of the pose solvers (§6.2)."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_sources.settings.setting import setting


@dataclass(frozen=True, slots=True)
class PoseSettings:
    """The numbers of the pose solvers (§6.2)."""

    # All solvers
    max_iterations: int = setting(
        30, "count", "Levenberg-Marquardt steps for the six unknowns of a camera.", "engineering judgement")
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
    weak_rotation_rad: float = setting(
        0.3, "rad", "Standard deviation of a camera's rotation where none is given.", "engineering judgement")
    weak_translation_m: float = setting(
        3.0, "m", "Standard deviation of a camera's translation where none is given.", "engineering judgement")
    weak_position_m: float = setting(
        1.0, "m", "Standard deviation of a robot's position where none is given.", "engineering judgement")
    weak_heading_rad: float = setting(
        0.3, "rad", "Standard deviation of a robot's heading where none is given.", "engineering judgement")
    max_chi2_sigmas: float = setting(
        3.0, "1", "How far a sum of squares may exceed its mean where a pose explains its lines, in deviations.",
        "Morozov's discrepancy principle")
    max_prior_weight_log10: float = setting(
        10.0, "1", "Largest weight of a weak prior that is tried, as a power of ten.", "engineering judgement")
    prior_weight_step_log10: float = setting(
        0.1, "1", "How closely the weight of a weak prior is found, as a power of ten.", "engineering judgement")

    # Subsets of three lines or landmarks
    subset_iterations: int = setting(4, "count", "Gauss-Newton steps on a subset.", "§6.2.4")
    concentration_rounds: int = setting(
        3, "count", "How often the best candidates are solved again on the lines that fit them best.",
        "Rousseeuw's concentration steps")
    concentration_iterations: int = setting(
        2, "count", "Gauss-Newton steps in each of these rounds.", "engineering judgement")
    max_refinements: int = setting(
        6, "count", "Rounds in which inliers and pose may still change each other.", "§6.2.4, steps 3 and 4")

    # Med R and T: least median of squares
    max_outlier_part: float = setting(
        0.45, "1", "Share of wrong lines up to which the median is to hold.", "§6.2.4, Table 3", most=0.49)
    med_drawn_outlier_part: float = setting(
        0.5, "1", "Share of wrong lines for which enough subsets are drawn.", "§6.2.4")
    med_candidates: int = setting(
        16, "count", "Candidates of least median that are solved again.", "engineering judgement")
    min_noise_part: float = setting(
        0.3, "1", "Smallest estimate of the noise, in parts of the stated one.", "engineering judgement")

    # Trunc R and T: truncated loss
    trunc_drawn_outlier_part: float = setting(
        0.7, "1", "Share of wrong lines for which enough subsets are drawn.", "experiment table3")
    trunc_candidates: int = setting(
        24, "count", "Candidates of least loss that are solved again.", "engineering judgement")
    trunc_inlier_part: float = setting(
        0.35, "1", "Share of the lines that they are solved again on.", "engineering judgement")
    trunc_finalists: int = setting(
        5, "count", "Candidates that are refined before one is chosen.", "engineering judgement")
    trunc_rounds: int = setting(
        6, "count", "Rounds of inliers and pose in that refinement.", "engineering judgement")

    # A robot on the floor, from lines
    max_floor_iterations: int = setting(
        20, "count", "Levenberg-Marquardt steps for the three unknowns of a robot.", "engineering judgement")
    floor_start_iterations: int = setting(
        8, "count", "Levenberg-Marquardt steps on all lines, for a first candidate.", "engineering judgement")
    floor_subset_lines: int = setting(
        28, "count", "Pairs are formed of this many of the longest segments.", "engineering judgement")
    floor_pair_iterations: int = setting(4, "count", "Gauss-Newton steps on each pair.", "engineering judgement")
    max_floor_step_m: float = setting(
        2.0, "m", "Largest move in one Gauss-Newton step: beyond it a pair is nearly degenerate.",
        "engineering judgement")
    max_floor_step_rad: float = setting(0.5, "rad", "Largest turn in one such step.", "engineering judgement")
    floor_finalists: int = setting(
        8, "count", "Candidates that are refined before one is chosen.", "engineering judgement")
    floor_widenings: tuple[float, ...] = setting(
        (4.0, 2.0, 1.0, 1.0), "1", "Factors on the squared bound on inliers in that refinement, round by round.",
        "engineering judgement")
    max_floor_rounds: int = setting(
        8, "count", "Rounds in which inliers and pose may still change each other.", "engineering judgement")
    max_few_lines: int = setting(
        3, "count", "So few lines move a prior of unknown worth only as far as their noise demands.",
        "engineering judgement")
    min_scatter_freedom: int = setting(
        6, "count", "Degrees of freedom from which a larger scatter of the inliers widens the covariance.",
        "engineering judgement")
    max_scatter: float = setting(
        16.0, "1", "Largest ratio of the noise's variance to the stated one that is told from the inliers' scatter.",
        "engineering judgement: four times the noise; then the cut on inliers hides the rest")

    # A robot on the floor, from points
    huber_sigmas: float = setting(
        1.5, "1", "Deviation beyond which a point pulls with a constant force (Huber).", "engineering judgement")
    point_outlier_sigmas: float = setting(
        4.0, "1", "A point further than this many standard deviations off is an outlier.", "engineering judgement")
    max_point_rounds: int = setting(
        6, "count", "Rounds in which inliers and pose may still change each other.", "engineering judgement")

    # Lines of a model that is inexact
    shared_prior_factor: float = setting(
        3.0, "1", "A prior of the same model is loosened by so many times what the model's errors make uncertain.",
        "engineering judgement")
    marginal_spread: float = setting(
        1.4, "1", "Factor on the standard deviations of such a pose, for segments matched to a wrong line nearby.",
        "engineering judgement, after a few poses on generated floors")
    max_marginal_rounds: int = setting(
        12, "count", "Rounds in which lines that do not agree are left out.", "engineering judgement")
    max_marginal_steps: int = setting(8, "count", "Steps of Gauss-Newton in each of them.", "engineering judgement")
    min_marginal_step: float = setting(1e-7, "1", "Step [m, rad] at which these end.", "convergence")
    displaced_widths_px: tuple[float, ...] = setting(
        (12.0, 8.0, 5.0, 3.0, 2.0, 1.5), "px", "Widths of the loss by which displacements of the model are fitted.",
        "engineering judgement")
    displaced_width_sigmas: float = setting(
        2.0, "1", "Widest of these, in standard deviations of the lines in the picture.", "engineering judgement")
    displaced_steps: int = setting(2, "count", "Steps of that fit at each width.", "engineering judgement")
    displaced_gate_sigmas: float = setting(
        2.5, "1", "Deviations of belief and model within which a segment may belong to a line.",
        "engineering judgement")
    displaced_gate_px: float = setting(
        3.0, "px", "And the segment's own error across its line.", "engineering judgement")
    displaced_gate_rad: float = setting(
        0.15, "rad", "And the segment's own error in direction.", "engineering judgement")
    displaced_pair_px: float = setting(
        2.5, "px", "Largest distance of a segment from its line, once that is displaced.", "engineering judgement")
    displaced_unit_px: float = setting(
        20.0, "px", "A segment of this length weighs like one measurement.", "engineering judgement")
