"""Where is the robot, when its pose is unknown or in doubt? In reading order.

What was seen:

* :mod:`views`: views related by the motions between them, and what is before the camera, and not in the building.

Where may the robot be?

* :mod:`pose_candidates`: oriented chamfer matching over rooms, hill climbing, non-maximum suppression.
* :mod:`refinement`: from a candidate to a precise pose, and how likely all views are there.

Which of these poses is it, and what to look at next?

* :mod:`next_view`: the turn, move or way whose view separates the hypotheses best (active localization).
* :mod:`global_localization`: all of the above: found, look again, or ambiguous.
* :mod:`place_odds`: where it was told to be, or was tracked to, as prior odds.

Could a known pose be another one that looks the same?

* :mod:`aliasing`: where the floor plan repeats itself; the pose of the room that is hardest to tell from a known one.
"""

from knowledge_sources.methods.localization.aliasing import (
    compare_places, find_repetitions, list_aliases, precompute_views,
)
from knowledge_sources.methods.localization.camera_matching import match_with_camera, rate_match
from knowledge_sources.methods.localization.global_localization import LocalizationStatus, make_alias_test
from knowledge_sources.methods.localization.next_view import MIN_NEW_VIEW_RAD, MOVE_M
from knowledge_sources.methods.localization.place_odds import StatedPlace, compute_prior, compute_twin_odds, weigh_told
from knowledge_sources.methods.localization.place_search import (
    Search, describe, find_far_action, find_odds_used, list_rooms, prefer_reachable, search,
)
from knowledge_sources.methods.localization.pose_candidates import DISTINCT, are_distinct, get_visibility_map
from knowledge_sources.methods.localization.refinement import compute_pose_likelihood
from knowledge_sources.methods.localization.views import CameraView, propagate_pose, update_obstruction

__all__ = [
    "DISTINCT", "MIN_NEW_VIEW_RAD", "MOVE_M", "CameraView", "LocalizationStatus", "Search", "StatedPlace",
    "are_distinct", "compare_places", "compute_pose_likelihood", "compute_prior", "compute_twin_odds", "describe",
    "find_far_action", "find_odds_used", "find_repetitions", "get_visibility_map", "list_aliases", "list_rooms",
    "make_alias_test", "match_with_camera", "precompute_views", "prefer_reachable", "propagate_pose", "rate_match",
    "search", "update_obstruction", "weigh_told",
]
