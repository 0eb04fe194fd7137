"""Every number that can be set, one frozen dataclass for each room; ``harvey settings`` prints them.

A number is set here where an experiment, a scenario, a document or a test varies it; all others are constants beside
their use. ``--set ROOM.NAME=VALUE`` replaces one. A function takes the settings of its own room, or :class:`Settings`
where it also calls other rooms.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from math import inf
from typing import Any

Value = float | tuple[float, ...]
"""Of a setting: a number (or ``True`` and ``False``), or several numbers."""

SWITCHES: Mapping[str, bool] = {"on": True, "yes": True, "true": True, "off": False, "no": False, "false": False}
"""What may be written for a setting that is on or off."""


def setting(
    default: Value, unit: str, what: str, source: str = "engineering judgement", *, most: float = inf,
) -> Any:
    """A field of a settings dataclass.

    Args:
        default: a whole number where only whole numbers make sense; a tuple where there are several.
        unit: ``px``, ``m``, ``rad``, ``s``, ``1`` for a ratio or a probability, ``count``, ``yes/no``.
        what: one sentence, without the unit.
        source: section or equation of the paper, or the experiment that chose it; what nobody measured is judgement.
        most: largest value, where something else does not allow more.
    """
    details = {"unit": unit, "what": what, "source": source, "most": most}
    return field(default=default, metadata=details)


@dataclass(frozen=True, slots=True)
class FeaturesSettings:
    """The numbers of lines, regions, corners and template correlation (§1.2)."""

    # Line segments, whether predicted or not
    line_systematic_px: float = setting(
        0.03, "px", "Error of a segment's place that does not average out along it, added in quadrature.",
        "measured: a lens not quite known, a renderer that places edges to a sixteenth of a pixel")
    sigma_across_px: float = setting(
        0.7, "px", "Standard deviation of a segment's end across its model line, with the model's own errors.",
        "measured on rendered edges (tests/laws/features)")

    # Segments near predicted lines: bands
    band_px: float = setting(
        12.0, "px", "Half-width of the band searched round a predicted line, also beyond its ends.", "§6.1.4, Figure 1")

    # Regions of like brightness
    max_valley_share: float = setting(
        0.6, "1", "Largest height of a histogram's valley as a share of the lower of its two peaks.")
    min_mode_share: float = setting(0.02, "1", "Least share of a sector's pixels on each side of a valley.")


@dataclass(frozen=True, slots=True)
class PoseSettings:
    """The numbers of the pose solvers (§6.2)."""

    # All solvers
    max_beside_px: float = setting(5.0, "px", "How far beyond the end of its model line an observed segment may lie.")
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
        (4.0, 2.0, 1.0, 1.0), "1", "Factors on the squared bound on inliers in that refinement, round by round.")

    # A robot on the floor, from points
    point_outlier_sigmas: float = setting(
        4.0, "1", "A point further than this many standard deviations off is an outlier.")

    # Lines of a model that is inexact
    shared_prior_factor: float = setting(
        3.0, "1", "A prior of the same model is loosened by so many times what the model's errors make uncertain.")
    marginal_spread: float = setting(
        1.4, "1", "Factor on the standard deviations of such a pose, for segments matched to a wrong line nearby.",
        "engineering judgement, after a few poses on generated floors")
    displaced_widths_px: tuple[float, ...] = setting(
        (12.0, 8.0, 5.0, 3.0, 2.0, 1.5), "px", "Widths of the loss by which displacements of the model are fitted.")
    displaced_steps: int = setting(2, "count", "Steps of that fit at each width.")
    displaced_pair_px: float = setting(
        2.5, "px", "Largest distance of a segment from its line, once that is displaced.")
    displaced_unit_px: float = setting(20.0, "px", "A segment of this length weighs like one measurement.")


@dataclass(frozen=True, slots=True)
class MatchingSettings:
    """The numbers of line matching (§6.1)."""

    # The search, in the image or with a pose
    min_gain: float = setting(1e-9, "1", "A move must lower the match error by more than this.", "rounding")

    # The objective: a likelihood (§6.1.3)
    chance_exponent: float = setting(
        3.0, "1", "How fast clutter along a model line becomes rarer with its length.")
    chance_length_px: float = setting(10.0, "px", "Length from which clutter along a model line is rare.")

    # In the image
    max_pair_px: float = setting(
        4.0, "px",
        "Largest distance of a data end from its model line in the image.", "§6.1.4 says 3 px; wider for perspective")
    pair_sigmas: float = setting(3.0, "1", "Standard deviations of a data end in that largest distance.")

    # Starts in the image: a generalised Hough transform
    max_starts: int = setting(3, "count", "Placements that are searched (paper: 1).", "§6.1.4, experiment matcher")
    hough_window_px: float = setting(30.0, "px", "Largest shift of the model.", "§6.1.4")
    hough_step_rad: float = setting(0.03, "rad", "Turn between two planes of the accumulator.")
    hough_cells: int = setting(33, "count", "Cells along each of the accumulator's two axes of shift.")

    # With a pose: the pairs that the prior allows
    max_allowed_pairs: int = setting(
        60000, "count", "Most pairs that are looked at; of more, each model line's longest.", "experiment matcher")
    max_start_pairs: int = setting(
        12000, "count",
        "Most pairs that the starts are refined with; of more, each model line's longest.", "experiment matcher")
    max_near_pairs: int = setting(
        2500, "count",
        "Most pairs near a pose that are searched; of more, each model line's longest.", "experiment matcher")


@dataclass(frozen=True, slots=True)
class VerificationSettings:
    """The numbers by which a pose is checked against a picture."""

    # Predicted lines.
    min_line_length_px: float = setting(12.0, "px", "Shortest projected model line that is predicted.")

    # Agreement of lines and segments, counted a contrario.
    line_tolerance_px: float = setting(
        2.5, "px", "Largest distance of a segment from the line that it covers.",
        "engineering judgement, checked with harvey experiment milestones")
    min_matched_lines: int = setting(
        6, "count", "Fewest matched lines by which a milestone is testable.",
        "engineering judgement, checked with harvey experiment milestones")

    # Evidence for a pose.
    motion_tolerance_sigmas: float = setting(
        4.0, "1", "Deviations that the wheels are allowed: of three numbers, one in a thousand lies further out.",
        "chi-square with three degrees of freedom")


@dataclass(frozen=True, slots=True)
class LocalizationSettings:
    """The numbers of finding the robot when its pose is unknown or in doubt."""

    # Acceptance of a pose
    min_views: int = setting(
        2, "count", "Fewest views by which a pose is accepted: one may fit a place that the model lacks.",
        "engineering judgement, checked with harvey experiment kidnap")
    min_matched_lines: int = setting(
        12, "count",
        "Fewest matched lines of an accepted pose.", "engineering judgement, checked with harvey experiment kidnap")
    min_matched_fraction: float = setting(
        0.6, "1", "Smallest part of the predicted lines that an accepted pose matches.",
        "engineering judgement, checked with harvey experiment kidnap")
    min_view_fraction: float = setting(
        0.35, "1", "Smallest part of the predicted lines that an accepted pose matches in any view.",
        "engineering judgement, checked with harvey experiment kidnap")
    min_explained_fraction: float = setting(
        0.35, "1", "Smallest part of the segments that an accepted pose explains.",
        "engineering judgement, checked with harvey experiment kidnap")
    min_fraction_sum: float = setting(
        1.15, "1",
        "Smallest sum of matched and explained parts: a pose nearby has a little of both.", "rough-day, seed 91")
    sure_log_likelihood: float = setting(
        30.0, "1", "Log likelihood from which segments need no explanation: the model lacks what is on full shelves.",
        "own floors, plain and textured, and development floors of miniworld: the best place in rooms where it is not")
    sure_matched_fraction: float = setting(
        0.75, "1", "Part of the predicted lines from which, at that likelihood, segments need no explanation.",
        "engineering judgement, checked with harvey experiment kidnap")
    clear_log_likelihood: float = setting(
        80.0, "1", "Log likelihood from which a single view may show nothing of what should be seen: it may be hidden.",
        "miniworld's development floors")
    min_log_likelihood: float = setting(
        2.0, "1", "Smallest log likelihood of a hypothesis that is kept.",
        "engineering judgement, checked with harvey experiment kidnap")
    refuting_log_ratio: float = setting(
        8.0, "1", "Log likelihood ratio (Bayes factor) by which a better hypothesis refutes a distinct one.",
        "engineering judgement, checked with harvey experiment kidnap")
    max_hypotheses: int = setting(6, "count", "Most hypotheses that are kept.")
    max_doubted_pictures: int = setting(
        3, "count", "A camera that so few pictures taught is tried as told too, when the robot is lost.")

    # Driving to a view that tells places apart
    max_searched_views: int = setting(
        4, "count", "Views after which places are followed, and no longer searched for, while two are accepted.")

    # Odds of the place where the robot was told to be, or was tracked to
    p_told: float = setting(0.98, "1", "Probability that the robot is where it was told to be at the start.")
    lost_again_odds: float = setting(
        0.2, "1", "Factor on the odds of that for every time that it was believed by them, and the robot got lost.")
    p_displaced_to_alias: float = setting(
        0.001, "1", "Probability that a robot that was displaced stands just where everything looks as it should.",
        "a window of 0.6 m and 20 degrees round one place of a room of 20 m2")
    told_sigma_m: float = setting(
        0.1, "m", "Standard deviation that a tracked position has beyond its covariance: it may have slipped.")
    told_sigma_rad: float = setting(
        math.radians(3.0), "rad", "Standard deviation that a tracked heading has beyond its covariance.")
    max_told_chi2: float = setting(
        21.1, "1",
        "Largest squared distance of a place from where it was told or tracked to be that is still that place, in"
        " deviations; three unknowns, 99.99 %.")
    max_alike_log_ratio: float = setting(
        3.0, "1",
        "Largest log likelihood ratio of the pictures between places that look alike by the model: more is chance.")
    alike_log_noise: float = setting(
        2.0, "1", "Log likelihood ratio of one picture between places that look alike by the model that is noise.",
        "generated floors of seeds 0 to 2")
    min_p_tracked: float = setting(
        0.8, "1", "Smallest probability, against all places that look alike, of a place that is not doubted.")
    min_p_twin: float = setting(1e-6, "1", "Smallest probability of a place that looks alike and is kept in mind.")
    min_p_believed: float = setting(
        0.97, "1", "Smallest probability of a place that is believed where no look within reach tells more.")
    min_p_sure: float = setting(
        0.999, "1", "Smallest probability of a place that is believed although another look could tell more.")


@dataclass(frozen=True, slots=True)
class TrackingSettings:
    """The numbers of following landmarks from frame to frame (§5)."""

    # Template tracking
    template_half_px: int = setting(10, "px", "Half-width of a landmark's template.", "experiment table1")
    max_tracks: int = setting(14, "count", "Largest number of landmarks followed at a time.", "experiment table1")
    min_spacing_px: float = setting(28.0, "px", "Least distance in the picture between landmarks.")
    max_landmark_distance_m: float = setting(15.0, "m", "Largest distance of a landmark when it is chosen.")

    # Alignment to the model's edges
    min_edge_lines: int = setting(6, "count", "Least number of lines that must agree with the fit.")


@dataclass(frozen=True, slots=True)
class CameraStateSettings:
    """The numbers of the camera's own state."""

    # What is believed where nobody has stated a deviation
    sigma_tilt_rad: float = setting(
        math.radians(1.5), "rad", "Standard deviation of the mounting's tilt.",
        "issue: mounted by hand, up to 3 degrees and 8 cm otherwise than believed, taken for two deviations")
    sigma_roll_rad: float = setting(
        math.radians(1.5), "rad", "Standard deviation of its roll.",
        "issue: mounted by hand, up to 3 degrees and 8 cm otherwise than believed, taken for two deviations")
    sigma_yaw_rad: float = setting(
        math.radians(1.5), "rad", "Standard deviation of its yaw.",
        "issue: mounted by hand, up to 3 degrees and 8 cm otherwise than believed, taken for two deviations")
    sigma_height_m: float = setting(
        0.04, "m", "Standard deviation of its height.",
        "issue: mounted by hand, up to 3 degrees and 8 cm otherwise than believed, taken for two deviations")
    sigma_focal: float = setting(
        0.02, "1", "Standard deviation of the focal length, as a part of it.", "issue: up to 4 %")
    sigma_centre_px: float = setting(
        0.5, "px", "Standard deviation of the principal point, along each axis.", "harvey experiment calibrate")

    # Where it is matched
    max_known_px: float = setting(
        4.0, "px", "Up to this uncertainty in the picture the camera is taken as believed when lines are matched.")
    focal_starts: tuple[float, ...] = setting(
        (-1.5, 0.0, 1.5), "1", "Focal lengths that are tried beyond it, in deviations.")
    pair_px: float = setting(8.0, "px", "Largest distance of a data end from its model line then.")
    match_sigma_px: float = setting(2.5, "px", "Standard deviation of a data end across its model line then.")
    sharp_px: float = setting(1.0, "px", "A line is covered sharply by segments within this distance.")

    # A camera that was knocked
    min_sharp_part: float = setting(
        0.6, "1", "Where less of the lines' length is covered sharply, the camera may have been knocked.")
    min_knock_gain: float = setting(
        0.15, "1", "By so much more must be covered sharply with a camera that was knocked.")

    # The yaw, from where the robot comes to
    min_travel_m: float = setting(1.0, "m", "Shortest way by which the yaw is learnt.")
    max_travel_m: float = setting(15.0, "m", "A longer way is not measured: what the wheels slip adds up.")
    min_straightness: float = setting(
        0.9, "1", "Part of the way's length that its ends are apart; of a more bent one nothing is learnt.")
    heading_sigma_rad: float = setting(
        math.radians(0.5), "rad", "Standard deviation of the headings on a way of one metre; they average.",
        "missions with cameras as told, generated floors 3 to 8")
    max_yaw_sigmas: float = setting(3.0, "1", "A way that ends further aside than this tells nothing of the yaw.")
    min_learnt: float = setting(0.05, "1", "The yaw is revised when its variance shrinks by this part.")

    # What is learnt
    min_lines: int = setting(10, "count", "Fewest lines by which the camera is learnt.")
    max_chi2: float = setting(
        30.0, "1", "Squared distance from what was believed beyond which a picture is no evidence.")
    min_move_m: float = setting(0.3, "m", "A picture counts if it was taken this far from those that have counted.")
    min_turn_rad: float = setting(math.radians(10.0), "rad", "Or in a direction that differs by this.")
    counted: int = setting(40, "count", "Number of pictures that are remembered as counted.")
    floor_rad: float = setting(
        math.radians(0.02), "rad", "Tilt, roll and yaw are never known better: lines share errors.")
    floor_m: float = setting(0.0015, "m", "Nor the height.")
    floor_focal: float = setting(0.001, "1", "Nor the focal length.")
    floor_centre_px: float = setting(0.2, "px", "Nor the principal point.")

    # The pose and the camera from one picture
    widths_px: tuple[float, ...] = setting(
        (24.0, 12.0, 6.0, 3.0, 1.5), "px", "Widths of the loss by which pose and camera are refined.")
    steps_a_width: int = setting(2, "count", "Steps of Gauss-Newton at each width.")
    outlier_sigmas: float = setting(3.0, "1", "A line further off than this is an outlier.")
    max_rounds: int = setting(8, "count", "Most rounds of choosing the lines that agree.")
    min_freedom: int = setting(6, "count", "Fewest degrees of freedom by which the noise is judged.")
    line_sigma_px: float = setting(
        0.5, "px", "Standard deviation of a line's end across it, with what model and picture have in common.")


@dataclass(frozen=True, slots=True)
class ActionSettings:
    """The numbers of the knowledge sources of the action level (§5)."""

    # Tolerance of the action level
    min_tolerance_px: float = setting(
        4.0, "px", "Floor of the tolerance in the image: what correlation alone may be wrong by.")
    tolerance_sigmas: float = setting(
        3.0, "1", "Standard deviations of the believed pose that the action level may correct.", "§3.2")

    # Motor
    lookahead_m: float = setting(
        1.2, "m", "Distance ahead on the line at which the motor steers (pure pursuit): two increments.")

    # Floor ahead: motor and path follower
    keeps_to_seen_floor: bool = setting(
        True, "yes/no",
        "Whether the robot drives only where it has seen the floor free; else it looks or creeps.", "§4")
    max_seen_age_s: float = setting(60.0, "s", "What was seen to be free longer ago must be seen again.")
    creep_speed_m_per_s: float = setting(0.09, "m/s", "Speed into floor that was not seen to be free.")
    wary_speed_m_per_s: float = setting(
        0.4, "m/s", "Speed into floor that looks free, where no earlier picture would tell what stands on it.")
    max_creep_m: float = setting(0.6, "m", "Longest move at that speed before the next picture.")
    max_looks: int = setting(4, "count", "Most looks round on one leg.")

    # Correlator tracker
    max_misses: int = setting(2, "count", "A landmark that is not found so many times in a row is dropped.")
    min_expected_landmarks: int = setting(4, "count", "Fewest expected landmarks that can make a discrepancy.")
    min_agreeing_landmarks: int = setting(
        2, "count",
        "Fewest landmarks that must agree for the belief to be corrected by them; of those that were found alone,"
        " one in 17 was something else.",
        "34 of them, on drives to and fro in the Research Center")
    min_agreeing_part: float = setting(
        1.0 / 3.0, "1", "If a smaller part of the expected landmarks agrees, tracking has failed.")
    min_followed_landmarks: int = setting(
        4, "count", "With so many landmarks in the last tracked frame, the robot is taken to be still in its room.")

    # Things on the floor
    obstacle_width_m: float = setting(0.45, "m", "Width and depth that something touched is taken to have.")
    min_thing_certainty: float = setting(
        0.5, "1", "What is seen on the floor with less certainty than this tells of no obstacle.")
    min_obstacle_certainty: float = setting(
        0.9, "1", "With this certainty an obstacle is there: by one sure picture, or by two unsure ones.")
    act_within_m: float = setting(
        0.7, "m", "What may stand in the next so much of the way is held to be there: nearer it is not seen at all.",
        "the picture's lower border shows floor 1.3 m ahead")
    max_obstacle_certainty: float = setting(
        0.99, "1", "No obstacle is more certain than this, so that what is gone is soon forgotten.")
    min_gone_certainty: float = setting(0.5, "1", "An obstacle that is less certain is gone.")
    min_footprint_change_m: float = setting(
        0.1, "m", "A frame is revised when an obstacle's footprint turns out otherwise by so much.")

    # Fault handler
    max_fault_s: float = setting(30.0, "s", "A fault that lasts longer ends the mission.")
    max_broken_motions: int = setting(5, "count", "So many motions broken off in a row end the mission.", most=8)
    min_retry_wait_s: float = setting(
        0.25, "s", "Pause before the first retry after a fault; each further one is twice as long.")
    max_retry_wait_s: float = setting(2.0, "s", "Longest pause between retries.")


@dataclass(frozen=True, slots=True)
class PlanSettings:
    """The numbers of the knowledge sources of the plan level (§4, §6)."""

    # Tolerance of the plan level
    max_deviation_px: float = setting(
        30.0, "px", "Bound of the plan level: how far the matcher looks for what is expected.", "§6.1.4")

    # Sketchers
    clearances_m: tuple[float, ...] = setting(
        (0.12, 0.06, 0.03), "m", "Margins round the robot's disc, tried in this order; the last must always be kept.")
    overhang_m: float = setting(
        0.15, "m",
        "So much wider than its feet something that the model lacks may be: where there is room, the way is led so"
        " much farther round it, and nearer to it the robot creeps.")
    max_lookouts: int = setting(
        6, "count", "So often the robot looks again, from elsewhere, at what leaves no way; then it is blocked.")
    max_leg_m: float = setting(3.6, "m", "Longest leg without a milestone in between.")
    approaches_seeing: bool = setting(
        True, "yes/no", "Whether a doorway is approached, and left behind, from where the floor in it is seen.", "§4")
    max_adjustments: int = setting(8, "count", "So often a sketch is adjusted at one milestone; then that was in vain.")

    # Discrepancy raiser
    max_checks_per_subgoal: int = setting(
        20, "count", "So often the action level may ask the plan level on the way to one subgoal; then it is blocked.")
    max_lost_per_mission: int = setting(12, "count", "So often the robot may be lost in one mission.")

    # Milestones to come
    max_lines: int = setting(60, "count", "Most lines that one milestone expects.")
    long_turn_rad: float = setting(
        math.radians(100.0), "rad",
        "Before a leg that begins with a longer turn the robot turns first, then looks: few landmarks are followed"
        " as it turns about.")
    look_turns_rad: tuple[float, ...] = setting(
        tuple(math.radians(a) for a in (30, -30, 60, -60, 90, -90, 135, -135, 180)), "rad",
        "Turns from the present heading that are tried for a better view, in this order.")

    # Obstruction finder
    max_obstruction_looks: int = setting(6, "count", "Number of last looks that are compared.", most=8)

    # Milestone judge
    p_wrong_standing: float = setting(
        0.02, "1", "Prior probability of a wrong belief where the robot stands as it was put down, or found.",
        "as localization.p_told has it")
    p_wrong_followed: float = setting(
        0.05, "1", "The same where landmarks were followed up to here.")
    max_followed_px: float = setting(
        15.0, "px", "Where the belief leaves more than this open in the picture, followed landmarks tell of no place.",
        "half of max_deviation_px")
    p_wrong_unfollowed: float = setting(0.12, "1", "The same where no landmarks were followed.")
    p_wrong_in_doubt: float = setting(0.5, "1", "The same where the belief is in doubt.")
    max_p_rival: float = setting(
        0.03, "1", "Largest probability of a place that looks alike, by belief and picture, where one is verified.",
        "as localization.min_p_believed has it")
    min_contrast: float = setting(
        6.0, "grey levels", "A frame of less contrast (standard deviation of its grey values, 0 to 255) is dark.")
    max_looks: int = setting(
        3, "count", "A milestone is looked for from so many directions before it counts as a discrepancy.")
    max_inexact_looks: int = setting(5, "count", "The same where the model is inexact: each look tells less.")
    max_told: float = setting(
        3.0, "1", "Most that one look counts for or against a place, in log odds, with those in other directions.")


@dataclass(frozen=True, slots=True)
class GoalSettings:
    """The numbers of the knowledge sources of the goal level (§2)."""

    # Relocalization
    max_far_probes: int = setting(
        20, "count",
        "So many looks are taken when lost and places fit: it turns, and drives to views that tell them apart.")
    max_rooms: int = setting(80, "count", "Most rooms that are searched, the nearest to the last belief first.")
    max_floor_difference_m: float = setting(0.5, "m", "Rooms whose floors differ by less are on one floor.")
    min_contrast: float = setting(
        6.0, "grey levels", "A dark frame has less contrast (standard deviation of its grey values) than this.")
    min_brightness: float = setting(
        40.0, "grey levels", "A dark frame also has a lower mean than this; a brighter one shows a bare wall.")


@dataclass(frozen=True, slots=True)
class FloorSettings:
    """The numbers of the methods that see free floor, with a camera or range sensors."""

    # Which parts are used
    use_appearance: bool = setting(True, "yes/no", "What does not look like the floor is a thing on it.")
    use_parallax: bool = setting(
        True, "yes/no", "Two pictures tell whether it stands up from the floor or lies flat on it.")
    use_ranges: bool = setting(True, "yes/no", "Range sensors tell of free floor too, where the robot has any.")

    # How far
    max_untold_m: float = setting(
        0.15, "m",
        "Depth of floor beside the model's own parts that is taken to be free, though its looks tell nothing there.")


@dataclass(frozen=True, slots=True)
class Settings:
    """The settings of all rooms."""

    features: FeaturesSettings = field(default_factory=FeaturesSettings)
    pose: PoseSettings = field(default_factory=PoseSettings)
    matching: MatchingSettings = field(default_factory=MatchingSettings)
    verification: VerificationSettings = field(default_factory=VerificationSettings)
    localization: LocalizationSettings = field(default_factory=LocalizationSettings)
    tracking: TrackingSettings = field(default_factory=TrackingSettings)
    camera_state: CameraStateSettings = field(default_factory=CameraStateSettings)
    action: ActionSettings = field(default_factory=ActionSettings)
    plan: PlanSettings = field(default_factory=PlanSettings)
    goal: GoalSettings = field(default_factory=GoalSettings)
    floor: FloorSettings = field(default_factory=FloorSettings)


DEFAULT = Settings()
"""What holds unless somebody sets it otherwise."""


@dataclass(frozen=True, slots=True)
class Row:
    """One setting.

    Attributes:
        room, field: where it is found; value: as it is set, or in words who sets it.
        unit, what, source, most: as :func:`setting` takes them.
    """

    room: str
    field: str
    value: Value | str
    unit: str
    what: str
    source: str
    most: float

    @property
    def name(self) -> str:
        """As ``--set`` takes it: ``matching.max_x_px``."""
        return f"{self.room}.{self.field}"


def list_rows(settings: Settings = DEFAULT) -> tuple[Row, ...]:
    """Every setting of every room, in the order in which they are defined."""
    rooms = ((room.name, getattr(settings, room.name)) for room in fields(settings))
    return tuple(
        Row(name, f.name, getattr(room, f.name), **f.metadata)
        for name, room in rooms for f in fields(room)
    )


def replace_value(settings: Settings, name: str, value: Any) -> Settings:
    """The settings with one value replaced.

    Raises:
        KeyError: there is no setting of that name.
        ValueError: the value is not of the kind of the default, or too large; says what was expected.
    """
    row = {row.name: row for row in list_rows()}[name]
    changed = replace(getattr(settings, row.room), **{row.field: _convert(value, row)})
    return replace(settings, **{row.room: changed})


def _convert(value: Any, row: Row) -> Value:
    """The value as one of the setting's kind. Raises ValueError."""
    default = row.value
    if isinstance(default, bool):
        is_on = SWITCHES.get(str(value).lower())
        if is_on is None:
            raise ValueError("expected on or off")
        return is_on
    if isinstance(default, tuple):
        if isinstance(value, list | tuple) and value and all(map(_is_number, value)):
            return tuple(map(float, value))
        raise ValueError(f"expected a list of numbers as {list(default)}")
    if not _is_number(value) or (isinstance(default, int) and not value == int(value) >= 0):
        raise ValueError(f"expected a {'whole ' * isinstance(default, int)}number as {default:g}")
    if value > row.most:
        raise ValueError(f"expected {row.most:g} at most")
    return int(value) if isinstance(default, int) else float(value)


def _is_number(value: Any) -> bool:
    """Whether it is a finite number; ``on`` and ``off`` are none."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < float("inf")
