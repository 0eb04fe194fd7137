"""The camera file: intrinsics, lens and mounting from ``harvey calibrate``, as TOML that people may edit."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

from world_models.camera import NOT_STATED, Camera, CameraDeviation, CameraMount
from world_models.files.toml.source import Node, Source, WorldError

PINHOLE = ("fx_px", "fy_px", "cx_px", "cy_px")
SIZE = ("width_px", "height_px")


class CameraFileError(WorldError):
    """A camera file that cannot be read: names file, line, what was expected and what was got."""


class CameraFile(NamedTuple):
    """What a camera file says.

    Attributes:
        camera: intrinsics and lens.
        mount: how it is mounted, where the file says.
        deviation: how well it is known; 0 where the file does not say.
    """

    camera: Camera
    mount: CameraMount | None
    deviation: CameraDeviation


def load_camera(path: Path) -> CameraFile:
    """The camera of a file, its mounting, and how well both are known.

    Raises:
        CameraFileError: the file is missing or malformed.
    """
    try:
        root = Source.read(path).root.table(("camera",), ("mount", "deviation"))
        camera, mount, deviation = _read_camera(root["camera"]), root.get("mount"), root.get("deviation")
        return CameraFile(camera, None if mount is None else _read_mount(mount),
                          NOT_STATED if deviation is None else _read_deviation(deviation, camera))
    except WorldError as error:
        raise CameraFileError(str(error)) from None


def camera_text(
    camera: Camera, mount: CameraMount | None, notes: tuple[str, ...] = (), deviation: CameraDeviation | None = None
) -> str:
    """The text of a camera file; :func:`load_camera` reads the same numbers back."""
    values = (camera.fx, camera.fy, camera.cx, camera.cy)
    lines = [*(f"# {note}".rstrip() for note in notes), "", "[camera]",
             f"width_px = {camera.width}", f"height_px = {camera.height}",
             *(f"{key} = {float(value)!r}" for key, value in zip(PINHOLE, values, strict=True))]
    if camera.distortion is not None:
        terms = ", ".join(repr(float(k)) for k in camera.distortion)
        lines.append(f"distortion = [{terms}]  # k1, k2, p1, p2, k3, as OpenCV has them")
    if mount is not None:
        lines += ["", "[mount]", f"height_m = {float(mount.height_m)!r}  # optical centre above the floor",
                  f"forward_m = {float(mount.forward_m)!r}  # ahead of the axis that the robot turns about",
                  f"tilt_deg = {math.degrees(mount.tilt_rad)!r}  # downward"]
        turned = (("roll_deg", mount.roll_rad, "its right side low"), ("yaw_deg", mount.yaw_rad, "to the left"))
        lines += [f"{key} = {math.degrees(angle)!r}  # {what}" for key, angle, what in turned if angle]
    if deviation is not None and deviation != NOT_STATED:
        stated = {"focal_px": deviation.focal * camera.fx, "height_m": deviation.height_m,
                  "forward_m": deviation.forward_m, "tilt_deg": math.degrees(deviation.tilt_rad),
                  "roll_deg": math.degrees(deviation.roll_rad), "yaw_deg": math.degrees(deviation.yaw_rad)}
        lines += ["", "[deviation]  # standard deviations",
                  *(f"{key} = {float(value)!r}" for key, value in stated.items() if value > 0.0)]
    return "\n".join(lines).lstrip("\n") + "\n"


def _read_camera(node: Node) -> Camera:
    node.table((*SIZE, *PINHOLE), ("distortion",))
    width, height = (_read_pixels(node[key]) for key in SIZE)
    fx, fy = (node[key].number(1.0, 1e6) for key in PINHOLE[:2])
    cx, cy = (node[key].number(-1e5, 1e5) for key in PINHOLE[2:])
    distortion = node.get("distortion")
    terms = None if distortion is None else distortion.numbers((4, 5), -1e3, 1e3)
    return Camera(fx, fy, cx, cy, width, height, terms)


def _read_mount(node: Node) -> CameraMount:
    node.table(("height_m",), ("forward_m", "tilt_deg", "roll_deg", "yaw_deg"))
    forward = node["forward_m"].number(-10.0, 10.0) if "forward_m" in node else 0.0
    tilt = node["tilt_deg"].number(-89.0, 89.0) if "tilt_deg" in node else 0.0
    roll, yaw = (node[key].number(-89.0, 89.0) if key in node else 0.0 for key in ("roll_deg", "yaw_deg"))
    return CameraMount(node["height_m"].number(0.01, 10.0), forward, math.radians(tilt), math.radians(roll),
                       math.radians(yaw))


def _read_deviation(node: Node, camera: Camera) -> CameraDeviation:
    known = {"focal_px": camera.fx, "height_m": 1.0, "forward_m": 1.0,
             **dict.fromkeys(("tilt_deg", "roll_deg", "yaw_deg"), 30.0)}
    node.table((), tuple(known))
    stated = {key: node[key].number(0.0, most) if key in node else 0.0 for key, most in known.items()}
    return CameraDeviation(math.radians(stated["tilt_deg"]), stated["height_m"], stated["forward_m"],
                           stated["focal_px"] / camera.fx, math.radians(stated["roll_deg"]),
                           math.radians(stated["yaw_deg"]))


def _read_pixels(node: Node) -> int:
    value = node.number(2, 16384)
    if value != int(value):
        raise node.fail("a whole number of pixels")
    return int(value)
