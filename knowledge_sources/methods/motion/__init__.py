"""Routes, clearance and the steering law."""
