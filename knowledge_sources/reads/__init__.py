"""What a knowledge source may ask of the board: conditions that it needs, and questions with one answer.

Read ``conditions`` (needs, and what they bind) and ``questions`` first; the others answer for one subject each:
``place_believed``, ``sketches``, ``followed_landmarks``, ``doors_in_view``, ``lost``, ``floor_ahead``,
``motion_between``.
"""

from knowledge_sources.reads.place_believed import (
    PLACED_BY, count_refuted, find_p_not_alias, find_p_there, find_alias, find_search_here, has_only_turned,
)
from knowledge_sources.reads.conditions import (
    Belief, CAMERA, DOUBTED, GOAL, GOING_ON, HELD, LOST, MEASURED, MILESTONE, NOT_ENDED, NOT_GIVEN_UP, NOT_LOST,
    NO_DOUBT_ABOVE, NO_MILESTONE, PICTURE, PLAN_DOUBT, SKETCH, SOUND, STANDING, SURE, UP_TO_DATE, WAY,
)
from knowledge_sources.reads.doors_in_view import (
    MAX_SIGMA_M, MAX_SIGMA_RAD, Watched, find_before_door, find_door_state, list_contradicted, list_doors_in_view,
    list_filed_doors, with_door_open, with_door_shut,
)
from knowledge_sources.reads.floor_ahead import (
    FloorAhead, SEEN_MARGIN_M, find_swept_next, tell_time_s,
)
from knowledge_sources.reads.followed_landmarks import (
    Following, Renewed, find_missing_floors, find_near_frames, post_or_revise, rectify, take_new, tell_worst,
    with_anchors,
)
from knowledge_sources.reads.lost import (
    WHILE_LOST, declare_lost, find_panorama, is_dark, list_contacts, list_views, locate_contact,
)
from knowledge_sources.reads.motion_between import add_reports, bound_wheels_m, find_motion_between
from knowledge_sources.reads.questions import (
    ACTIVE_SKETCH, EMERGENCY_STOPS, OPEN_FAULT, active_goal, current_leg, deepest_sketch, find_belief, find_building,
    find_building_as_filed, find_camera, find_contact, find_difference, find_followed, find_frames, find_robot,
    find_robot_in, find_stop, is_in_doubt, is_over, is_standing, is_up_to_date, is_worth_telling, last_motion,
    name_model, open_discrepancies, open_discrepancy, open_impasse, open_milestone, rests_on, rolling_course,
    unmeasured_doubt,
)
from knowledge_sources.reads.sketches import (
    MAX_LOOK_ERROR_RAD, Way, find_car, find_car_of, find_first_level, find_obstacles, find_planner, find_tried,
    find_way_to_goal, has_missed, is_just_found, list_locales, list_log_odds, name_obstacles, place_of, supersede,
    tell_missed,
)

__all__ = [
    "ACTIVE_SKETCH", "CAMERA", "DOUBTED", "EMERGENCY_STOPS", "GOAL", "GOING_ON", "HELD", "LOST", "MAX_LOOK_ERROR_RAD",
    "MAX_SIGMA_M", "MAX_SIGMA_RAD", "MEASURED", "MILESTONE", "NOT_ENDED", "NOT_GIVEN_UP", "NOT_LOST", "NO_DOUBT_ABOVE",
    "NO_MILESTONE", "OPEN_FAULT", "PICTURE", "PLACED_BY", "PLAN_DOUBT", "SEEN_MARGIN_M", "SKETCH", "SOUND", "STANDING",
    "SURE", "UP_TO_DATE", "WAY", "WHILE_LOST", "Belief", "FloorAhead", "Following", "Renewed", "Watched", "Way",
    "active_goal", "add_reports", "bound_wheels_m", "count_refuted", "current_leg", "declare_lost", "deepest_sketch",
    "find_alias", "find_before_door", "find_belief", "find_building", "find_building_as_filed", "find_camera",
    "find_car", "find_car_of", "find_contact", "find_difference", "find_door_state", "find_first_level",
    "find_followed", "find_frames", "find_missing_floors", "find_motion_between", "find_near_frames", "find_obstacles",
    "find_p_not_alias", "find_p_there", "find_panorama", "find_planner", "find_robot", "find_robot_in",
    "find_search_here", "find_stop", "find_swept_next", "find_tried", "find_way_to_goal", "has_missed",
    "has_only_turned", "is_dark", "is_in_doubt", "is_just_found", "is_over", "is_standing", "is_up_to_date",
    "is_worth_telling", "last_motion", "list_contacts", "list_contradicted", "list_doors_in_view", "list_filed_doors",
    "list_locales", "list_log_odds", "list_views", "locate_contact", "name_model", "name_obstacles",
    "open_discrepancies", "open_discrepancy", "open_impasse", "open_milestone", "place_of", "post_or_revise", "rectify",
    "rests_on", "rolling_course", "supersede", "take_new", "tell_missed", "tell_time_s", "tell_worst",
    "unmeasured_doubt", "with_anchors", "with_door_open", "with_door_shut",
]
