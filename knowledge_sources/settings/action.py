"""Settings of the knowledge sources of the action level (§5)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from knowledge_sources.settings.setting import setting


@dataclass(frozen=True, slots=True)
class ActionSettings:
    """The numbers of the knowledge sources of the action level (§5)."""

    # Tolerance of the action level
    min_tolerance_px: float = setting(
        4.0, "px", "Floor of the tolerance in the image: what correlation alone may be wrong by.",
        "engineering judgement")
    tolerance_sigmas: float = setting(
        3.0, "1", "Standard deviations of the believed pose that the action level may correct.", "§3.2")

    # Motor
    lookahead_m: float = setting(
        1.2, "m", "Distance ahead on the line at which the motor steers (pure pursuit): two increments.",
        "engineering judgement")
    max_heading_error_rad: float = setting(
        math.radians(3.0), "rad", "The motor moves when it faces its aim to within this; else it turns.",
        "engineering judgement")
    max_arrival_heading_error_rad: float = setting(
        math.radians(0.5), "rad", "Largest error of a heading that the goal states.", "engineering judgement")
    max_start_offset_m: float = setting(
        0.15, "m", "From nearer than this the robot returns to the planned line; from further off it draws a new one.",
        "engineering judgement")
    aim_at_end_m: float = setting(
        0.25, "m", "With less than this to go, the motor steers at the end of the leg itself.", "engineering judgement")
    arrival_part: float = setting(
        0.8, "1", "Part of a leg's tolerance within which it has arrived.", "engineering judgement")

    # Floor ahead: motor and path follower
    keeps_to_seen_floor: bool = setting(
        True, "yes/no", "Whether the robot drives only where it has seen the floor free; else it looks or creeps.",
        "§4")
    seen_margin_m: float = setting(
        0.03, "m", "Margin round the robot's disc within which the floor must be seen to be free.",
        "engineering judgement")
    max_seen_age_s: float = setting(
        60.0, "s", "What was seen to be free longer ago must be seen again.", "engineering judgement")
    floor_step_m: float = setting(
        0.04, "m", "On the move the floor is looked at again after so much of the way.", "engineering judgement")
    put_down_free_m: float = setting(
        0.75, "m", "Round where it was put down the floor is free to this distance: a person sees it.",
        "engineering judgement")
    near_model_m: float = setting(
        0.08, "m", "Nearer to a wall or a thing of the model the floor need not be seen.", "engineering judgement")
    min_increment_m: float = setting(
        0.2, "m", "Shortest move at full speed into floor that is seen to be free; less of it is crept.",
        "engineering judgement")
    creep_speed_m_per_s: float = setting(
        0.09, "m/s", "Speed into floor that was not seen to be free.", "engineering judgement")
    max_driven_gap_m: float = setting(
        0.8, "m", "Between two pictures that are no further apart the robot drove straight.", "engineering judgement")
    max_look_error_rad: float = setting(
        math.radians(6.0), "rad", "The robot looks where the floor is to be seen when it faces there to within this.",
        "engineering judgement")
    vague_sigma_m: float = setting(
        0.05, "m", "Sights of an obstacle whose standard deviations differ by this and twofold are not joined.",
        "engineering judgement")
    min_common_directions: float = setting(
        0.6, "1", "A sight without feet tells nothing new where this part of its directions is that of what is known.",
        "engineering judgement")
    min_creep_m: float = setting(
        0.05, "m", "Shortest move into floor that was not seen to be free.", "engineering judgement")
    max_creep_m: float = setting(
        0.6, "m", "Longest move at that speed before the next picture.", "engineering judgement")
    look_ahead_m: float = setting(
        1.1, "m", "So much of the way beyond a leg is looked at before it ends: what is too near to be seen then.",
        "engineering judgement")
    look_from_m: float = setting(
        3.0, "m", "Distance from the end of a leg from which that begins.", "engineering judgement")
    max_looks: int = setting(
        4, "count", "Most looks round on one leg.", "engineering judgement")
    look_turn_rad_per_s: float = setting(
        math.radians(45.0), "rad/s", "How fast the robot turns, as far as the time that a look takes is weighed.",
        "engineering judgement")
    look_picture_s: float = setting(
        0.2, "s", "Time that a picture with its command takes, weighed likewise.", "engineering judgement")

    # Path follower
    rolling_lookahead_m: float = setting(
        0.75, "m", "Distance ahead on the line at which the path follower steers (pure pursuit).",
        "engineering judgement")
    min_rolling_leg_m: float = setting(
        0.3, "m", "Shortest rest of a leg, beyond the stopping distance, that is driven without stopping.",
        "engineering judgement")
    rolling_stop_margin_m: float = setting(
        0.1, "m", "The path follower stops so far before floor that was not seen to be free.", "engineering judgement")
    max_rolling_start_error_rad: float = setting(
        math.radians(3.0), "rad", "The path follower starts when it faces its aim to within this.",
        "engineering judgement")
    max_rolling_error_rad: float = setting(
        math.radians(12.0), "rad", "The path follower stops when its aim is further to the side than this.",
        "engineering judgement")
    max_curvature_per_m: float = setting(
        1.0, "1/m", "Largest curvature that is steered on the move.", "engineering judgement")

    # Dead reckoner
    min_claimed_part: float = setting(
        0.7, "1", "If the wheels claim less than this part of a move, something stopped the robot.",
        "engineering judgement")

    # Correlator tracker
    min_landmarks: int = setting(
        5, "count", "With fewer tracked landmarks than this, new ones are always taken.", "engineering judgement")
    enough_landmarks: int = setting(
        9, "count", "With this many tracked landmarks or more, no new ones are taken.", "engineering judgement")
    min_remaining_part: float = setting(
        0.5, "1", "Between these two, new landmarks are taken below this part of those at the last renewal.",
        "engineering judgement")
    max_template_distance_m: float = setting(
        1.3, "m", "A template is dropped when the robot is further than this from where it was cut: two increments.",
        "Table 1: increments of two feet")
    max_template_distance_rolling_m: float = setting(
        0.8, "m", "The same on the move, where many pictures show the same template.", "engineering judgement")
    max_misses: int = setting(
        2, "count", "A landmark that is not found so many times in a row is dropped.", "engineering judgement")
    min_expected_landmarks: int = setting(
        4, "count", "Fewest expected landmarks that can make a discrepancy.", "engineering judgement")
    min_agreeing_landmarks: int = setting(
        2, "count", "Fewest landmarks that must agree for the belief to be corrected by them; of those that were found"
        " alone, one in 17 was something else.", "34 of them, on drives to and fro in the Research Center")
    min_agreeing_part: float = setting(
        1.0 / 3.0, "1", "If a smaller part of the expected landmarks agrees, tracking has failed.",
        "engineering judgement")
    min_followed_landmarks: int = setting(
        4, "count", "With so many landmarks in the last tracked frame, the robot is taken to be still in its room.",
        "engineering judgement")
    min_drift_stretch_m: float = setting(
        0.3, "m", "Shortest stretch of way from which the drift of the wheels is learnt.", "§3.2")
    min_edge_length_px: float = setting(
        16.0, "px", "Shortest projected model edge that the belief is aligned with before templates are cut.",
        "engineering judgement")
    min_edge_contrast: float = setting(
        0.05, "1", "Smallest contrast of such an edge.", "engineering judgement")
    max_edge_distance_m: float = setting(
        15.0, "m", "Largest distance of such an edge.", "engineering judgement")

    # Elevator rider
    elevator_sigma_m: float = setting(
        0.01, "m", "Standard deviation of where an elevator car stops, from floor to floor.", "engineering judgement")
    elevator_sigma_rad: float = setting(
        0.003, "rad", "Standard deviation of the heading of an elevator car, from floor to floor.",
        "engineering judgement")

    # Obstacle finder
    obstacle_width_m: float = setting(
        0.45, "m", "Width and depth that something touched is taken to have.", "engineering judgement")
    touch_margin_m: float = setting(
        0.05, "m", "A wall or thing of the model that is so much further than the robot's rim explains a contact.",
        "engineering judgement")
    max_touch_sigma_rad: float = setting(
        0.6, "rad", "A contact whose direction is less sure tells of no obstacle.", "engineering judgement")

    min_thing_certainty: float = setting(
        0.5, "1", "What is seen on the floor with less certainty than this tells of no obstacle.",
        "engineering judgement")
    min_obstacle_certainty: float = setting(
        0.9, "1", "With this certainty an obstacle is there: by one sure picture, or by two unsure ones.",
        "engineering judgement")
    act_within_m: float = setting(
        0.7, "m", "What may stand in the next so much of the way is held to be there: nearer it is not seen at all.",
        "the picture's lower border shows floor 1.3 m ahead")
    max_obstacle_certainty: float = setting(
        0.99, "1", "No obstacle is more certain than this, so that what is gone is soon forgotten.",
        "engineering judgement")
    min_gone_certainty: float = setting(
        0.5, "1", "An obstacle that is less certain is gone.", "engineering judgement")
    min_free_part: float = setting(
        0.5, "1", "Part of an obstacle's footprint that must be seen free to tell that it is not there any more.",
        "engineering judgement")
    max_shared_part: float = setting(
        0.25, "1", "Where a thing that is seen takes more of the footprint, the rest seen free tells nothing of it.",
        "engineering judgement")
    free_floor_odds: float = setting(
        0.03, "1", "Odds of an obstacle that is there while all of its footprint is seen free.",
        "engineering judgement")
    min_evidence_interval_s: float = setting(
        0.3, "s", "Pictures that follow each other faster are no further evidence of an obstacle.",
        "engineering judgement")
    max_obstacle_sigma_m: float = setting(
        0.25, "m", "What is seen on the floor with a larger standard deviation is waited for until it is nearer.",
        "engineering judgement")
    max_hull_part: float = setting(
        1.5, "1", "Two sights are of one thing where the hull round both is at most so much larger than both.",
        "engineering judgement")
    obstacle_depth_m: float = setting(
        0.3, "m", "Depth that something is taken to have of which only the near side is seen.", "engineering judgement")
    min_footprint_change_m: float = setting(
        0.1, "m", "A frame is revised when an obstacle's footprint turns out otherwise by so much.",
        "engineering judgement")
    min_height_change_m: float = setting(
        0.15, "m", "The same of its height.", "engineering judgement")
    max_behind_door_m: float = setting(
        4.0, "m", "A thing that is seen through a doorway stands at most so far behind it.", "engineering judgement")

    # Withdrawer
    leg_slack_m: float = setting(
        0.03, "m", "An obstacle that is nearer to a leg than the least clearance by so much blocks it.",
        "engineering judgement")

    # Floor watcher
    max_floor_sigma_m: float = setting(
        0.1, "m", "The floor is looked at while the robot's place is known to this.", "engineering judgement")
    max_floor_sigma_rad: float = setting(
        math.radians(1.0), "rad", "The same of its heading.", "engineering judgement")
    floor_view_distance_m: float = setting(
        0.25, "m", "A picture is kept to compare later ones with when the robot has gone so far since the last.",
        "engineering judgement")

    # Fault handler
    max_fault_s: float = setting(
        30.0, "s", "A fault that lasts longer ends the mission.", "engineering judgement")
    max_broken_motions: int = setting(
        5, "count", "So many motions broken off in a row end the mission.", "engineering judgement", most=8)
    min_retry_wait_s: float = setting(
        0.25, "s", "Pause before the first retry after a fault; each further one is twice as long.",
        "engineering judgement")
    max_retry_wait_s: float = setting(
        2.0, "s", "Longest pause between retries.", "engineering judgement")
