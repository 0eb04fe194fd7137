"""A recording of nothing but a building: to walk round it in the viewer."""

from __future__ import annotations

from pathlib import Path

import rerun.blueprint as rrb

from logs.recording.loggers.surroundings.building import building_view, log_building
from logs.recording.stream import RecordingStream
from world_models.building.world import World


def record_building(world: World, out: Path) -> None:
    """Write the building's surfaces, storey by storey, its doorways and room names. Raises RecordingError."""
    look = rrb.Blueprint(building_view(world, world.name), rrb.TimePanel(state="hidden"), auto_views=False)
    stream = RecordingStream(out, f"building of {world.name}", world.name, look)
    try:
        log_building(stream, world)
    finally:
        stream.close()
