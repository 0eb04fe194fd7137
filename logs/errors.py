"""What can go wrong with a recording, in words for its user."""

from __future__ import annotations


class RecordingError(ValueError):
    """A recording that cannot be read, written or shown; names the file."""
