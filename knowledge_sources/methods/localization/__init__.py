"""Where is the robot, when its pose is unknown or in doubt? In reading order.

What was seen:

* :mod:`views`: views related by the motions between them, and what is before the camera, and not in the building.

Where may the robot be?

* :mod:`pose_candidates`: oriented chamfer matching over rooms, hill climbing, non-maximum suppression.
* :mod:`refinement`: from a candidate to a precise pose, and how likely all views are there.

Which of these poses is it, and what to look at next?

* :mod:`next_view`: the turn, move or way whose view separates the hypotheses best (active localization).
* :mod:`none_of_these`: a place against being at none of those that are searched.
* :mod:`global_localization`: all of the above: found, look again, or ambiguous.
* :mod:`place_odds`: the prior odds of where it was told to be, or was tracked to.

Could a known pose be another one that looks the same?

* :mod:`aliasing`: where the floor plan repeats itself; the pose of the room that is hardest to tell from a known one.
"""

from knowledge_sources.methods.localization.aliasing import (
    compare_places, find_repetitions, list_aliases, precompute_views,
)
from knowledge_sources.methods.localization.camera_matching import (
    CAMERA_LINE_SIGMA_PX, MIN_CAMERA_LINES, match_with_camera, rate_match,
)
from knowledge_sources.methods.localization.global_localization import (
    LocalizationStatus, MAX_HYPOTHESES, MAX_SEARCHED_VIEWS, MIN_LOG_LIKELIHOOD, MIN_P_TRACKED, MIN_VIEWS,
    REFUTING_LOG_RATIO, make_alias_test,
)
from knowledge_sources.methods.localization.next_view import MIN_NEW_VIEW_RAD, MOVE_M
from knowledge_sources.methods.localization.place_odds import (
    LOST_AGAIN_ODDS, MAX_ALIKE_LOG_RATIO, MIN_P_SURE, P_STATED, StatedPlace, compute_prior, weigh_alias_odds,
    weigh_prior,
)
from knowledge_sources.methods.localization.place_search import (
    MAX_FAR_PROBES, MAX_FLOOR_DIFFERENCE_M, MAX_ROOMS, Search, describe, find_far_action, find_odds_used,
    list_rooms, prefer_reachable, protect_place, search,
)
from knowledge_sources.methods.localization.pose_candidates import DISTINCT, are_distinct, get_visibility_map
from knowledge_sources.methods.localization.refinement import ALIKE_LOG_NOISE, compute_pose_likelihood
from knowledge_sources.methods.localization.views import CameraView, propagate_pose, update_obstruction

__all__ = [
    "ALIKE_LOG_NOISE", "CAMERA_LINE_SIGMA_PX", "DISTINCT", "LOST_AGAIN_ODDS", "MAX_ALIKE_LOG_RATIO",
    "MAX_FAR_PROBES", "MAX_FLOOR_DIFFERENCE_M", "MAX_HYPOTHESES", "MAX_ROOMS", "MAX_SEARCHED_VIEWS",
    "MIN_CAMERA_LINES", "MIN_LOG_LIKELIHOOD", "MIN_NEW_VIEW_RAD", "MIN_P_SURE", "MIN_P_TRACKED", "MIN_VIEWS",
    "MOVE_M", "P_STATED", "REFUTING_LOG_RATIO", "CameraView", "LocalizationStatus", "Search", "StatedPlace",
    "are_distinct", "compare_places", "compute_pose_likelihood", "compute_prior", "describe", "find_far_action",
    "find_odds_used", "find_repetitions", "get_visibility_map", "list_aliases", "list_rooms", "make_alias_test",
    "match_with_camera", "precompute_views", "prefer_reachable", "propagate_pose", "protect_place", "rate_match",
    "search", "update_obstruction", "weigh_alias_odds", "weigh_prior",
]
