"""The mesh on the image plane of a pinhole: an independent check on ``world_models.camera``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.render.mesh import Mesh
from world_models.camera import Camera


@dataclass(frozen=True, eq=False)
class Pinhole:
    """A pinhole camera: focal lengths, principal point and image size [px]; (0, 0) is the first pixel's centre."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int

    @staticmethod
    def of(camera: Camera) -> Pinhole:
        """The pinhole of a camera. Raises ValueError where the camera has lens distortion."""
        if camera.distortion is not None:
            raise ValueError(f"expected a camera without lens distortion, got {camera.distortion}")
        return Pinhole(camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height)


@dataclass(frozen=True, eq=False)
class View:
    """The mesh as linear forms of the pixel (u, v, 1), for one camera pose.

    Attributes:
        facing: (P,) which patches face the camera with their visible side.
        inverse_depths: (P, 3); 1 / z [1/m] at a pixel is ``inverse_depths @ (u, v, 1)``.
        textures: (P, 2, 3); a texture coordinate [m] is ``(textures @ (u, v, 1)) / inverse_depth + bases``.
        bases_m: (P, 2).
        vertices_camera: (V, 3) [m].
        reaches: (P,) minus the camera's distance before a patch's plane [m]; -1 where it does not face the camera.
    """

    facing: NDArray[np.bool_]
    inverse_depths: NDArray[np.float64]
    textures: NDArray[np.float64]
    bases_m: NDArray[np.float64]
    vertices_camera: NDArray[np.float64]
    reaches: NDArray[np.float64]


def project_mesh(mesh: Mesh, lens: Pinhole, rotation: NDArray[np.float64], translation: NDArray[np.float64]) -> View:
    """Project the mesh for a camera at ``camera_from_world`` = (rotation (3, 3), translation (3,) [m])."""
    centre = -rotation.T @ translation
    normals, offsets = mesh.planes_world[:, :3], mesh.planes_world[:, 3]
    beyond = offsets - normals @ centre
    facing = beyond < -1e-6
    reach = np.where(facing, beyond, -1.0)
    return View(
        facing=facing,
        inverse_depths=_pixel_forms(normals @ rotation.T, lens) / reach[:, None],
        textures=_pixel_forms(mesh.axes_world @ rotation.T, lens),
        bases_m=mesh.axes_world @ centre - mesh.origins_m,
        vertices_camera=mesh.vertices_world @ rotation.T + translation,
        reaches=reach,
    )


def _pixel_forms(directions_camera: NDArray[np.float64], lens: Pinhole) -> NDArray[np.float64]:
    """Linear forms (..., 3) of directions d (..., 3): d . ray(u, v) = form @ (u, v, 1)."""
    x, y, z = directions_camera[..., 0], directions_camera[..., 1], directions_camera[..., 2]
    return np.stack([x / lens.fx, y / lens.fy, z - x * lens.cx / lens.fx - y * lens.cy / lens.fy], axis=-1)
