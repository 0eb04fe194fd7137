"""A recording of nothing but a building: to walk round it in the viewer."""

from __future__ import annotations

from pathlib import Path

import rerun.blueprint as rrb

from logs.recording.loggers.surroundings.building import building_view, log_building
from logs.recording.stream import RecordingStream
from world_models.building.world import World


def record_building(world: World, out: Path, title: str | None = None) -> None:
    """Write the building's surfaces, storey by storey, its doorways and room names. Raises RecordingError.

    ``title``: of the recording, the world's name by default; a viewer keeps recordings with different titles apart.
    """
    look = rrb.Blueprint(building_view(world, world.name), rrb.TimePanel(state="hidden"), auto_views=False)
    stream = RecordingStream(out, f"building of {title or world.name}", title or world.name, look)
    try:
        log_building(stream, world)
    finally:
        stream.close()
