"""A floor built in miniworld, as it is drawn by its own OpenGL renderer without a screen."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from harvey.errors import BadInput
from harvey_miniworld.textured_floor import PICTURE_DEPTH_M, PICTURES, SIDES, StandingThing, TexturedFloor
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2


@cache
def load_miniworld() -> Any:
    """The package, told to draw without a screen. Raises BadInput where it or EGL is not there."""
    try:
        import pyglet

        pyglet.options["headless"] = True
        import miniworld.miniworld

        pyglet.window.Window(width=1, height=1, visible=False).close()
    except Exception as error:  # pyglet raises whatever the loader of a library does
        why = " ".join(f"{type(error).__name__}: {error}".split())[:150]
        raise BadInput(f"miniworld cannot draw here ({why}); it needs EGL: apt install libegl1 libgl1-mesa-dri"
                       ) from None
    return miniworld.miniworld


def picture_aspects() -> tuple[float, ...]:
    """Height by width of the portraits."""
    files = [Path(load_miniworld().__file__).parent / "textures" / "portraits" / f"{name}.png" for name in PICTURES]
    sizes = [Image.open(file).size for file in files]
    return tuple(height / width for width, height in sizes)


class DrawnFloor:
    """A floor that is drawn from where a camera stands.

    Miniworld's axes: x to the east, y up, z to the south.
    """

    def __init__(self, floor: TexturedFloor, camera: Camera, mount: CameraMount) -> None:
        """Build it. Raises BadInput where nothing can be drawn here."""
        library = load_miniworld()

        class Env(library.MiniWorldEnv):  # type: ignore[misc, name-defined]
            def _gen_world(self) -> None:
                _build(self, floor)

        self._env = Env(obs_width=camera.width, obs_height=camera.height)
        agent = self._env.agent
        agent.cam_fov_y = math.degrees(2.0 * math.atan(0.5 * camera.height / camera.fy))
        agent.cam_height, agent.cam_fwd_disp = mount.height_m, mount.forward_m
        agent.cam_pitch = -math.degrees(mount.tilt_rad)

    def see(self, pose: Pose2) -> NDArray[np.uint8]:
        """(height, width, 3) red, green, blue, as seen by a robot there."""
        agent = self._env.agent
        agent.pos, agent.dir = np.array([pose.x_m, 0.0, -pose.y_m]), pose.heading_rad
        return np.array(self._env.render_obs())

    def close(self) -> None:
        """Let the context go."""
        self._env.shadow_window.close()


def _build(env: Any, floor: TexturedFloor) -> None:
    library = load_miniworld()
    from miniworld.entity import ImageFrame
    from miniworld.opengl import Texture

    built = {room.name: env.add_rect_room(
        min_x=room.x[0], max_x=room.x[1], min_z=-room.y[1], max_z=-room.y[0], wall_height=room.height_m,
        wall_tex=room.wall, floor_tex=room.floor, ceil_tex=room.ceiling) for room in floor.rooms}
    for door in floor.doorways:
        x0, y0, x1, y1 = floor.passage(door).bounds
        extent = {"min_x": x0, "max_x": x1} if door.side in ("north", "south") else {"min_z": -y1, "max_z": -y0}
        env.connect_rooms(*(built[name] for name in door.between), max_y=door.height_m, **extent)
    for thing in floor.things:
        env.place_entity(_entity(thing), pos=np.array([thing.x_m, 0.0, -thing.y_m]), dir=thing.turn_rad)
    folder = Path(library.__file__).parent / "textures" / "portraits"
    for picture in floor.pictures:
        name = f"portraits/{picture.image}"
        Texture.tex_paths[name] = [str(folder / f"{picture.image}.png")]
        x, y = floor.room(picture.room).on_wall(picture.side, picture.along_m)
        facing = SIDES[picture.side] + math.pi / 2.0
        env.entities.append(ImageFrame(np.array([x, picture.up_m, -y]), facing, name, picture.width_m, PICTURE_DEPTH_M))
    env.place_agent(pos=np.array([0.0, 0.0, 0.0]), dir=0.0)


def _entity(thing: StandingThing) -> Any:
    from miniworld.entity import Box, MeshEnt

    if thing.kind == "box":
        wide, deep, high = thing.size_m
        return Box(color="grey", size=[wide, high, deep])
    return MeshEnt(thing.kind, thing.size_m[2])
