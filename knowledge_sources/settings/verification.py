"""Settings of the check of a pose: predicted lines, line and color checks, evidence."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_sources.settings.setting import setting

_JUDGED = "engineering judgement"
_MILESTONES = "engineering judgement, checked with harvey experiment milestones"



@dataclass(frozen=True, slots=True)
class VerificationSettings:
    """The numbers by which a pose is checked against a picture."""

    # Predicted lines.
    min_line_length_px: float = setting(
        12.0, "px", "Shortest projected model line that is predicted.", _JUDGED)
    min_line_contrast: float = setting(
        0.05, "1", "Smallest contrast of a model line that is predicted, 0..1.", _JUDGED)
    max_line_distance_m: float = setting(
        15.0, "m", "Largest distance of a model line that is predicted.", _JUDGED)

    # Agreement of lines and segments, counted a contrario.
    line_tolerance_px: float = setting(
        2.5, "px", "Largest distance of a segment from the line that it covers.", _MILESTONES)
    line_tolerance_rad: float = setting(
        0.06, "rad", "Largest angle between a segment and the line that it covers.", _MILESTONES)
    cells_per_line: int = setting(
        24, "count", "Cells into which a line is cut to measure how much of it is covered.", _JUDGED)
    min_covered_fraction: float = setting(
        0.5, "1", "Covered part from which a line is matched.", _JUDGED)
    test_count: float = setting(
        1e3, "count", "Resolvable poses within the matcher's reach: the number of tests of the a-contrario count.",
        "Desolneux, Moisan and Morel 2008, ch. 3")
    min_chance: float = setting(
        0.02, "1", "Lower bound of the probability that a line is matched at a wrong pose.", _JUDGED)
    max_chance: float = setting(
        0.95, "1", "Upper bound of the probability that a line is matched at a wrong pose.", _JUDGED)
    displacement_m: float = setting(
        0.35, "m", "Shift of the nearer wrong poses at which chance is counted; the farther are at twice as much.",
        _JUDGED)
    displacement_rad: float = setting(
        0.07, "rad", "Turn of the nearer wrong poses at which chance is counted; the farther are at twice as much.",
        _JUDGED)
    min_matched_lines: int = setting(
        6, "count", "Fewest matched lines by which a milestone is testable.", _MILESTONES)

    # Colors of faces.
    color_grid_size: int = setting(
        32, "count", "Samples along each side of the picture in which faces are predicted.", _JUDGED)
    border_margin_px: float = setting(
        12.0, "px", "Distance that color samples keep from the border of the picture.", _JUDGED)
    edge_margin_px: float = setting(
        5.0, "px", "Distance that color samples keep from the edges of faces.", _JUDGED)
    min_face_points: int = setting(
        2, "count", "Fewest samples of a face that is compared.", _JUDGED)
    max_face_points: int = setting(
        6, "count", "Most samples of a face that are compared.", _JUDGED)
    max_faces: int = setting(
        16, "count", "Most faces that are predicted, the largest first.", _JUDGED)
    region_image_px: int = setting(
        64, "px", "Side of the reduced picture that is segmented into regions.", _JUDGED)
    min_region_area_px: int = setting(
        8, "px", "Smallest region of the reduced picture [px of area].", _JUDGED)
    dark_offset: float = setting(
        4.0, "1", "Grey levels added before a ratio of colors is taken, against noise in the dark.", _JUDGED)
    max_brightness_log_ratio: float = setting(
        0.3, "1", "Largest difference of log brightness of two faces that agree.", _MILESTONES)
    max_tint_log_ratio: float = setting(
        0.1, "1", "Largest difference of log color, without brightness, of two faces that agree.", _MILESTONES)
    min_color_faces: int = setting(
        3, "count", "Fewest faces by which colors are testable.", _JUDGED)
    max_color_chance: float = setting(
        0.8, "1", "Largest part of the faces that may agree by chance where colors are testable.", _JUDGED)
    cached_color_views: int = setting(
        64, "count", "Predicted views of face colors that are kept.", _JUDGED)

    # Evidence for a pose.
    max_line_weight_px: float = setting(
        100.0, "px", "Length from which a longer line weighs no more.", _JUDGED)
    sharp_tolerance_px: float = setting(
        1.0, "px", "Distance within which a covered line is sharp; chance spreads over the whole tolerance.", _JUDGED)
    probe_turn_rad: float = setting(
        0.4, "rad", "Turn that is weighed like one metre of motion in the weakest direction of the evidence.", _JUDGED)
    max_line_motion_px: float = setting(
        400.0, "px", "Motion of a line in the picture, by one metre, from which it weighs no more.", _JUDGED)
    max_belief_sigmas: float = setting(
        6.0, "1", "Mahalanobis distance from the belief from which a pose gets no credit for being near it.", _JUDGED)
    motion_tolerance_sigmas: float = setting(
        4.0, "1", "Deviations that the wheels are allowed: of three numbers, one in a thousand lies further out.",
        "chi-square with three degrees of freedom")
    min_p_false: float = setting(
        1e-12, "1", "Probability of chance agreement that counts as certainty.", _JUDGED)
    fit_ridge: float = setting(
        0.02, "1", "Ridge penalty of the fit of evidence weights.", _JUDGED)
