"""A world written for other programs: the format from the file's ending, or as it was asked for.

glTF 2.0 is written here, by trimesh: a mesh for each room and colour, in metres, y up as glTF has it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from harvey_buildings.formats.geojson import world_geojson
from world_models.building.geometry.scene import Floats
from world_models.building.plan_view import find_storeys, plan_svg
from world_models.building.world import World
from world_models.plugins import list_plugins, load_plugins
from world_models.words import count

ENDINGS: Mapping[str, tuple[str, ...]] = {
    "rosmap": (".yaml", ".yml"), "svg": (".svg",), "geojson": (".geojson", ".json"), "gltf": (".glb", ".gltf"),
}
RESOLUTION_M = 0.05
GROUP = "harvey.exporters"


@runtime_checkable
class Exporter(Protocol):
    """Writes a world; returns a sentence of what was written. Raises ExportError, OSError."""

    def __call__(self, world: World, out: Path, /, **options: Any) -> str:
        """``options``: of a ROS map only."""


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
    options = {"storey": storey, "resolution_m": resolution_m, "with_things": with_things} if kind == "rosmap" else {}
    if kind != "rosmap" and (storey is not None or resolution_m is not None or not with_things):
        raise ExportError(f"expected storey, resolution and furniture to be told of a ROS map only, got {kind}")
    made: str = load_plugins(GROUP, Exporter, kind)[kind](world, out, **options)
    return made


def list_formats() -> tuple[str, ...]:
    """The names of all formats, those of other packages too."""
    return tuple(list_plugins(GROUP))


def _kind_of(out: Path) -> str:
    endings = dict(ENDINGS) | {name: (f".{name}",) for name in list_formats() if name not in ENDINGS}
    for kind, own in endings.items():
        if out.suffix.lower() in own:
            return kind
    names = ", ".join(ending for own in endings.values() for ending in own)
    raise ExportError(f"expected a name that ends in {names}, or --format, got {str(out)!r}")


def export_svg(world: World, out: Path) -> str:
    """The plan, storey beside storey."""
    out.write_text(plan_svg(world), encoding="utf-8")
    return _inventory(world)


def export_geojson(world: World, out: Path) -> str:
    """Rooms, doorways, things and links, in metres."""
    out.write_text(world_geojson(world), encoding="utf-8")
    return _inventory(world)


def _inventory(world: World) -> str:
    doorways = len(world.doorways)
    return f"{count(len(world.rooms), 'room')}, {count(doorways, 'open doorway')}, {count(len(world.things), 'thing')}"


def export_ros_map(world: World, out: Path, storey: int | None = None, resolution_m: float | None = None,
                   with_things: bool = True) -> str:
    """A storey as a ROS map: its .yaml, and its .pgm beside it."""
    from harvey_buildings.formats.ros_map_file import write_ros_map

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
        return write_ros_map(world, storeys[(storey or 1) - 1][1], out,
                             RESOLUTION_M if resolution_m is None else resolution_m, with_things)
    except ValueError as error:
        raise ExportError(str(error)) from None


def export_gltf(world: World, out: Path) -> str:
    """All surfaces with their colours."""
    try:
        return write_gltf(world, out)
    except ImportError as error:
        raise ExportError(f"glTF needs trimesh: .venv/bin/pip install trimesh ({error})") from None


GREY = (153, 153, 153)
"""Of a surface whose colour the model does not know."""
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""From x east, y north, z up to x east, y up, z south (glTF 2.0, section 3.4)."""

Colour = tuple[int, int, int]
"""Red, green, blue in 0..255, as a picture has them."""


def write_gltf(world: World, out: Path) -> str:
    """Write all surfaces as .glb, or as .gltf with its data within; return what was written.

    Surfaces are seen from their fronts only, so that one looks into the rooms from above. Raises ImportError where
    trimesh is missing, OSError.
    """
    import trimesh
    from trimesh.exchange import gltf
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    scene = trimesh.Scene()
    groups: dict[tuple[str, Colour], list[Floats]] = {}
    for face in world.faces:
        for region in (*face.front, *face.back):
            groups.setdefault((face.locale, _known(region.colour)), []).append(region.polygon_world)
    for number, ((room, colour), polygons) in enumerate(sorted(groups.items(), key=lambda group: group[0])):
        vertices, triangles = _triangles(polygons)
        material = PBRMaterial(name=bytes(colour).hex(), metallicFactor=0.0, roughnessFactor=1.0, doubleSided=False,
                               baseColorFactor=(*colour, 255))
        mesh = trimesh.Trimesh(vertices @ Y_UP.T, triangles, process=False, visual=TextureVisuals(material=material))
        scene.add_geometry(mesh, node_name=f"{room}/{number}", geom_name=f"{room}/{number}")
    if out.suffix.lower() == ".glb":
        out.write_bytes(gltf.export_glb(scene, tree_postprocessor=_colour))
    else:
        files: dict[str, Any] = gltf.export_gltf(scene, merge_buffers=True, embed_buffers=True,
                                                 tree_postprocessor=_colour)
        out.write_text(json.dumps(json.loads(files["model.gltf"])), encoding="utf-8")
    surfaces = sum(len(polygons) for polygons in groups.values())
    return f"{surfaces} surfaces in {len(groups)} meshes; colours, no textures"


def _known(colour: Sequence[float]) -> Colour:
    if any(math.isnan(c) for c in colour):
        return GREY
    red, green, blue = (round(255 * c) for c in colour)
    return red, green, blue


def _colour(tree: dict[str, Any]) -> None:
    """Give each material the colour that it is named after: trimesh rounds linear colours to 1/255, too coarse."""
    for material in tree["materials"]:
        red, green, blue = (_linear(value / 255.0) for value in bytes.fromhex(material["name"]))
        material["pbrMetallicRoughness"]["baseColorFactor"] = [red, green, blue, 1.0]


def _linear(value: float) -> float:
    """A share of red, green or blue as glTF has it: linear, where a picture's is sRGB (IEC 61966-2-1)."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def _triangles(polygons: Sequence[Floats]) -> tuple[Floats, Any]:
    """Corners (n, 3) and triangles (t, 3) of convex polygons, each a fan round its first corner."""
    starts = np.cumsum([0, *(len(polygon) for polygon in polygons)])
    fans = [start + np.array([(0, i, i + 1) for i in range(1, len(polygon) - 1)])
            for start, polygon in zip(starts, polygons, strict=False)]
    return np.concatenate(polygons), np.concatenate(fans)
