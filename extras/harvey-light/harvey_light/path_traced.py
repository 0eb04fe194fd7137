"""The reference: the same building and light by a path tracer (Mitsuba 3), its pictures kept by pose.

What the fast renderer simplifies is traced here: soft shadows of all lamps, all bounces, blurred reflections. What it
has and this has not: textures of surfaces, and the sun, for which the walls behind the window panes are in the way.
Jakob et al. 2022, "Mitsuba 3 renderer", https://mitsuba-renderer.org.
"""

from __future__ import annotations

import hashlib
import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harvey_light.hung_lamps import Lamp
from harvey_light.irradiance import SKY_COLOUR
from harvey_light.lit_renderer import LitRenderer
from sim.render.lighting import GAMMA, Lighting
from sim.render.mesh import Mesh, Pinhole
from sim.render.renderer import HAZE_PER_M
from world_models.camera import Camera
from world_models.frames import Pose

Floats = NDArray[np.float64]
VARIANT = "scalar_rgb"
"""Of Mitsuba: needs no compiler; ``llvm_ad_rgb`` is faster where LLVM's library is new enough."""
LIFT_M = 2e-4
"""Distance of what lies on a surface from it [m]."""
BOUNCES = 6
ROUGHNESS = 0.12
"""Of a polished floor (the principled model's)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PathTracedRenderer(LitRenderer):
    """A building under light, drawn by a path tracer.

    Attributes:
        solid: its patches, with the lamps last and without patches of sun.
        panes: (P,) which of them are window panes.
        lamps: the lamps.
        lighting: the light.
        rays: paths per pixel.
        folder: where pictures are kept; None: nowhere.
    """

    solid: Mesh
    panes: NDArray[np.bool_]
    lamps: Sequence[Lamp]
    lighting: Lighting
    rays: int = 16
    folder: Path | None = None

    def radiance(self, camera: Camera, camera_from_world: Pose) -> NDArray[np.float32]:
        """The image (height, width, 3), RGB; 1 is the brightness of white in full light.

        Raises:
            ImportError: Mitsuba is not installed.
        """
        path = None if self.folder is None else self.folder / f"{self._key(camera, camera_from_world)}.npy"
        if path is not None and path.exists():
            return np.asarray(np.load(path), np.float32)
        traced = self._trace(Pinhole.of(camera), camera_from_world)
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            part = path.with_suffix(".part.npy")
            np.save(part, traced.astype(np.float16))
            part.replace(path)
            return np.asarray(np.load(path), np.float32)
        return traced

    def _key(self, camera: Camera, pose: Pose) -> str:
        """Of the picture: by all that it depends on."""
        arrays = (self.solid.vertices_world, self.solid.first, self.solid.colours, self.panes, self.baked.gloss,
                  np.array(pose.rotation), np.array(pose.translation))
        text = repr((self.lighting, camera, self.rays, BOUNCES, ROUGHNESS))
        return hashlib.sha256(b"".join(a.tobytes() for a in arrays) + text.encode()).hexdigest()[:32]

    @cached_property
    def _scene(self) -> Any:
        mi = _mitsuba()
        shining = np.zeros((len(self.solid), 3))
        shining[self.panes] = self.lighting.sky * SKY_COLOUR
        if self.lamps:
            shining[-len(self.lamps) :] = [lamp.radiosity for lamp in self.lamps]
        gloss = self.baked.gloss[: len(self.solid)] * ~self.panes
        parts: dict[str, Any] = {"type": "scene"}
        for number, light in enumerate(np.unique(shining[shining.any(axis=1)], axis=0)):
            patches = np.flatnonzero((shining == light).all(axis=1))
            parts[f"source{number}"] = self._shape(patches, {
                "emitter": {"type": "area", "radiance": {"type": "rgb", "value": (light / np.pi).tolist()}}})
        dark = ~shining.any(axis=1)
        colours = {"type": "mesh_attribute", "name": "face_color"}
        parts["matt"] = self._shape(np.flatnonzero(dark & (gloss == 0.0)), {
            "bsdf": {"type": "twosided", "inner": {"type": "diffuse", "reflectance": colours}}})
        for number, shine in enumerate(np.unique(gloss[dark & (gloss > 0.0)])):
            parts[f"shiny{number}"] = self._shape(np.flatnonzero(dark & (gloss == shine)), {
                "bsdf": {"type": "twosided", "inner": {"type": "principled", "base_color": colours,
                                                       "roughness": ROUGHNESS, "specular": 0.5 * float(shine)}}})
        return mi.load_dict({name: part for name, part in parts.items() if part is not None})

    @cached_property
    def _lifted_vertices(self) -> Floats:
        """(V, 3) [m], each patch a little before what it lies on: on one plane neither is seen first."""
        mesh = self.solid
        lows = np.minimum.reduceat(mesh.vertices_world, mesh.first[:-1], axis=0) + LIFT_M
        highs = np.maximum.reduceat(mesh.vertices_world, mesh.first[:-1], axis=0) - LIFT_M
        _, plane_of = np.unique(np.round(mesh.planes_world, 6), axis=0, return_inverse=True)
        below = np.zeros(len(mesh))
        for p in range(len(mesh)):
            before = np.flatnonzero(plane_of.ravel()[:p] == plane_of.ravel()[p])
            over = np.sum((lows[before] < highs[p]) & (highs[before] > lows[p]), axis=1) >= 2
            below[p] = np.count_nonzero(over)
        lift = np.repeat(LIFT_M * below, np.diff(mesh.first))
        return np.asarray(mesh.vertices_world + lift[:, None] * np.repeat(
            mesh.planes_world[:, :3], np.diff(mesh.first), axis=0))

    def _shape(self, patches: NDArray[np.intp], more: dict[str, Any]) -> Any:
        """A Mitsuba mesh of these patches as fans of triangles, with their colours; None of none."""
        if not len(patches):
            return None
        mi, mesh = _mitsuba(), self.solid
        spans = [(int(mesh.first[p]), int(mesh.first[p + 1])) for p in patches]
        triangles = np.array([(a, k, k + 1) for a, b in spans for k in range(a + 1, b - 1)])
        owner = np.repeat(patches, [b - a - 2 for a, b in spans])
        used, faces = np.unique(triangles, return_inverse=True)
        properties = mi.Properties()
        for name, value in more.items():
            properties[name] = mi.load_dict(value)
        shape = mi.Mesh("patches", len(used), len(triangles), props=properties)
        values = mi.traverse(shape)
        values["vertex_positions"] = self._lifted_vertices[used].astype(np.float32).ravel()
        values["faces"] = faces.reshape(-1, 3).astype(np.uint32).ravel()
        values.update()
        shape.add_attribute("face_color", 3, (mesh.colours[owner] ** GAMMA).astype(np.float32).ravel())
        return shape

    def _trace(self, lens: Pinhole, camera_from_world: Pose) -> NDArray[np.float32]:
        mi = _mitsuba()
        back = camera_from_world.inverse()
        to_world = np.eye(4)
        # Mitsuba looks along +z with x to the left and y up, OpenCV with x to the right and y down
        to_world[:3, :3] = np.array(back.rotation) @ np.diag([-1.0, -1.0, 1.0])
        to_world[:3, 3] = np.array(back.translation)
        field = float(np.degrees(2.0 * np.arctan(0.5 * lens.width / lens.fx)))
        sensor = mi.load_dict({
            "type": "perspective", "fov_axis": "x", "fov": field,
            "to_world": mi.ScalarTransform4f(to_world), "near_clip": 0.02, "far_clip": 1000.0,
            "principal_point_offset_x": (lens.cx + 0.5) / lens.width - 0.5,
            "principal_point_offset_y": (lens.cy + 0.5) / lens.height - 0.5,
            "film": {"type": "hdrfilm", "width": lens.width, "height": lens.height, "rfilter": {"type": "box"},
                     "pixel_format": "rgb", "component_format": "float32"},
            "sampler": {"type": "independent", "sample_count": self.rays}})
        integrator = mi.load_dict({"type": "aov", "aovs": "far:depth",
                                   "img": {"type": "path", "max_depth": BOUNCES + 1}})
        image = np.array(mi.render(self._scene, sensor=sensor, integrator=integrator, spp=self.rays, seed=0))
        u, v = np.arange(lens.width), np.arange(lens.height)
        rays = np.sqrt(1.0 + ((u - lens.cx) / lens.fx) ** 2 + (((v - lens.cy) / lens.fy) ** 2)[:, None])
        haze = 1.0 + HAZE_PER_M * image[..., 3] / rays
        radiosity = np.pi * np.maximum(image[..., :3], 0.0)
        return np.asarray(radiosity ** (1.0 / GAMMA) / haze[..., None], np.float32)


def _mitsuba() -> Any:
    """The package. Raises ImportError where it is not installed."""
    mi = importlib.import_module("mitsuba")
    if mi.variant() != VARIANT:
        mi.set_variant(VARIANT)
    return mi
