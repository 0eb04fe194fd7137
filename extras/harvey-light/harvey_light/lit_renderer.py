"""Draws a building under light: baked irradiance, and mirror images in shiny floors and panes.

What a shiny floor or a pane shows is the building, seen by the camera's mirror image. A mirrored camera is left-handed.
So it is turned upside down too, which makes it right-handed, and so is its picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from harvey_light.light_map import LightMap
from harvey_light.lit_shading import NO_MIRROR, shade_lit
from sim.render.mesh import MeshView, Pinhole, project_mesh
from sim.render.pieces import Pieces, split_pieces
from sim.render.rasterizer import find_visible_patches, sample_offsets
from sim.render.renderer import HAZE_PER_M, Renderer
from sim.render.textures import background, shade_pieces
from world_models.camera import Camera
from world_models.frames import Pose

Floats = NDArray[np.float64]
MAX_MIRRORS, MIN_MIRROR_PIECES = 3, 60
"""Mirror images in a picture at most, of planes that make up so many pieces of it."""
MIRROR_BLUR_PX = 1.2
"""Standard deviation of a mirror image's blur: polish is not a mirror."""
UPSIDE_DOWN = np.diag([1.0, -1.0, 1.0])


@dataclass(frozen=True, eq=False)
class BakedLight:
    """What light does to the P patches of a mesh, for all pictures.

    Attributes:
        places: where light was computed.
        seen_light: (T, 3) factor on colours there, as seen.
        mirror_planes: (k, 4) planes that reflect.
        mirror_of: (P,) the plane of each patch that reflects, or -1.
        gloss: (P,) factor on what it reflects.
    """

    places: LightMap
    seen_light: NDArray[np.float32]
    mirror_planes: Floats
    mirror_of: NDArray[np.int64]
    gloss: Floats


@dataclass(frozen=True, eq=False, kw_only=True)
class LitRenderer(Renderer):
    """A building under light, ready to be drawn."""

    baked: BakedLight

    def radiance(self, camera: Camera, camera_from_world: Pose) -> NDArray[np.float32]:
        """The noiseless image (height, width, 3), RGB; 1 is the brightness of white in full light."""
        lens = Pinhole.of(camera)
        rotation, translation = np.array(camera_from_world.rotation), np.array(camera_from_world.translation)
        view = project_mesh(self.mesh, lens, rotation, translation)
        pieces = self._pieces(view, lens)
        drawn = self._find_mirrors(pieces)
        mirrors = [self._mirrored(plane, lens, rotation, translation) for plane in drawn]
        return self._shade(view, pieces, lens, drawn, mirrors)

    def _pieces(self, view: MeshView, lens: Pinhole) -> Pieces:
        seen = find_visible_patches(self.mesh, view, lens, self.samples)
        return split_pieces(seen, sample_offsets(self.samples), len(self.mesh))

    def _find_mirrors(self, pieces: Pieces) -> list[int]:
        """The planes whose mirror images the picture needs, those of the largest areas."""
        baked = self.baked
        counts = np.zeros(len(baked.mirror_planes), int)
        reflecting = np.flatnonzero(baked.mirror_of >= 0)
        np.add.at(counts, baked.mirror_of[reflecting], np.diff(pieces.first)[reflecting])
        order = np.argsort(-counts, kind="stable")[:MAX_MIRRORS]
        return [int(plane) for plane in order if counts[plane] >= MIN_MIRROR_PIECES]

    def _mirrored(self, number: int, lens: Pinhole, rotation: Floats, translation: Floats) -> NDArray[np.float32]:
        """(height, width, 3) the building mirrored in a plane, as the camera sees it."""
        plane = self.baked.mirror_planes[number]
        lens, rotation, translation = mirror_camera(lens, rotation, translation, plane)
        view = project_mesh(self.mesh, lens, rotation, translation)
        shown = view.facing & before_plane(self.mesh.vertices_world, self.mesh.first, plane)
        view = replace(view, facing=shown)
        image = self._shade(view, self._pieces(view, lens), lens, [], [])[::-1]
        return np.asarray(cv2.GaussianBlur(np.ascontiguousarray(image), (0, 0), MIRROR_BLUR_PX), np.float32)

    def _shade(self, view: MeshView, pieces: Pieces, lens: Pinhole, drawn: Sequence[int],
               mirrors: Sequence[NDArray[np.float32]]) -> NDArray[np.float32]:
        baked = self.baked
        appearances = self._appearances(view)
        colours = shade_pieces(pieces, appearances, self.noise, HAZE_PER_M)
        image: NDArray[np.float32] = background(pieces.bare)
        grid = baked.places.grid.copy()
        grid[:, :2] -= self.mesh.origins_m
        place = {plane: i for i, plane in enumerate(drawn)}
        glossy = np.array([place.get(int(plane), NO_MIRROR) for plane in baked.mirror_of])
        u, v = np.arange(lens.width), np.arange(lens.height)
        rays = np.sqrt(1.0 + ((u - lens.cx) / lens.fx) ** 2 + (((v - lens.cy) / lens.fy) ** 2)[:, None])
        stack = np.array(mirrors, np.float32) if mirrors else np.zeros((0, 1, 1, 3), np.float32)
        shade_lit(pieces, colours, appearances[:, :11], grid, baked.places.first, baked.seen_light, image, glossy,
                  baked.gloss, view.reaches, stack, rays.astype(np.float32))
        return image


def mirror_camera(
    lens: Pinhole, rotation: Floats, translation: Floats, plane: Floats
) -> tuple[Pinhole, Floats, Floats]:
    """The camera whose picture, with its rows in reverse, shows the building mirrored in a plane (n, d), n . p = d.

    Args:
        rotation, translation: camera_from_world, (3, 3) and (3,) [m].

    Returns its lens, rotation and translation.
    """
    normal, offset = plane[:3], plane[3]
    householder = np.eye(3) - 2.0 * np.outer(normal, normal)
    moved = rotation @ (2.0 * offset * normal) + translation
    upside_down = replace(lens, cy=lens.height - 1.0 - lens.cy)
    return upside_down, UPSIDE_DOWN @ rotation @ householder, UPSIDE_DOWN @ moved


def before_plane(vertices_world: Floats, first: NDArray[np.int64], plane: Floats) -> NDArray[np.bool_]:
    """(P,) which patches reach before a plane by more than a millimetre: only these are seen in it."""
    heights = vertices_world @ plane[:3] - plane[3]
    return np.asarray(np.maximum.reduceat(heights, first[:-1]) > 1e-3)
