"""Which image line shows which model line (§6.1)?

* :func:`match_lines`     in the image: the projected model moves as a rigid figure. For small pose errors.
* :func:`match_on_floor`  with the three unknowns of a robot on the floor. For larger errors near the camera.
* :func:`match_in_space`  with all six unknowns of the camera.

All three search for the correspondence of least match error by local search (§6.1.1 to §6.1.4).
"""

from knowledge_sources.methods.matching.fit import Similarity2
from knowledge_sources.methods.matching.hough import Peak
from knowledge_sources.methods.matching.image_matching import Match, format_trace, match_lines
from knowledge_sources.methods.matching.pose_matching import FloorMatch, PoseMatch, match_in_space, match_on_floor
from knowledge_sources.methods.matching.search import TraceStep

__all__ = [
    "FloorMatch",
    "Match",
    "Peak",
    "PoseMatch",
    "Similarity2",
    "TraceStep",
    "format_trace",
    "match_in_space",
    "match_lines",
    "match_on_floor",
]
