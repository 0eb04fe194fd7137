"""Landmarks followed from frame to frame (§5)."""
