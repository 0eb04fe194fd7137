"""From the faces of a building and its lighting to a renderer: what shines, where the sun falls, what reflects."""

from __future__ import annotations

import colorsys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from harvey_light.hung_lamps import Lamp, hang_lamps
from harvey_light.irradiance import SKY_COLOUR, SUN_COLOUR, compute_irradiance
from harvey_light.light_map import LightMap, lay_light_map
from harvey_light.lit_renderer import BakedLight, LitRenderer
from harvey_light.lit_shading import NO_MIRROR
from harvey_light.path_traced import PathTracedRenderer
from harvey_light.sun_patches import SunPatch, find_sun_patches
from sim.render.lighting import GAMMA, Lighting
from sim.render.lights import Room
from sim.render.mesh import FaceLike, Mesh, build_mesh, join_meshes, plane_of
from sim.render.rasterizer import sample_offsets
from sim.render.textures import build_noise_table

Floats = NDArray[np.float64]
FLAT_SCALE_M = 1e6
"""Texture scale at which "plain" is one colour."""
LEVEL_M = 0.02
"""A level patch within this height of a room's floor is floor."""
WALL_AREA_M2, WALL_GREY = 0.3, 0.2
"""Upright patches of more area and less difference between their colours are walls."""
MIN_BLUE = 0.8
"""Of a pane's colour; frames are darker."""
PATH_TRACED = Path("runs") / "path-traced"
"""Where path-traced pictures are kept: one of the same building, light and pose is traced once."""


@dataclass(frozen=True, slots=True)
class BakedRenderers:
    """A :class:`~sim.render.lights.LitRenderers`.

    Attributes:
        folder: where path-traced pictures are kept; None: nowhere.
    """

    folder: Path | None = PATH_TRACED

    def check(self, lighting: Lighting) -> None:
        """Raises ValueError where paths are to be traced and Mitsuba is not installed."""
        if lighting.traced_paths and find_spec("mitsuba") is None:
            raise ValueError("with traced_paths it needs Mitsuba: pip install './extras/harvey-light[photo]'")

    def build(
        self, faces: Sequence[FaceLike], lighting: Lighting, rooms: Sequence[Room], samples: int = 8
    ) -> LitRenderer:
        """The renderer of these faces under this light. Raises ValueError for a bad region or number of samples."""
        lamps = hang_lamps(rooms, lighting) if lighting.lamps > 0.0 else ()
        return _Bake(lighting, rooms, self.folder).renderer(faces, lamps, samples)


BAKED = BakedRenderers()


def find_panes(faces: Iterable[FaceLike]) -> NDArray[np.bool_]:
    """(P,) which patches of the mesh of these faces are window panes: bright regions of things named "window"."""
    regions = [region for face in faces for side in (face.front, face.back) for region in side]
    return np.array(["window" in r.name and r.colour[2] > MIN_BLUE for r in regions], dtype=bool)


@dataclass(frozen=True, eq=False)
class _Bake:
    """The light and the rooms of one building."""

    lighting: Lighting
    rooms: Sequence[Room]
    folder: Path | None

    def renderer(self, faces: Sequence[FaceLike], lamps: Sequence[Lamp], samples: int) -> LitRenderer:
        sample_offsets(samples)
        bare, panes = build_mesh(faces), find_panes(faces)
        bare = replace(bare, colours=self._paint(bare, panes))
        solid = join_meshes((bare, _mesh_of_lamps(lamps))) if lamps else bare
        panes = np.concatenate([panes, np.zeros(len(lamps), bool)])
        sources = panes | (np.arange(len(solid)) >= len(bare))
        places = lay_light_map(solid, self.lighting.cell_m)
        light = compute_irradiance(solid, places, self.lighting, lamps, panes, sources)
        light += self._shining(solid, lamps, panes)[places.patch]
        sunny: tuple[SunPatch, ...] = ()
        if self.lighting.sun > 0.0:
            sunny = find_sun_patches(solid, panes, np.array(self.lighting.towards_sun))
        mesh, places, light = self._add_sun(solid, places, light, sunny)
        base = np.concatenate([np.arange(len(solid)), [patch.patch for patch in sunny]]).astype(int)
        planes, mirror_of, gloss = self._find_mirrors(solid, panes)
        seen_light = (light ** (1.0 / GAMMA)).astype(np.float32)
        baked = BakedLight(places, seen_light, planes, mirror_of[base], gloss[base])
        if self.lighting.traced_paths:
            return PathTracedRenderer(
                mesh, mesh.colours, build_noise_table(), samples, baked=baked, solid=solid, panes=panes, lamps=lamps,
                lighting=self.lighting, rays=self.lighting.traced_paths, folder=self.folder)
        return LitRenderer(mesh, mesh.colours, build_noise_table(), samples, baked=baked)

    def _paint(self, mesh: Mesh, panes: NDArray[np.bool_]) -> Floats:
        """(P, 3) colours with those of coloured walls."""
        colours, strength = mesh.colours.copy(), self.lighting.wall_colours
        if strength <= 0.0:
            return colours
        rng = np.random.default_rng([self.lighting.seed, 2])
        corners = [mesh.vertices_world[a:b] for a, b in zip(mesh.first[:-1], mesh.first[1:], strict=True)]
        walls = [p for p, c in enumerate(corners) if abs(mesh.planes_world[p, 2]) < 0.1 and not panes[p]
                 and np.ptp(colours[p]) < WALL_GREY and np.prod(np.sort(np.ptp(c, axis=0))[1:]) > WALL_AREA_M2]
        places = np.array([corners[p].mean(axis=0) + 0.05 * mesh.planes_world[p, :3] for p in walls]).reshape(-1, 3)
        for room in self.rooms:
            hue = np.array(colorsys.hsv_to_rgb(rng.random(), strength * rng.uniform(0.3, 0.7), 1.0))
            inside = shapely.contains_xy(shapely.Polygon(room.outline_world), places[:, 0], places[:, 1])
            inside &= (places[:, 2] > room.floor_m) & (places[:, 2] < room.ceiling_m)
            colours[np.array(walls, int)[inside]] *= hue
        return colours

    def _shining(self, mesh: Mesh, lamps: Sequence[Lamp], panes: NDArray[np.bool_]) -> Floats:
        """(P, 3) what must be added to the irradiance of panels and panes, so that they are seen as bright as they are.
        """
        shining = np.zeros((len(mesh), 3))
        if lamps:
            shining[-len(lamps) :] = [lamp.radiosity for lamp in lamps]
        shining[panes] = self.lighting.sky * SKY_COLOUR
        return np.asarray(shining / np.maximum(mesh.colours**GAMMA, 1e-3))

    def _add_sun(self, mesh: Mesh, places: LightMap, light: Floats, sunny: Sequence[SunPatch],
                 ) -> tuple[Mesh, LightMap, Floats]:
        """The same with a patch more for each that is in the sun; its places are those of the patch that it is on."""
        if not sunny:
            return mesh, places, light
        base = np.array([patch.patch for patch in sunny])
        sun = self.lighting.sun * SUN_COLOUR * (mesh.planes_world[base, :3] @ self.lighting.towards_sun)[:, None]
        sizes = (places.grid[base, 4] * places.grid[base, 5]).astype(int)
        starts = places.first[base]
        own = np.concatenate([np.arange(start, start + n) for start, n in zip(starts, sizes, strict=True)])
        number = np.repeat(np.arange(len(base)), sizes)
        first = np.concatenate([places.first, len(light) + np.concatenate([[0], np.cumsum(sizes)[:-1]])])
        polygons = [patch.polygon_world for patch in sunny]
        sun_mesh = replace(
            mesh, vertices_world=np.concatenate(polygons),
            first=np.concatenate([[0], np.cumsum([len(p) for p in polygons])]).astype(np.int64),
            planes_world=mesh.planes_world[base], axes_world=mesh.axes_world[base], origins_m=mesh.origins_m[base],
            colours=mesh.colours[base], textures=mesh.textures[base], scales_m=mesh.scales_m[base],
            seeds=mesh.seeds[base])
        more = LightMap(
            np.concatenate([places.grid, places.grid[base]]), first,
            np.concatenate([places.points_world, places.points_world[own]]),
            np.concatenate([places.normals_world, places.normals_world[own]]),
            np.concatenate([places.areas_m2, places.areas_m2[own]]),
            np.concatenate([places.patch, len(mesh) + number]))
        return join_meshes((mesh, sun_mesh)), more, np.concatenate([light, light[own] + sun[number]])

    def _find_mirrors(self, mesh: Mesh, panes: NDArray[np.bool_]) -> tuple[Floats, NDArray[np.int64], Floats]:
        """Planes that reflect (k, 4), the plane of each patch or -1, and how strongly it reflects."""
        planes, mirror_of, gloss = mesh.planes_world, np.full(len(mesh), NO_MIRROR), np.zeros(len(mesh))
        if self.lighting.floor_gloss > 0.0:
            levels = np.array(sorted({round(room.floor_m, 3) for room in self.rooms}))
            near = np.abs(planes[:, 3:] - levels).min(axis=1) < LEVEL_M if len(levels) else np.zeros(len(mesh), bool)
            gloss[(planes[:, 2] > 0.999) & near] = self.lighting.floor_gloss
        if self.lighting.glass > 0.0:
            gloss[panes] = self.lighting.glass
        shiny = np.flatnonzero(gloss)
        if not len(shiny):
            return np.zeros((0, 4)), mirror_of, gloss
        _, chosen, inverse = np.unique(np.round(planes[shiny], 3), axis=0, return_index=True, return_inverse=True)
        mirror_of[shiny] = inverse.ravel()
        return planes[shiny[chosen]], mirror_of, gloss


def _mesh_of_lamps(lamps: Sequence[Lamp]) -> Mesh:
    polygons = [lamp.polygon_world for lamp in lamps]
    count = len(lamps)
    return Mesh(
        np.concatenate(polygons), 4 * np.arange(count + 1, dtype=np.int64),
        np.array([plane_of(polygon, "lamp") for polygon in polygons]),
        np.tile(np.array([(1.0, 0.0, 0.0), (0.0, -1.0, 0.0)]), (count, 1, 1)), np.zeros((count, 2)),
        np.full((count, 3), 0.9), np.zeros(count, np.int64), np.full(count, FLAT_SCALE_M), np.zeros(count, np.int64))
