"""Landmarks followed from frame to frame (§5)."""

from knowledge_sources.methods.tracking.edge_alignment import align_to_edges
from knowledge_sources.methods.tracking.template_tracking import (
    TrackUpdate, correct_pose, cut_template, follow_landmarks, select_landmarks,
)
from knowledge_sources.methods.tracking.tolerance import action_px

__all__ = [
    "TrackUpdate", "action_px", "align_to_edges", "correct_pose", "cut_template", "follow_landmarks",
    "select_landmarks",
]
