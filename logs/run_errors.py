"""What can go wrong with a run's files, in words for its user."""

from __future__ import annotations


class BadInput(ValueError):
    """Something the user gave cannot be used: says what was expected and what came. Exit code 2."""


class RecordingError(ValueError):
    """A recording that cannot be read, written or shown; names the file."""
