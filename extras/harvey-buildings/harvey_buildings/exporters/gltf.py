"""A world as glTF 2.0: a mesh for each room and colour, in metres, y up as glTF has it. Written by trimesh."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from world_models.building.geometry.scene import Floats
from world_models.building.world import World

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
