"""What writes a run as one file for other programs: an extra brings it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from logs.run_directory import RunDirectory
from logs.run_errors import BadInput
from world_models.plugins import RUN_EXPORTERS_GROUP, list_absent, load_plugins


@dataclass(frozen=True, slots=True)
class RunExporter:
    """A kind of file.

    Attributes:
        write: writes a run there, and returns the number of messages; raises BadInput and RecordingError.
    """

    write: Callable[[RunDirectory, Path], int]


def find_run_exporter(name: str) -> RunExporter:
    """The one of this name. Raises BadInput, which says what to install, where there is none."""
    if needs := list_absent(RUN_EXPORTERS_GROUP).get(name):
        raise BadInput(f"--{name} needs {needs}")
    exporter: RunExporter = load_plugins(RUN_EXPORTERS_GROUP, RunExporter, name)[name]
    return exporter
