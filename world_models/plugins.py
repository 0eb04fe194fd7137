"""What other installed packages add: found by the entry points of a group, loaded by name."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points
from typing import Any


def list_plugins(group: str) -> tuple[EntryPoint, ...]:
    """The entry points of a group by their names; of several with one name the first."""
    found: dict[str, EntryPoint] = {}
    for point in entry_points(group=group):
        found.setdefault(point.name, point)
    return tuple(found[name] for name in sorted(found))


def load_plugin(point: EntryPoint, what: str) -> Any:
    """What an entry point names.

    Args:
        what: is expected there, as "a fault class"; for the message.

    Raises:
        ImportError: it cannot be imported.
    """
    try:
        return point.load()
    except (ImportError, AttributeError) as error:
        raise ImportError(f"expected {what} at {point.value}, got {error}") from error
