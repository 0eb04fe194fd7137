"""Settings of the knowledge sources of the plan level (§4, §6)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from knowledge_sources.settings.setting import setting


@dataclass(frozen=True, slots=True)
class PlanSettings:
    """The numbers of the knowledge sources of the plan level (§4, §6)."""

    # Tolerance of the plan level
    max_deviation_px: float = setting(
        30.0, "px", "Bound of the plan level: how far the matcher looks for what is expected.", "§6.1.4")

    # Sketcher
    clearances_m: tuple[float, ...] = setting(
        (0.12, 0.06, 0.03), "m", "Margins round the robot's disc, tried in this order; the last must always be kept.",
        "engineering judgement")
    overhang_m: float = setting(
        0.15, "m", "So much wider than its feet something that the model lacks may be: where there is room, the way is"
        " led so much farther round it, and nearer to it the robot creeps.", "engineering judgement")
    max_lookouts: int = setting(
        6, "count", "So often the robot looks again, from elsewhere, at what leaves no way; then it is blocked.",
        "engineering judgement")
    max_leg_m: float = setting(
        3.6, "m", "Longest leg without a milestone in between.", "engineering judgement")
    max_adjustments: int = setting(
        8, "count", "So often a sketch is adjusted at one milestone; then that was in vain.", "engineering judgement")

    # Escalator
    max_checks_per_subgoal: int = setting(
        20, "count", "So often the action level may ask the plan level on the way to one subgoal; then it is blocked.",
        "engineering judgement")
    max_lost_per_mission: int = setting(
        12, "count", "So often the robot may be lost in one mission.", "engineering judgement")

    # Milestone selector
    max_lines: int = setting(
        60, "count", "Most lines that one milestone expects.", "engineering judgement")
    long_turn_rad: float = setting(
        math.radians(100.0), "rad", "Before a leg that begins with a longer turn the robot turns first, then looks: few"
        " landmarks are followed as it turns about.", "engineering judgement")
    look_turns_rad: tuple[float, ...] = setting(
        tuple(math.radians(a) for a in (30, -30, 60, -60, 90, -90, 135, -135, 180)), "rad",
        "Turns from the present heading that are tried for a better view, in this order.", "engineering judgement")

    # Obstruction finder
    max_obstruction_looks: int = setting(
        6, "count", "Number of last looks that are compared.", "engineering judgement", most=8)

    # Milestone judge
    p_wrong_followed: float = setting(
        0.05, "1", "Prior probability of a wrong belief where landmarks were followed up to here.",
        "engineering judgement")
    max_followed_px: float = setting(
        15.0, "px", "Where the belief leaves more than this open in the picture, followed landmarks tell of no place.",
        "half of max_deviation_px")
    p_wrong_unfollowed: float = setting(
        0.12, "1", "The same where no landmarks were followed.", "engineering judgement")
    p_wrong_in_doubt: float = setting(
        0.5, "1", "The same where the belief is in doubt.", "engineering judgement")
    min_contrast: float = setting(
        6.0, "grey levels", "A frame of less contrast (standard deviation of its grey values, 0 to 255) is dark.",
        "engineering judgement")
    max_looks: int = setting(
        3, "count", "A milestone is looked for from so many directions before it counts as a discrepancy.",
        "engineering judgement")
    max_inexact_looks: int = setting(
        5, "count", "The same where the model is inexact: each look tells less.", "engineering judgement")
    max_told: float = setting(
        3.0, "1", "Most that one look counts for or against a place, in log odds, with those in other directions.",
        "engineering judgement")
