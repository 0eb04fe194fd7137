"""What is in a picture: lines, regions, corners, template correlation."""

from knowledge_sources.methods.features.correlation import (
    Correlation, Template, compute_second_peak, correlate, extract_template, lies_inside, measure_corner_strengths,
)
from knowledge_sources.methods.features.lines import LineSegments, SIGMA_ACROSS_PX, find_lines
from knowledge_sources.methods.features.manhattan import RIGHT_ANGLE_RAD, find_level_direction
from knowledge_sources.methods.features.picture import (
    MIN_BRIGHTNESS, MIN_CONTRAST, Rectifier, compute_mean_and_deviation, is_dark, measure_moved, read_picture,
)
from knowledge_sources.methods.features.regions import MAX_VALLEY_SHARE, MIN_MODE_SHARE, segment_regions

__all__ = [
    "MAX_VALLEY_SHARE", "MIN_BRIGHTNESS", "MIN_CONTRAST", "MIN_MODE_SHARE", "RIGHT_ANGLE_RAD", "SIGMA_ACROSS_PX",
    "Correlation", "LineSegments", "Rectifier", "Template", "compute_mean_and_deviation", "compute_second_peak",
    "correlate", "extract_template", "find_level_direction", "find_lines", "is_dark", "lies_inside",
    "measure_corner_strengths", "measure_moved", "read_picture", "segment_regions",
]
