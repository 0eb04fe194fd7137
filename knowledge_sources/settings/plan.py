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
    doorway_distances_m: tuple[float, ...] = setting(
        (0.65, 0.55, 0.47, 0.40), "m",
        "Distances from a doorway at which it is approached straight, tried in this order.", "engineering judgement")
    doorway_offsets_m: tuple[float, ...] = setting(
        (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6), "m",
        "Distances from its middle, to either side, at which it is approached aslant, past what stands before it.",
        "engineering judgement")
    max_lookouts: int = setting(
        6, "count", "So often the robot looks again, from elsewhere, at what leaves no way; then it is blocked.",
        "engineering judgement")
    lookout_distances_m: tuple[float, ...] = setting(
        (1.8, 2.4, 3.0), "m", "Distances from which it does so: the floor before it is in the picture.",
        "engineering judgement")
    lookout_directions: int = setting(
        24, "count", "Directions round it from which that is tried.", "engineering judgement")
    lookout_short_m: float = setting(
        0.4, "m", "So near before it something else may be in the line of sight: it may be a part of it.",
        "engineering judgement")
    lookout_same_side_m: float = setting(
        3.0, "m", "So much farther another side of it may be than the one from which it was seen last.",
        "engineering judgement")
    min_lookout_change_m: float = setting(
        0.4, "m", "A place nearer than this to where the robot stands shows nothing new.", "engineering judgement")
    max_leg_m: float = setting(
        3.6, "m", "Longest leg without a milestone in between.", "engineering judgement")
    way_tolerance_m: float = setting(
        0.15, "m", "Tolerance at the end of a leg on the way.", "engineering judgement")
    min_doorway_clearance_m: float = setting(
        0.10, "m", "A doorway with less room on each side of the robot is approached more exactly.",
        "engineering judgement")
    goal_tolerance_m: float = setting(
        0.010, "m", "Tolerance at the goal.", "engineering judgement")
    goal_heading_tolerance_rad: float = setting(
        0.02, "rad", "Tolerance of a heading that the goal states.", "engineering judgement")
    max_adjustments: int = setting(
        8, "count", "So often a sketch is adjusted at one milestone; then that was in vain.", "engineering judgement")

    # Escalator
    max_checks_per_subgoal: int = setting(
        20, "count", "So often the action level may ask the plan level on the way to one subgoal; then it is blocked.",
        "engineering judgement")
    max_lost_per_mission: int = setting(
        12, "count", "So often the robot may be lost in one mission.", "engineering judgement")
    max_walked_rooms: int = setting(
        200, "count", "So many rooms are searched for a way that people can walk, to say so where wheels have none.",
        "engineering judgement")

    # Milestone selector
    max_look_error_rad: float = setting(
        math.radians(3.5), "rad", "The robot faces a milestone when its heading is off by no more than this.",
        "engineering judgement")
    max_lines: int = setting(
        60, "count", "Most lines that one milestone expects.", "engineering judgement")
    max_counted_length_px: float = setting(
        120.0, "px", "A line longer than this is no clearer than one of this length.", "engineering judgement")
    max_counted_contrast: float = setting(
        0.3, "1", "A line of more contrast than this is no clearer than one of this contrast.", "engineering judgement")
    max_sigma_part: float = setting(
        0.3, "1", "A view is good if it tells the place to this part of the subgoal's tolerance.",
        "engineering judgement")
    max_sigma_rad: float = setting(
        math.radians(0.25), "rad", "A view is good if it tells the heading to this standard deviation.",
        "engineering judgement")
    min_lines: int = setting(
        10, "count", "Fewest lines of a good view.", "engineering judgement")
    check_tolerance_m: float = setting(
        0.1, "m", "Tolerance that a view is chosen by where no subgoal states one.", "engineering judgement")
    min_look_difference_rad: float = setting(
        math.radians(20.0), "rad", "Looks whose directions differ by less show much the same.", "engineering judgement")
    long_turn_rad: float = setting(
        math.radians(100.0), "rad", "Before a leg that begins with a longer turn the robot turns first, then looks: few"
        " landmarks are followed as it turns about.", "engineering judgement")
    look_turns_rad: tuple[float, ...] = setting(
        tuple(math.radians(a) for a in (30, -30, 60, -60, 90, -90, 135, -135, 180)), "rad",
        "Turns from the present heading that are tried for a better view, in this order.", "engineering judgement")

    # Line finder
    min_segment_length_px: float = setting(
        10.0, "px", "Shortest segment that is kept; shorter ones mostly belong to what the model lacks.",
        "engineering judgement")

    # Obstruction finder
    min_obstruction_looks: int = setting(
        3, "count", "What stands still in so many looks is before the camera; in two it may by chance.",
        "engineering judgement")
    max_obstruction_looks: int = setting(
        6, "count", "Number of last looks that are compared.", "engineering judgement", most=8)
    min_obstruction_part: float = setting(
        0.04, "1", "Smallest part of the picture that an obstruction covers.", "engineering judgement")

    # Matcher
    max_rigid_sigma_px: float = setting(
        6.0, "px", "Up to this uncertainty lines are matched in the image (§6.1); beyond it, on the floor.",
        "engineering judgement")
    rigid_distance_m: float = setting(
        2.5, "m", "Distance at which that uncertainty is taken.", "engineering judgement")

    # Med-R-and-T
    prior_covariance_factor: float = setting(
        4.0, "1", "Factor by which the belief's covariance is loosened as a prior of the pose.",
        "engineering judgement")
    prior_sigma_m: float = setting(
        0.05, "m", "Standard deviation of the place that is added to that prior.", "engineering judgement")
    prior_sigma_rad: float = setting(
        math.radians(1.5), "rad", "Standard deviation of the heading that is added to that prior.",
        "engineering judgement")

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
    inexact_tolerance_sigmas: float = setting(
        2.0, "1", "Deviations of the belief that are added to the tolerance of a goal where the model is inexact.",
        "engineering judgement")
    max_inexact_looks: int = setting(
        5, "count", "The same where the model is inexact: each look tells less.", "engineering judgement")
    independent_look_rad: float = setting(
        math.radians(65.0), "rad", "Looks that differ by so much show nothing twice; nearer ones count less.",
        "the field of view")
    max_told: float = setting(
        3.0, "1", "Most that one look counts for or against a place, in log odds, with those in other directions.",
        "engineering judgement")
    min_alias_part: float = setting(
        0.8, "1", "Another place at which this part of the agreement is seen is not ruled out.",
        "engineering judgement")
    p_false_alias: float = setting(
        0.3, "1", "Probability of a wrong place where another one is not ruled out.",
        "harvey experiment milestones: 993 of 10,289 cases")
    max_p_false_unmistakable: float = setting(
        2e-4, "1", "Up to this probability of a wrong place, it is not compared with others.", "engineering judgement")
    max_p_false_clear: float = setting(
        2e-3, "1", "Up to this one, only with places at which the room repeats itself; beyond, with the whole room.",
        "engineering judgement")
    min_alias_margin: float = setting(
        1.0, "count", "Fewest lines that must speak for the place and not for the other one.", "engineering judgement")
