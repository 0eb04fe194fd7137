"""The building as arrays of one-sided, convex, flat patches, one for each region."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sim.render.textures import POSTER, texture_code
from world_models.camera import Camera

MAX_PATCHES = 32767
"""The rasterizer numbers patches with 16 bits."""

MAX_COPLANAR_M = 1e-6
"""Regions of a face within this distance of a plane share it, so that the later one covers the earlier [m]."""


class RegionLike(Protocol):
    """A flat convex area of one appearance (§3.4): what the mesh reads of a region."""

    @property
    def name(self) -> str: ...
    @property
    def polygon_world(self) -> Any: ...
    @property
    def colour(self) -> Any: ...
    @property
    def texture(self) -> str: ...
    @property
    def texture_scale_m(self) -> float: ...
    @property
    def seed(self) -> int: ...


class FaceLike(Protocol):
    """A face with the regions on its two sides (§3.4): what the mesh reads of a face."""

    @property
    def front(self) -> Sequence[RegionLike]: ...
    @property
    def back(self) -> Sequence[RegionLike]: ...


DRAWN_GREY = 0.6
"""What the simulator draws where a world file says that it knows no colour."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """P patches with V vertices in total.

    Attributes:
        vertices_world: (V, 3) [m], counter-clockwise from the visible side.
        first: (P + 1,) int64; patch i owns the vertices ``first[i]:first[i + 1]``.
        planes_world: (P, 4) unit normal n and offset d of n . p = d; the visible side is n . p > d.
        axes_world: (P, 2, 3) unit texture axes s, t in the plane; t points as far up as the plane allows.
        origins_m: (P, 2) texture coordinates of the texture's origin.
        colours: (P, 3) reflectance, 0..1.
        textures: (P,) int64 codes of :mod:`sim.render.textures`.
        scales_m: (P,) size of the texture's cells.
        seeds: (P,) int64, of the texture's random numbers.
    """

    vertices_world: NDArray[np.float64]
    first: NDArray[np.int64]
    planes_world: NDArray[np.float64]
    axes_world: NDArray[np.float64]
    origins_m: NDArray[np.float64]
    colours: NDArray[np.float64]
    textures: NDArray[np.int64]
    scales_m: NDArray[np.float64]
    seeds: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.textures)


def build_mesh(faces: Iterable[FaceLike]) -> Mesh:
    """Build one patch for each region on each side of each face, in the order given.

    Raises:
        ValueError: a region is not a flat convex polygon of at least three distinct vertices, or has a bad
            colour, texture or scale.
    """
    patches = [patch for face in faces for side in (face.front, face.back) for patch in _side_patches(side)]
    if len(patches) > MAX_PATCHES:
        raise ValueError(f"expected at most {MAX_PATCHES} regions, got {len(patches)}")
    polygons = [polygon for polygon, _, _ in patches]
    planes = np.array([plane for _, plane, _ in patches]).reshape(-1, 4)
    axes = np.array([_texture_axes(plane[:3]) for plane in planes]).reshape(-1, 2, 3)
    regions = [region for _, _, region in patches]
    return Mesh(
        vertices_world=np.concatenate([np.zeros((0, 3)), *polygons]),
        first=np.concatenate([[0], np.cumsum([len(p) for p in polygons])]).astype(np.int64),
        planes_world=planes,
        axes_world=axes,
        origins_m=np.array([_origin(r, p, a) for r, p, a in zip(regions, polygons, axes, strict=True)]).reshape(-1, 2),
        colours=np.array([_colour(r) for r in regions]).reshape(-1, 3),
        textures=np.array([texture_code(r.texture) for r in regions], np.int64),
        scales_m=np.array([_scale(r) for r in regions], np.float64),
        seeds=np.array([r.seed for r in regions], np.int64),
    )


def join_meshes(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh with the patches of several, in order. Raises ValueError for too many patches."""
    count = sum(len(mesh) for mesh in meshes)
    if count > MAX_PATCHES:
        raise ValueError(f"expected at most {MAX_PATCHES} regions, got {count}")
    starts = np.cumsum([0, *(len(mesh.vertices_world) for mesh in meshes)])
    first = [mesh.first[:-1] + start for mesh, start in zip(meshes, starts[:-1], strict=True)]
    rest = [f.name for f in fields(Mesh) if f.name != "first"]
    joined = {name: np.concatenate([getattr(mesh, name) for mesh in meshes]) for name in rest}
    return Mesh(first=np.concatenate([*first, starts[-1:]]), **joined)


def _side_patches(regions: Sequence[RegionLike]) -> list[tuple[NDArray[np.float64], NDArray[np.float64], RegionLike]]:
    """(polygon, plane, region) of one side of a face; coplanar regions get exactly the first one's plane."""
    out: list[tuple[NDArray[np.float64], NDArray[np.float64], RegionLike]] = []
    for region in regions:
        polygon = np.array(region.polygon_world, dtype=np.float64)
        plane = plane_of(polygon, region.name)
        shared = [p for _, p, _ in out if _lies_in(polygon, plane, p)]
        out.append((polygon, shared[0] if shared else plane, region))
    return out


def _lies_in(polygon: NDArray[np.float64], own: NDArray[np.float64], plane: NDArray[np.float64]) -> bool:
    off = np.abs(polygon @ plane[:3] - plane[3])
    return bool(own[:3] @ plane[:3] > 0 and off.max() < MAX_COPLANAR_M)


def plane_of(polygon_world: NDArray[np.float64], name: str = "polygon") -> NDArray[np.float64]:
    """The plane (4,) = (unit normal, offset) of a flat convex polygon (k, 3), by Newell's method.

    Raises:
        ValueError: fewer than three vertices, no area, not flat to 1 mm, or not convex.
    """
    p = np.asarray(polygon_world, float)
    if p.ndim != 2 or p.shape[1] != 3 or len(p) < 3 or not np.all(np.isfinite(p)):
        raise ValueError(f"region {name}: expected at least 3 finite vertices (k, 3), got shape {p.shape}")
    ahead = _advance(p)
    normal = _cross(p - p[0], ahead - p[0]).sum(axis=0)
    length = float(np.linalg.norm(normal))
    if length < 1e-10:
        raise ValueError(f"region {name}: expected a polygon with an area, got none")
    normal = normal / length
    offset = float(np.mean(p @ normal))
    if np.abs(p @ normal - offset).max() > 1e-3:
        raise ValueError(f"region {name}: expected a flat polygon, got vertices up to "
                         f"{np.abs(p @ normal - offset).max():.4f} m off its plane")
    corners = _cross(ahead - p, _advance(ahead) - ahead) @ normal
    if corners.min() < -1e-6:
        raise ValueError(f"region {name}: expected a convex polygon, got a reflex corner")
    return np.array([*normal, offset])


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cross products of rows (n, 3); for few rows faster than ``np.cross``."""
    ax, ay, az = a.T
    bx, by, bz = b.T
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]).T


def _advance(p: NDArray[np.float64]) -> NDArray[np.float64]:
    """The next vertex of each (n, 3); for few rows faster than ``np.roll``."""
    return np.concatenate([p[1:], p[:1]])


def _texture_axes(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2, 3) unit axes: s horizontal in the plane, t up the plane; on floors and ceilings s is world x."""
    x, y, z = normal.tolist()
    level = math.hypot(x, y)
    sx, sy = (-y / level, x / level) if level > 1e-6 else (1.0, 0.0)
    return np.array([[sx, sy, 0.0], [y * 0.0 - z * sy, z * sx - x * 0.0, x * sy - y * sx]])


def _origin(region: RegionLike, polygon: NDArray[np.float64], axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2,) origin of the texture: the world's, so that neighbours continue; for a poster its own corner."""
    return (polygon @ axes.T).min(axis=0) if texture_code(region.texture) == POSTER else np.zeros(2)


def _colour(region: RegionLike) -> NDArray[np.float64]:
    colour = np.asarray(region.colour, float)
    if colour.shape == (3,) and np.all(np.isnan(colour)):
        return np.full(3, DRAWN_GREY)
    if colour.shape != (3,) or not np.all((colour >= 0) & (colour <= 1)):
        raise ValueError(f"region {region.name}: expected a colour of three numbers in 0..1, got {region.colour!r}")
    return colour


def _scale(region: RegionLike) -> float:
    if not region.texture_scale_m > 0:
        raise ValueError(f"region {region.name}: expected texture_scale_m > 0, got {region.texture_scale_m!r}")
    return float(region.texture_scale_m)


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
class MeshView:
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


def project_mesh(
    mesh: Mesh, lens: Pinhole, rotation: NDArray[np.float64], translation: NDArray[np.float64]
) -> MeshView:
    """Project the mesh for a camera at ``camera_from_world`` = (rotation (3, 3), translation (3,) [m])."""
    centre = -rotation.T @ translation
    normals, offsets = mesh.planes_world[:, :3], mesh.planes_world[:, 3]
    beyond = offsets - normals @ centre
    facing = beyond < -1e-6
    reach = np.where(facing, beyond, -1.0)
    return MeshView(
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
