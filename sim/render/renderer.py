"""Renders what a pinhole camera in the building sees; the same pose gives the same bytes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim.render.mesh import FaceLike, Mesh, MeshView, Pinhole, build_mesh, join_meshes, project_mesh
from sim.render.pieces import split_pieces
from sim.render.rasterizer import find_visible_patches, sample_offsets
from sim.render.textures import build_noise_table, shade
from world_models.camera import Camera
from world_models.frames import Pose

AMBIENT = 0.55
"""Light on every surface, 0..1."""
LAMPS = (
    ((0.80, 0.30, 0.52), 0.26),
    ((-0.10, 0.55, 0.83), 0.12),
    ((0.10, -0.70, 0.70), 0.12),
    ((0.0, 0.0, -1.0), 0.15),
)
"""(unit direction to the lamp in the world frame, strength); the last is the floor, which lights the ceiling."""

HAZE_PER_M = 0.012
"""Brightness is divided by 1 + haze * depth."""


@dataclass(frozen=True, eq=False)
class Renderer:
    """A building, ready to be drawn.

    Attributes:
        mesh: its patches.
        light: (P, 3) colour times illumination of each patch, 0..1.
        noise: the table of the textures' value noise.
        samples: samples per pixel, 1, 4, 8 or 16.
        brightness: factor on all light, as seen.
    """

    mesh: Mesh
    light: NDArray[np.float64]
    noise: NDArray[np.float32]
    samples: int = 8
    brightness: float = 1.0

    @staticmethod
    def of_faces(faces: Iterable[FaceLike], samples: int = 8, brightness: float = 1.0) -> Renderer:
        """The renderer of these faces. Raises ValueError for a bad region or number of samples."""
        sample_offsets(samples)
        mesh = build_mesh(faces)
        return Renderer(mesh, _light(mesh, brightness), build_noise_table(), samples, brightness)

    def with_faces(self, faces: Sequence[FaceLike]) -> Renderer:
        """The renderer of the same building with more faces. Raises ValueError for a bad region."""
        if not faces:
            return self
        more = build_mesh(faces)
        light = np.concatenate([self.light, _light(more, self.brightness)])
        return replace(self, mesh=join_meshes((self.mesh, more)), light=light)

    def radiance(self, camera: Camera, camera_from_world: Pose) -> NDArray[np.float32]:
        """The noiseless image (height, width, 3), RGB in 0..1."""
        lens = Pinhole.of(camera)
        view = project_mesh(self.mesh, lens, camera_from_world.rotation, camera_from_world.translation)
        pieces = split_pieces(
            find_visible_patches(self.mesh, view, lens, self.samples), sample_offsets(self.samples), len(self.mesh)
        )
        image: NDArray[np.float32] = shade(pieces, self._appearances(view), self.noise, HAZE_PER_M)
        return image

    def image(self, camera: Camera, camera_from_world: Pose) -> NDArray[np.uint8]:
        """The noiseless image (height, width, 3), RGB, uint8."""
        return (self.radiance(camera, camera_from_world) * 255.0 + 0.5).astype(np.uint8)

    def _appearances(self, view: MeshView) -> NDArray[np.float64]:
        """(P, 17) the parameters of each patch for :func:`sim.render.textures.shade`."""
        mesh = self.mesh
        columns = (view.inverse_depths, view.textures.reshape(-1, 6), view.bases_m, 1.0 / mesh.scales_m[:, None],
                   self.light, mesh.textures[:, None], mesh.seeds[:, None])
        return np.concatenate(columns, axis=1)


def _light(mesh: Mesh, brightness: float) -> NDArray[np.float64]:
    return np.asarray(mesh.colours * (brightness * illumination(mesh.planes_world[:, :3])[:, None]))


def illumination(normals_world: NDArray[np.float64]) -> NDArray[np.float64]:
    """Light (n,), 0..1, on surfaces with normals (n, 3) in the world frame."""
    lit = [strength * np.maximum(0.0, normals_world @ np.array(towards)) for towards, strength in LAMPS]
    total: NDArray[np.float64] = np.minimum(1.0, AMBIENT + np.sum(lit, axis=0))
    return total
