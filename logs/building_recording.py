"""A recording of nothing but a building: to walk round it in the viewer."""

from __future__ import annotations

from pathlib import Path

import rerun.blueprint as rrb

from logs.blueprint import building_view
from logs.loggers.building import Building
from logs.tape import Tape
from world_models.world import World


def record_building(world: World, out: Path) -> None:
    """Write the building's surfaces, storey by storey, its doorways and room names. Raises RecordingError."""
    look = rrb.Blueprint(building_view(world, world.name), rrb.TimePanel(state="hidden"), auto_views=False)
    tape = Tape(out, f"building of {world.name}", world.name, look)
    try:
        Building(world).begin(tape)
    finally:
        tape.close()
