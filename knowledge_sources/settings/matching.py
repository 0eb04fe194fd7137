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
    min_gain: float = setting(1e-9, "1", "A move must lower the match error by more than this.", "rounding")

    # The two objectives
    chance_exponent: float = setting(
        3.0, "1", "How fast clutter along a model line becomes rarer with its length, likelihood.",
        "engineering judgement")
    chance_length_px: float = setting(
        10.0, "px", "Length from which clutter along a model line is rare, likelihood.", "engineering judgement")

    # In the image
    max_pair_px: float = setting(
        4.0, "px", "Largest distance of a data end from its model line in the image.",
        "§6.1.4 says 3 px; wider for perspective")
    pair_sigmas: float = setting(
        3.0, "1", "Standard deviations of a data end in that largest distance, likelihood.", "engineering judgement")

    # Starts in the image: a generalised Hough transform
    max_starts: int = setting(3, "count", "Placements that are searched (paper: 1).", "§6.1.4, experiment matcher")
    hough_window_px: float = setting(30.0, "px", "Largest shift of the model.", "§6.1.4")
    hough_step_rad: float = setting(0.03, "rad", "Turn between two planes of the accumulator.", "engineering judgement")
    hough_cells: int = setting(
        33, "count", "Cells along each of the accumulator's two axes of shift.", "engineering judgement")

    # With a pose: the pairs that the prior allows
    max_allowed_pairs: int = setting(
        60000, "count", "Most pairs that are looked at; of more, each model line's longest.", "experiment matcher")
    max_start_pairs: int = setting(
        12000, "count", "Most pairs that the starts are refined with; of more, each model line's longest.",
        "experiment matcher")
    max_near_pairs: int = setting(
        2500, "count", "Most pairs near a pose that are searched; of more, each model line's longest.",
        "experiment matcher")


PAPER_MATCHING = MatchingSettings(
    objective="paper", strategy="first", exchange=False, max_starts=1, max_pair_px=3.0
)
"""The paper's own way (§6.1): its match error, first improvement, no exchanges, one start."""
