"""Where is the floor free? One camera with known mounting, or range sensors, against the model of the building (§4).

In reading order: ``model_floor`` (which point of the floor each pixel shows, and where the model has floor),
``appearance`` (what the floor looks like), ``relief`` (what an earlier picture shows to stand up from it, or to lie on
it), ``standing_regions`` (regions that do not look like it, or stand up from it, and where they stand), ``see_floor``
(all of it for one picture), ``ranges`` (one reading of range sensors), ``floor_map`` (all of that together, and what
a way sweeps of it), ``looks_round`` (from where more can be seen); what stands on it: ``footprints``,
``rivals_on_floor``, ``weigh_sight``, ``weigh_touch``, and ``revise_frame`` (what is known of the locale then).
"""

from knowledge_sources.methods.floor.footprints import (
    MIN_SIDE_M, build_free_floor, build_polygon, list_corners, may_be_there, measure_approach_m, move_thing,
)
from knowledge_sources.methods.floor.ranges import see_ranges
from knowledge_sources.methods.floor.relief import TYPICAL_M
from knowledge_sources.methods.floor.revise_frame import (
    contradicts, is_width, place_walls, redraw, redraw_door, revise_by_difference, revise_by_door, revise_by_report,
    revise_by_thing,
)
from knowledge_sources.methods.floor.see_floor import (
    FLOOR_VIEW_DISTANCE_M, FLOOR_VIEW_TURN_RAD, MotionBetween, Seen, see_free_floor,
)
from knowledge_sources.methods.floor.rivals_on_floor import (
    MAX_FIXED_LOOKS, MIN_MOVED_M, MIN_OBSTACLE_CERTAINTY, enclose, explain_seen_elsewhere, explain_seen_in_patch,
    explain_touch, find_fixed, is_behind, judge_by, judge_thing,
)
from knowledge_sources.methods.floor.floor_map import CELL_M, FloorMap, P_CAMOUFLAGED, Sweep, find_blind, sample_sweep
from knowledge_sources.methods.floor.looks_round import (
    LOOK_PICTURE_S, Lookout, choose_look, find_floor, measure_first_seen_m,
)
from knowledge_sources.methods.floor.weigh_sight import MIN_THING_CERTAINTY, Sight, is_telling
from knowledge_sources.methods.floor.weigh_touch import (
    TOUCH_MARGIN_M, find_touched, locate_touch, touch_again, touch_first,
)

__all__ = [
    "CELL_M", "FLOOR_VIEW_DISTANCE_M", "FLOOR_VIEW_TURN_RAD", "LOOK_PICTURE_S", "MAX_FIXED_LOOKS", "MIN_MOVED_M",
    "MIN_OBSTACLE_CERTAINTY", "MIN_SIDE_M", "MIN_THING_CERTAINTY", "P_CAMOUFLAGED", "TOUCH_MARGIN_M", "TYPICAL_M",
    "FloorMap", "Lookout", "MotionBetween", "Seen", "Sight", "Sweep", "build_free_floor", "build_polygon",
    "choose_look", "contradicts", "enclose", "explain_seen_elsewhere", "explain_seen_in_patch", "explain_touch",
    "find_blind", "find_fixed", "find_floor", "find_touched", "is_behind", "is_telling", "is_width", "judge_by",
    "judge_thing", "list_corners", "locate_touch", "may_be_there", "measure_approach_m", "measure_first_seen_m",
    "move_thing", "place_walls", "redraw", "redraw_door", "revise_by_difference", "revise_by_door", "revise_by_report",
    "revise_by_thing", "sample_sweep", "see_free_floor", "see_ranges", "touch_again", "touch_first",
]
