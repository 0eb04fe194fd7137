"""Landmarks followed from frame to frame (§5)."""

from knowledge_sources.methods.tracking.edge_alignment import align_to_edges
from knowledge_sources.methods.tracking.template_tracking import (
    MAX_LANDMARK_DISTANCE_M, MAX_TRACKS, MIN_SPACING_PX, TEMPLATE_HALF_PX, TOLERANCE_SIGMAS, TrackUpdate, action_px,
    correct_pose, cut_template, follow_landmarks, select_landmarks,
)

__all__ = [
    "MAX_LANDMARK_DISTANCE_M", "MAX_TRACKS", "MIN_SPACING_PX", "TEMPLATE_HALF_PX", "TOLERANCE_SIGMAS",
    "TrackUpdate", "action_px", "align_to_edges", "correct_pose", "cut_template", "follow_landmarks",
    "select_landmarks",
]
