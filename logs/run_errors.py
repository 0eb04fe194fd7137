"""What can go wrong with a run's files, in words for its user."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

UNREADABLE = (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError)
"""What reading a value raises that has other fields than this version writes."""


class BadInput(ValueError):
    """Something the user gave cannot be used: says what was expected and what came. Exit code 2."""


class RecordingError(ValueError):
    """A recording that cannot be read, written or shown; names the file."""


@contextmanager
def reading(journal: Path | str) -> Iterator[None]:
    """Raises BadInput where what is read of a run in this block is not as this version writes it."""
    try:
        yield
    except (BadInput, RecordingError):
        raise
    except UNREADABLE as error:
        raise BadInput(f"{journal}: expected entries as this version writes them, got others ({error!r})") from error
