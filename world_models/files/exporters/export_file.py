"""A world written for other programs: the format from the file's ending, or as it was asked for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from world_models.building.plan_view import find_storeys, plan_svg
from world_models.building.world import World
from world_models.files.exporters.geojson import world_geojson
from world_models.words import count

ENDINGS: Mapping[str, tuple[str, ...]] = {
    "rosmap": (".yaml", ".yml"), "svg": (".svg",), "geojson": (".geojson", ".json"), "gltf": (".glb", ".gltf"),
}
RESOLUTION_M = 0.05


class ExportError(ValueError):
    """A world cannot be written as asked: says what was expected and what came."""


def export_world(world: World, out: Path, kind: str | None = None, *, storey: int | None = None,
                 resolution_m: float | None = None, with_things: bool = True) -> str:
    """Write a world; return a sentence of what was written. Raises ExportError, OSError.

    Args:
        kind: one of ``ENDINGS``; from the ending of ``out`` where it is None.
        storey: of a ROS map, from 1 for the lowest.
        resolution_m: of a ROS map: side of a cell.
        with_things: of a ROS map: whether things are occupied.
    """
    kind = kind or _kind_of(out)
    if kind != "rosmap" and (storey is not None or resolution_m is not None or not with_things):
        raise ExportError(f"expected storey, resolution and furniture to be told of a ROS map only, got {kind}")
    if kind == "rosmap":
        return _export_ros_map(world, out, storey, RESOLUTION_M if resolution_m is None else resolution_m, with_things)
    if kind == "gltf":
        return _export_gltf(world, out)
    out.write_text(plan_svg(world) if kind == "svg" else world_geojson(world), encoding="utf-8")
    doorways = len(world.doorways)
    return f"{count(len(world.rooms), 'room')}, {count(doorways, 'open doorway')}, {count(len(world.things), 'thing')}"


def _kind_of(out: Path) -> str:
    for kind, endings in ENDINGS.items():
        if out.suffix.lower() in endings:
            return kind
    endings = tuple(ending for kind in ENDINGS.values() for ending in kind)
    raise ExportError(f"expected a name that ends in {', '.join(endings)}, or --format, got {str(out)!r}")


def _export_ros_map(world: World, out: Path, storey: int | None, resolution_m: float, with_things: bool) -> str:
    from world_models.files.exporters.ros_map import write_ros_map

    if out.suffix.lower() == ".pgm":
        raise ExportError(f"expected the name of the map's .yaml (its .pgm is written beside it), got {str(out)!r}")
    storeys = find_storeys(world)
    floors = "; ".join(f"{number}: floor at {floor_m:.2f} m, with {rooms[0]}"
                       for number, (floor_m, rooms) in enumerate(storeys, 1))
    if storey is None and len(storeys) > 1:
        raise ExportError(f"expected --storey, as a ROS map has one and {world.name} has {len(storeys)} ({floors})")
    if storey is not None and not 1 <= storey <= len(storeys):
        raise ExportError(f"expected a storey of {world.name} ({floors}), got {storey}")
    try:
        return write_ros_map(world, storeys[(storey or 1) - 1][1], out, resolution_m, with_things)
    except ValueError as error:
        raise ExportError(str(error)) from None


def _export_gltf(world: World, out: Path) -> str:
    from world_models.files.exporters.gltf import write_gltf

    try:
        return write_gltf(world, out)
    except ImportError as error:
        raise ExportError(f"glTF needs trimesh: .venv/bin/pip install '.[gltf]' ({error})") from None
