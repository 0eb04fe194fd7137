"""Which image line shows which model line (§6.1)?

* :func:`match_lines`     in the image, the projected model moving as a rigid figure: for small pose errors.
* :func:`match_on_floor`  with the three unknowns of a robot on the floor: for larger errors, as perspective bends them.
* :func:`match_in_space`  with all six unknowns of a camera.

All three look for the correspondence of least match error by local search (§6.1.1 to §6.1.4): a start (a Hough
transform in the image, or a robust fit of the pose), the pairs near it, and moves of one pair at a time.

Three lines of a model, of which the data show two, moved by (5, -3) pixels, and the third not at all:

>>> import numpy as np
>>> from knowledge_sources.methods.matching import match_lines
>>> model = np.array([[[100, 100], [100, 220]], [[100, 100], [220, 100]], [[220, 110], [160, 220]]])
>>> data = np.array([[[300, 300], [310, 330]], [[110, 97], [220, 97]], [[105, 102], [105, 210]]])
>>> match = match_lines(model, data)
>>> match.pairs.tolist()
[[0, 2], [1, 1]]
>>> [round(shift) for shift in match.transform.shift_px]
[5, -3]
"""

from knowledge_sources.methods.matching.image_matching import (
    HOUGH_CELLS, HOUGH_STEP_RAD, HOUGH_WINDOW_PX, Match, PairTable, Peak, build_line_table, build_pair_table,
    compute_model_motion, match_lines,
)
from knowledge_sources.methods.matching.matching_kernels import count_cover
from knowledge_sources.methods.matching.pose_matching import (
    CameraParameters, FloorMatch, MAX_NEAR_PAIRS, MAX_START_PAIRS, PoseMatch, build_camera_parameters,
    match_in_space, match_on_floor,
)
from knowledge_sources.methods.matching.search import (
    CHANCE_EXPONENT, CHANCE_LENGTH_PX, MAX_MOVES_PER_PAIR, MIN_GAIN, PairSpace, SearchResult, Similarity2, Terms,
    compute_best_fits, fit_state,
)

__all__ = [
    "CHANCE_EXPONENT", "CHANCE_LENGTH_PX", "HOUGH_CELLS", "HOUGH_STEP_RAD", "HOUGH_WINDOW_PX", "MAX_MOVES_PER_PAIR",
    "MAX_NEAR_PAIRS", "MAX_START_PAIRS", "MIN_GAIN", "CameraParameters", "FloorMatch", "Match", "PairSpace",
    "PairTable", "Peak", "PoseMatch", "SearchResult", "Similarity2", "Terms", "build_camera_parameters",
    "build_line_table", "build_pair_table", "compute_best_fits", "compute_model_motion", "count_cover", "fit_state",
    "match_in_space", "match_lines", "match_on_floor",
]
