"""Settings of line matching (§6.1)."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_sources.settings.setting import setting


@dataclass(frozen=True, slots=True)
class MatchingSettings:
    """The numbers of line matching (§6.1)."""

    # The search, in the image or with a pose
    objective: str = setting(
        "likelihood", "name", "Match error in the image: likelihood, or paper (E_match).", "§6.1.3, experiment matcher",
        choices=("likelihood", "paper"))
    strategy: str = setting(
        "steepest", "name", "Local search in the image: steepest descent, or first improvement (paper).", "§6.1.1",
        choices=("steepest", "first"))
    exchange: bool = setting(
        True, "yes/no", "Whether two data lines of a model line may be exchanged at a local minimum (paper: no).",
        "§6.1.1, experiment matcher")
    with_scale: bool = setting(False, "yes/no", "Whether the fit in the image has a scale.", "§6.1.2")
    coverage_cells: int = setting(
        48, "count", "Cells along a model line by which its coverage is counted.", "engineering judgement")
    min_gain: float = setting(1e-9, "1", "A move must lower the match error by more than this.", "rounding")
    max_moves_per_pair: int = setting(
        4, "count", "The search stops after this many moves for each possible pair.", "engineering judgement")

    # The two objectives
    omission_alpha: float = setting(0.5, "1", "Weight of the omission error, paper.", "§6.1.3, alpha")
    omission_beta: float = setting(4.0, "1", "Exponent of the omission error, paper.", "§6.1.3, beta")
    chance_exponent: float = setting(
        3.0, "1", "How fast clutter along a model line becomes rarer with its length, likelihood.",
        "engineering judgement")
    chance_length_px: float = setting(
        10.0, "px", "Length from which clutter along a model line is rare, likelihood.", "engineering judgement")

    # In the image
    max_pair_px: float = setting(
        4.0, "px", "Largest distance of a data end from its model line in the image.",
        "§6.1.4 says 3 px; wider for perspective")
    max_pair_rad: float = setting(0.3, "rad", "Largest angle between a data line and its model line.", "§6.1.4")
    pair_sigmas: float = setting(
        3.0, "1", "Standard deviations of a data end in that largest distance, likelihood.", "engineering judgement")
    min_sigma_px: float = setting(
        1.0, "px", "Smallest standard deviation of a data end, likelihood.", "engineering judgement")
    min_start_error_px: float = setting(
        3.0, "px", "Smallest error of a start that the likelihood assumes.", "engineering judgement")

    # Starts in the image: a generalised Hough transform
    max_starts: int = setting(3, "count", "Placements that are searched (paper: 1).", "§6.1.4, experiment matcher")
    hough_window_px: float = setting(30.0, "px", "Largest shift of the model.", "§6.1.4")
    hough_window_rad: float = setting(0.3, "rad", "Largest turn of the model.", "§6.1.4")
    hough_step_rad: float = setting(0.03, "rad", "Turn between two planes of the accumulator.", "engineering judgement")
    hough_cells: int = setting(
        33, "count", "Cells along each of the accumulator's two axes of shift.", "engineering judgement")
    hough_peaks_per_start: int = setting(
        4, "count", "Peaks that are refined for each placement that is searched.", "engineering judgement")
    start_widths_px: tuple[float, ...] = setting(
        (8.0, 6.0, 4.0, 3.0, 2.0, 1.5), "px", "Widths of the loss by which a peak is refined.",
        "engineering judgement")

    # With a pose: the restricted space
    max_pose_pair_px: float = setting(
        5.0, "px", "Largest distance of a data end from its model line at a pose.", "engineering judgement")
    max_pose_pair_rad: float = setting(
        0.15, "rad", "Largest angle between a data line and its model line at a pose.", "engineering judgement")
    pose_sigma_px: float = setting(
        1.5, "px", "Standard deviation of a data end across its model line.", "engineering judgement")

    # With a pose: the pairs that the prior allows
    gate_sigmas: float = setting(
        3.0, "1", "Deviations of the prior within which a pair must lie.", "engineering judgement")
    gate_px: float = setting(3.0, "px", "And the segment's own error across its line.", "engineering judgement")
    gate_rad: float = setting(0.12, "rad", "And the segment's own error in direction.", "engineering judgement")
    gate_along_px: float = setting(
        30.0, "px", "How far beyond a model line's end a segment may lie besides.", "engineering judgement")
    max_gate_rad: float = setting(
        0.6, "rad", "Pairs that differ more in direction are never looked at.", "engineering judgement")
    max_allowed_pairs: int = setting(
        60000, "count", "Most pairs that are looked at; of more, each model line's longest.", "experiment matcher")
    max_start_pairs: int = setting(
        12000, "count", "Most pairs that the starts are refined with; of more, each model line's longest.",
        "experiment matcher")
    max_near_pairs: int = setting(
        2500, "count", "Most pairs near a pose that are searched; of more, each model line's longest.",
        "experiment matcher")

    # With a pose: starts
    grid_sigmas: float = setting(
        2.0, "1", "Deviations to either side of a prior on the floor that starts reach.", "engineering judgement")
    grid_px: float = setting(
        20.0, "px", "Distance of two such starts in the image, so that the loss draws what lies between to one.",
        "engineering judgement")
    max_grid_steps: int = setting(
        3, "count", "Most starts to either side of an axis.", "engineering judgement")
    space_starts: int = setting(
        128, "count", "Starts spread over a prior with six unknowns, besides the prior itself.",
        "engineering judgement")
    floor_widths_px: tuple[float, ...] = setting(
        (16.0, 12.0, 8.0), "px", "Widths of the loss by which starts on the floor are refined, to first order.",
        "engineering judgement")
    space_widths_px: tuple[float, ...] = setting(
        (16.0, 12.0, 8.0, 6.0), "px", "The same with six unknowns.", "engineering judgement")
    last_widths_px: tuple[float, ...] = setting(
        (6.0, 4.0, 3.0, 2.0), "px", "Widths by which the best of them are refined at their own poses.",
        "engineering judgement")
    max_width_ratio: float = setting(
        5.0, "1", "Pairs further than this many widths (root mean square) do not pull.", "engineering judgement")
    max_refined_pair_px: float = setting(
        40.0, "px", "Pairs further than this from a pose are left out when it is refined.", "engineering judgement")
    unit_length_px: float = setting(
        20.0, "px", "A pair of this length weighs like one measurement.", "engineering judgement")
    max_beside_px: float = setting(
        20.0, "px", "A data line further than this beyond a model line's end supports nothing.",
        "engineering judgement")
    pose_finalists: int = setting(8, "count", "Starts that are refined at their own poses.", "engineering judgement")
    max_pose_starts: int = setting(4, "count", "Poses that are searched from.", "engineering judgement")
    min_pose_difference_sigmas: float = setting(
        0.05, "1", "Poses nearer to each other than this, in the prior's deviations, are one.",
        "engineering judgement")


PAPER_MATCHING = MatchingSettings(
    objective="paper", strategy="first", exchange=False, max_starts=1, max_pair_px=3.0
)
"""The paper's own way (§6.1): its match error, first improvement, no exchanges, one start."""
