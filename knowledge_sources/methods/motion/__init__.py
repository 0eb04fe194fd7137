"""Routes, clearance and the steering law."""

from knowledge_sources.methods.motion.clearance import Clearance, choose_move, limit_speed
from knowledge_sources.methods.motion.pure_pursuit import (
    MAX_HEADING_ERROR_RAD, MAX_LOOK_ERROR_RAD, ROLLING_STOP_MARGIN_M, compute_bearing, count_increment, find_aim,
    find_aim_point, lay_leg, measure_progress, plan_increment, plan_turn, steer_to, update_leg,
)
from knowledge_sources.methods.motion.routes import (
    SLACK_M, compute_free_space, find_bends, find_free_space, find_nearest, is_clear, list_shortest_routes,
)
from knowledge_sources.methods.motion.subgoals import CLEARANCES_M, SubgoalPlanner
from knowledge_sources.methods.motion.ways_left import leads_through, meets

__all__ = [
    "CLEARANCES_M", "MAX_HEADING_ERROR_RAD", "MAX_LOOK_ERROR_RAD", "ROLLING_STOP_MARGIN_M", "SLACK_M", "Clearance",
    "SubgoalPlanner", "choose_move", "compute_bearing", "compute_free_space", "count_increment", "find_aim",
    "find_aim_point", "find_bends", "find_free_space", "find_nearest", "is_clear", "lay_leg", "leads_through",
    "limit_speed", "list_shortest_routes", "measure_progress", "meets", "plan_increment", "plan_turn", "steer_to",
    "update_leg",
]
