"""Settings of finding the robot when its pose is unknown or in doubt."""

from __future__ import annotations

import math
from dataclasses import dataclass

from knowledge_sources.settings.setting import setting

_JUDGED = "engineering judgement"
_KIDNAP = "engineering judgement, checked with harvey experiment kidnap"
_MILESTONES = "engineering judgement, checked with harvey experiment milestones"


@dataclass(frozen=True, slots=True)
class LocalizationSettings:
    """The numbers of finding the robot when its pose is unknown or in doubt."""

    # Views, and the turns between them
    level_heading_sigma_rad: float = setting(
        math.radians(0.3), "rad", "Standard deviation of a turn measured by level lines.", _KIDNAP)
    max_heading_correction_rad: float = setting(
        math.radians(20.0), "rad", "Largest correction of a turn by level lines; odometry decides between the four.",
        _JUDGED)

    # Visibility map of a room
    position_step_m: float = setting(0.25, "m", "Spacing of the positions that are tried in a room.", _KIDNAP)
    position_clearance_m: float = setting(
        0.2, "m", "Distance of positions from walls and things: less than the robot's radius, as a bump may move it.",
        _JUDGED)
    visibility_cell_m: float = setting(
        0.75, "m", "Side of the cells of which each shares one set of visible points.", _KIDNAP)
    point_spacing_m: float = setting(0.25, "m", "Spacing of points along model lines.", _JUDGED)
    max_line_points: int = setting(60, "count", "Most points along one model line.", _JUDGED)
    max_point_distance_m: float = setting(14.0, "m", "Largest distance of a visible point.", _JUDGED)
    min_point_contrast: float = setting(0.05, "1", "Smallest contrast of a line with visible points, 0..1.", _JUDGED)
    occlusion_tolerance_m: float = setting(
        0.01, "m", "Distance behind a surface from which a point is hidden by it.", _JUDGED)
    max_level_slope: float = setting(0.05, "1", "Largest slope of a model line that counts as level.", _JUDGED)

    # Chamfer matching
    chamfer_directions: int = setting(12, "count", "Directions of lines that have a distance map each.", _KIDNAP)
    chamfer_reach_px: float = setting(24.0, "px", "Distance from which a segment no longer counts.", _KIDNAP)
    chamfer_shrink: int = setting(4, "count", "Pixels of the picture along each side of a pixel of the map.", _JUDGED)
    min_point_depth_m: float = setting(0.3, "m", "Smallest depth of a projected point.", _JUDGED)

    # Pose candidates
    prior_points: float = setting(
        50.0, "count", "Points that agree by chance, added to each score: few points are little evidence.", _KIDNAP)
    grid_stride: int = setting(2, "count", "One of so many points is projected when the grid is scored.", _JUDGED)
    min_candidate_distance_m: float = setting(0.45, "m", "Distance from which two candidates are distinct.", _KIDNAP)
    min_candidate_angle_rad: float = setting(
        math.radians(10.0), "rad", "Angle from which two candidates are distinct.", _KIDNAP)
    max_climbed: int = setting(60, "count", "Best poses of the grid that are improved by hill climbing.", _KIDNAP)
    coarse_climb_m: float = setting(0.1, "m", "Step of the first round of hill climbing.", _JUDGED)
    coarse_climb_rad: float = setting(math.radians(0.8), "rad", "Step of the first round of hill climbing.", _JUDGED)
    fine_climb_m: float = setting(0.05, "m", "Step of the second round of hill climbing.", _JUDGED)
    fine_climb_rad: float = setting(math.radians(0.5), "rad", "Step of the second round of hill climbing.", _JUDGED)
    min_relative_score: float = setting(0.6, "1", "Smallest score of a candidate, as a part of the best.", _KIDNAP)
    max_views_of_search: int = setting(
        8, "count", "Most views, the last, by which the floor is searched; what is found is refined by all.", _JUDGED)
    max_candidates: int = setting(14, "count", "Most candidates of a floor that are refined.", _KIDNAP)

    # Refinement
    candidate_sigma_m: float = setting(0.15, "m", "Standard deviation of a candidate's position.", _KIDNAP)
    candidate_sigma_rad: float = setting(
        math.radians(1.5), "rad", "Standard deviation of a candidate's heading.", _KIDNAP)
    coarse_gate_px: float = setting(16.0, "px", "Distance of a segment from its line in the first round.", _KIDNAP)
    fine_gate_px: float = setting(4.0, "px", "Distance of a segment from its line in the second round.", _KIDNAP)
    gate_rad: float = setting(0.12, "rad", "Angle between a segment and its line.", _KIDNAP)
    min_pair_overlap: float = setting(0.5, "1", "Part of a segment that must lie beside its line.", _JUDGED)
    min_pairs: int = setting(3, "count", "Fewest pairs of segment and line that are solved for a pose.", _JUDGED)
    known_turn_rad: float = setting(
        math.radians(0.5), "rad", "Standard deviation of a turn up to which it is not searched.", _KIDNAP)
    turn_step_rad: float = setting(math.radians(1.5), "rad", "Step of the search for an uncertain turn.", _KIDNAP)
    turn_search_sigmas: float = setting(
        2.5, "1", "Reach of the search for an uncertain turn, in standard deviations.", _JUDGED)
    max_view_surprise: float = setting(
        11.3, "1", "Largest squared normalized error of a view by the others, with which they still agree; three"
        " unknowns, 99 %.", _JUDGED)

    # Log likelihood of a pose
    detection_rate: float = setting(
        0.85, "1", "Probability that a predicted line is found at the right pose: others are hidden or too faint.",
        _KIDNAP)
    min_chance: float = setting(0.04, "1", "Lower bound of the probability of a match at a wrong pose.", _JUDGED)
    max_chance: float = setting(0.6, "1", "Upper bound of the probability of a match at a wrong pose.", _JUDGED)
    line_independence: float = setting(
        0.5, "1", "Weight of a line: lines of one thing are seen or missed together (tempered likelihood).", _KIDNAP)
    min_view_lines: int = setting(8, "count", "Fewest predicted lines by which a single view counts.", _JUDGED)
    min_explained_length_px: float = setting(
        25.0, "px", "Shortest segment that should be explained by the model.", _JUDGED)
    explained_tolerance_px: float = setting(
        3.0, "px", "Distance of a segment from the model line that explains it.", _JUDGED)
    min_explaining_length_px: float = setting(
        4.0, "px", "Shortest model line that explains a segment.", _JUDGED)
    min_explaining_contrast: float = setting(
        0.01, "1", "Smallest contrast of a model line that explains a segment, 0..1.", _JUDGED)
    displacement_m: float = setting(
        0.35, "m", "Shift of the nearer wrong poses at which chance is counted; the farther are at twice as much.",
        _JUDGED)
    displacement_rad: float = setting(0.1, "rad", "Turn of the wrong poses at which chance is counted.", _JUDGED)

    # Acceptance of a pose
    min_views: int = setting(
        2, "count", "Fewest views by which a pose is accepted: one may fit a place that the model lacks.", _KIDNAP)
    min_matched_lines: int = setting(12, "count", "Fewest matched lines of an accepted pose.", _KIDNAP)
    min_matched_fraction: float = setting(
        0.6, "1", "Smallest part of the predicted lines that an accepted pose matches.", _KIDNAP)
    min_view_fraction: float = setting(
        0.35, "1", "Smallest part of the predicted lines that an accepted pose matches in any view.", _KIDNAP)
    min_explained_fraction: float = setting(
        0.35, "1", "Smallest part of the segments that an accepted pose explains.", _KIDNAP)
    min_fraction_sum: float = setting(
        1.15, "1", "Smallest sum of matched and explained parts: a pose nearby has a little of both.",
        "rough-day, seed 91")
    sure_log_likelihood: float = setting(
        40.0, "1", "Log likelihood from which segments need no explanation: the model lacks what is on full shelves.",
        _KIDNAP)
    sure_matched_fraction: float = setting(
        0.75, "1", "Part of the predicted lines from which segments need no explanation.", _KIDNAP)
    min_log_likelihood: float = setting(2.0, "1", "Smallest log likelihood of a hypothesis that is kept.", _KIDNAP)
    refuting_log_ratio: float = setting(
        8.0, "1", "Log likelihood ratio (Bayes factor) by which a better hypothesis refutes a distinct one.", _KIDNAP)
    max_hypotheses: int = setting(6, "count", "Most hypotheses that are kept.", _JUDGED)

    max_doubted_pictures: int = setting(
        3, "count", "A camera that so few pictures taught is tried as told too, when the robot is lost.", _JUDGED)

    # Telling hypotheses apart, and the next view
    same_line_px: float = setting(
        8.0, "px", "Distance up to which lines of two predicted views are the same, as precise as poses are.", _KIDNAP)
    same_line_rad: float = setting(0.12, "rad", "Angle up to which lines of two predicted views are the same.", _KIDNAP)
    min_compared_length_px: float = setting(
        20.0, "px", "Shortest line by which predicted views are compared.", _JUDGED)
    min_different_lines: float = setting(
        3.0, "count", "Lines in which two predicted views must differ to be told apart.", _KIDNAP)
    min_different_fraction: float = setting(
        0.15, "1", "Part of their lines in which two predicted views must differ to be told apart.", _KIDNAP)
    max_different_lines: int = setting(
        20, "count", "Lines from which a larger difference separates hypotheses no better.", _JUDGED)
    unknown_weight: float = setting(0.1, "1", "Weight of poses that no hypothesis covers.", _JUDGED)
    turns_rad: tuple[float, ...] = setting(
        tuple(math.radians(a) for a in (180.0, 90.0, -90.0, 135.0, -135.0, 45.0, -45.0)), "rad",
        "Turns on the spot that are tried; of equals the first is taken.", _JUDGED)
    turns_before_move_rad: tuple[float, ...] = setting(
        tuple(math.radians(a) for a in (0.0, 90.0, -90.0, 180.0)), "rad", "Turns that are tried before a move.",
        _JUDGED)
    move_m: float = setting(0.6, "m", "Length of a move to another view.", _JUDGED)
    move_clearance_m: float = setting(
        0.1, "m", "Clearance of a move beyond the robot's radius, from every hypothesis.", _JUDGED)
    min_new_view_rad: float = setting(
        math.radians(30.0), "rad", "Angle from earlier views from which a view at the same position is new.", _JUDGED)

    # Driving to a view that tells places apart
    clear_difference: float = setting(
        2.0, "1", "Times as many lines as are needed, by which one or two views alone tell places apart.", _JUDGED)
    max_searched_views: int = setting(
        4, "count", "Views after which places are followed, and no longer searched for, while two are accepted.",
        _JUDGED)
    far_reach_m: float = setting(12.0, "m", "How far away a view that tells places apart is looked for.", _JUDGED)
    far_step_m: float = setting(1.0, "m", "Grid of the positions of such views.", _JUDGED)
    far_leg_m: float = setting(1.2, "m", "Longest move on the way there; then another look is taken.", _JUDGED)
    far_arrived_m: float = setting(0.15, "m", "Distance from such a position from which the robot only turns.", _JUDGED)
    far_coarse_m: float = setting(0.03, "m", "To this the free floor's outline is simplified.", _JUDGED)
    far_hypotheses: int = setting(3, "count", "Most places, the likeliest, that a far view is to tell apart.", _JUDGED)

    # Aliases of a pose: where the room repeats itself, and where the picture fits as well
    max_size_difference_m: float = setting(0.1, "m", "Difference in the sides of rooms that may be alike.", _JUDGED)
    alias_line_length_px: float = setting(30.0, "px", "Length that counts as one line of a margin.", _JUDGED)
    max_fitting_poses: int = setting(14, "count", "Most poses of a room that are tried because the picture fits.",
                                     _MILESTONES)
    view_grid_m: float = setting(0.1, "m", "Grid of positions on which visible lines are computed and kept.", _JUDGED)
    view_grid_rad: float = setting(
        math.radians(2.0), "rad", "Grid of headings on which visible lines are computed and kept.", _JUDGED)
    cached_views: int = setting(64, "count", "Predicted views on the grid that are kept.", _JUDGED)

    # Odds of the place where the robot was told to be, or was tracked to
    p_told: float = setting(
        0.98, "1", "Probability that the robot is where it was told to be at the start.", _JUDGED)
    lost_again_odds: float = setting(
        0.2, "1", "Factor on the odds of that for every time that it was believed by them, and the robot got lost.",
        _JUDGED)
    told_sigma_m: float = setting(
        0.1, "m", "Standard deviation that a tracked position has beyond its covariance: it may have slipped.", _JUDGED)
    told_sigma_rad: float = setting(
        math.radians(3.0), "rad", "Standard deviation that a tracked heading has beyond its covariance.", _JUDGED)
    max_told_chi2: float = setting(
        21.1, "1", "Largest squared distance of a place from where it was told or tracked to be that is still that"
        " place, in deviations; three unknowns, 99.99 %.", _JUDGED)
    max_alike_log_ratio: float = setting(
        3.0, "1", "Largest log likelihood ratio of the pictures between places that look alike by the model: more is"
        " chance.", _JUDGED)
    watches_twins: bool = setting(
        True, "1", "Whether places that look alike are kept in mind while driving.", _JUDGED)
    alike_log_noise: float = setting(
        2.0, "1", "Log likelihood ratio of one picture between places that look alike by the model that is noise.",
        "generated floors of seeds 0 to 2")
    min_p_tracked: float = setting(
        0.8, "1", "Smallest probability, against all places that look alike, of a place that is not doubted.", _JUDGED)
    min_p_twin: float = setting(
        1e-6, "1", "Smallest probability of a place that looks alike and is kept in mind.", _JUDGED)
    min_p_believed: float = setting(
        0.97, "1", "Smallest probability of a place that is believed where no look within reach tells more.", _JUDGED)
    min_p_sure: float = setting(
        0.999, "1", "Smallest probability of a place that is believed although another look could tell more.", _JUDGED)

    # Obstructions before the camera
    min_turn_between_views_rad: float = setting(
        math.radians(10.0), "rad", "Turn from which nothing of the building stays where it is in the picture.", _JUDGED)
    stationary_px: float = setting(1.5, "px", "Distance of two segments that are one stationary line.", _JUDGED)
    stationary_rad: float = setting(0.03, "rad", "Angle of two segments that are one stationary line.", _JUDGED)
    min_stationary_overlap: float = setting(
        0.5, "1", "Part of the shorter of two segments that must lie beside the other.", _JUDGED)
    min_stationary_views: int = setting(
        2, "count", "Other views in which a stationary segment has a counterpart: in one it may be by chance.", _JUDGED)
    min_stationary_fraction: float = setting(
        0.6, "1", "Part of the other views in which a stationary segment has a counterpart.", _JUDGED)
    min_obstruction_area: float = setting(0.01, "1", "Smallest obstruction, as a part of the picture.", _JUDGED)
    max_obstruction_area: float = setting(
        0.5, "1", "Largest obstruction, as a part of the picture: where more is stationary, the robot did not turn.",
        _JUDGED)
    side_end_quantile: float = setting(
        0.8, "1", "Quantile of segment ends that is the end of a side: longer ones go on in something else.", _JUDGED)
    min_sides: int = setting(3, "count", "Fewest sides of an outline.", _JUDGED)
    max_dropped_sides: int = setting(4, "count", "Most sides that are left out as chance.", _JUDGED)
    inside_margin_px: float = setting(
        8.0, "px", "Distance within the outline from which a segment lies inside.", _JUDGED)
    max_inside_fraction: float = setting(
        0.1, "1", "Largest length of segments inside an opaque outline, as a part of the outline's own.", _JUDGED)
