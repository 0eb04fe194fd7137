"""Is a door of the model open or shut? What a picture shows in its opening (§4: models are incomplete).

In reading order:

* :mod:`rival_views`: how well a leaf explains what is seen, and what is beyond;
* :mod:`leaf`: the part of a picture that looks through a doorway; is what the model has beyond seen there, or a leaf?
* :mod:`belief`: from the pictures of a door to its state; does a shut door explain a picture that is not as expected?
"""

from knowledge_sources.methods.doors.belief import (
    MAX_LOG_ODDS, MAX_TOUCH_M, MIN_FEW_LINES, MIN_LOG_RATIO, PRIOR_LOG_ODDS, SHUT_LOG_ODDS, explain_picture,
    is_explained, is_in_opening, is_near, touch_door, update_door,
)
from knowledge_sources.methods.doors.leaf import describe, is_in_view, measure_opening, predict_opening, weigh_leaf

__all__ = [
    "MAX_LOG_ODDS", "MAX_TOUCH_M", "MIN_FEW_LINES", "MIN_LOG_RATIO", "PRIOR_LOG_ODDS", "SHUT_LOG_ODDS", "describe",
    "explain_picture", "is_explained", "is_in_opening", "is_in_view", "is_near", "measure_opening", "predict_opening",
    "touch_door", "update_door", "weigh_leaf",
]
