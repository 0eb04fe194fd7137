"""What CameraInfo says of a camera, whole: lens, size, binning, region, and whether its pictures are rectified.

A camera here is a pinhole with at most five terms of distortion (:class:`world_models.camera.Camera`). Pictures of any
other lens that OpenCV knows are rectified as they are read, and are a pinhole's from then on.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from harvey.errors import BadInput
from world_models.camera import Camera

FISHEYE, POLYNOMIAL = ("equidistant", "fisheye"), ("plumb_bob", "rational_polynomial")
TERMS = (4, 5, 8, 12, 14)
"""So many terms a lens has in OpenCV; up to five a camera has here too."""
MOST_BASELINE_M = 0.02
ZOOMS = tuple(1.0 + 0.02 * step for step in range(51))
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Lens:
    """A lens that has to be taken out of the pictures: OpenCV's matrix (3, 3) and terms, and the camera without it."""

    matrix: Floats
    terms: Floats
    is_fisheye: bool
    pinhole: Camera

    def project(self, plane: Floats) -> Floats:
        """Pixels (n, 2) of the raw picture, of points (n, 2) at a distance of 1."""
        points = np.concatenate([plane, np.ones((len(plane), 1))], axis=1)[:, None]
        none = np.zeros(3)
        found, _ = (cv2.fisheye.projectPoints(points, none, none, self.matrix, self.terms) if self.is_fisheye
                    else cv2.projectPoints(points, none, none, self.matrix, self.terms))
        return np.asarray(found, float).reshape(-1, 2)

    def rectify(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """A picture (h, w[, 3]) as the pinhole would have taken it."""
        return np.asarray(cv2.remap(picture, *self._maps, cv2.INTER_LINEAR), np.uint8)

    @cached_property
    def _maps(self) -> tuple[Any, Any]:
        camera = self.pinhole
        make = cv2.fisheye.initUndistortRectifyMap if self.is_fisheye else cv2.initUndistortRectifyMap
        found: tuple[Any, Any] = make(self.matrix, self.terms, np.eye(3), camera.matrix,
                                      (camera.width, camera.height), cv2.CV_32FC1)
        return found


@dataclass(frozen=True, eq=False)
class InfoCamera:
    """A camera by its CameraInfo.

    Attributes:
        camera: what takes the pictures, once ``lens`` is taken out of them; None where nothing is to be taken out.
        turned: (3, 3) from the axes of the camera's frame to those of the pictures: stereo rectification turns them.
    """

    camera: Camera
    lens: Lens | None
    turned: Floats


def find_own_topic(infos: Mapping[str, Any], picture: str, frame: str, size: tuple[int, int]) -> str:
    """The topic of the CameraInfo that belongs to the pictures of a topic, which have a frame and a size [px].

    That is ``camera_info`` beside them; else the only one, of those that differ, with their frame and size. Raises
    BadInput, with the reason.
    """
    parts = picture.split("/")
    own = "/".join([*parts[:-2 if parts[-1].startswith("compressed") else -1], "camera_info"])
    misfits = {topic: _find_misfit(info, frame, size) for topic, info in infos.items()}
    if own in misfits:
        if misfits[own]:
            raise BadInput(f"{own}: expected what {picture} is, got {misfits[own]}; --calibration names a camera file")
        return own
    fitting = [topic for topic, misfit in misfits.items() if not misfit]
    if len({state_of(infos[topic]) for topic in fitting}) == 1:
        return fitting[0]
    told = "; ".join(f"{topic}: {misfit or 'fits'}" for topic, misfit in sorted(misfits.items())[:4])
    raise BadInput(f"{picture}: expected CameraInfo as {own}, or one of its size and frame, got {told or 'none'}; "
                   "--calibration names a camera file")


def state_of(info: Any) -> bytes:
    """All that a CameraInfo says of the camera, to be compared."""
    numbers = [np.asarray(part, float).ravel() for part in (
        info.width, info.height, field(info, "d"), field(info, "k"), field(info, "r"), field(info, "p"), _binning(info),
        _region(info))]
    return np.concatenate(numbers).tobytes() + str(info.distortion_model).encode()


def field(info: Any, name: str) -> Floats:
    """``d``, ``k``, ``r`` or ``p``: ROS 1 writes them large."""
    return np.asarray(getattr(info, name, None) if hasattr(info, name) else getattr(info, name.upper()), float)


def is_rectified(topic: str) -> bool:
    """Whether an image processor took the lens out of the pictures of a topic, by its name: ``image_rect_color``."""
    return re.search(r"(?:^|[/_])rect(?:ified)?(?:[/_]|$)", topic.lower()) is not None


def read_camera_info(info: Any, picture: str) -> InfoCamera:
    """The camera that takes the pictures of a topic. Raises BadInput where it cannot be represented."""
    matrix, projection, turned = (field(info, name) for name in "kpr")
    is_flat = is_rectified(picture)
    if is_flat:
        matrix = projection.reshape(3, 4)[:, :3].ravel()
    name = "P" if is_flat else "K"
    if not (np.all(np.isfinite(matrix)) and matrix[0] > 0.0 and matrix[4] > 0.0):
        raise BadInput(f"CameraInfo: expected {name} of a calibrated camera for {picture}, got fx {matrix[0]:g} and fy "
                       f"{matrix[4]:g}; --calibration names a camera file")
    if abs(matrix[1]) > 1e-6 * matrix[0]:
        raise BadInput(f"CameraInfo: expected {name} without a skew, got {matrix[1]:g} px")
    if is_flat and abs(projection[3]) > MOST_BASELINE_M * projection[0]:
        raise BadInput(f"CameraInfo: expected one camera, or the first of a pair, for {picture}, got one "
                       f"{abs(projection[3] / projection[0]):.3f} m beside it; --calibration names a camera file")
    (across, down), (left, top, _, _), (width, height) = _binning(info), _region(info), size_of(info)
    camera = Camera(matrix[0] / across, matrix[4] / down, (matrix[2] - left - (across - 1) / 2.0) / across,
                    (matrix[5] - top - (down - 1) / 2.0) / down, width, height)
    if is_flat:
        turned = turned.reshape(3, 3) if np.any(turned) else np.eye(3)
        if not np.allclose(turned @ turned.T, np.eye(3), atol=1e-3):
            raise BadInput("CameraInfo: expected a rotation as R, got none")
        return InfoCamera(camera, None, turned)
    return InfoCamera(*_take_lens(info, camera), np.eye(3))


def size_of(info: Any) -> tuple[int, int]:
    """Width and height of the pictures [px], after region and binning."""
    (across, down), (_, _, width, height) = _binning(info), _region(info)
    return width // across, height // down


def _take_lens(info: Any, camera: Camera) -> tuple[Camera, Lens | None]:
    """The camera with the terms of its lens, or without a lens that is to be taken out of the pictures."""
    terms, model = field(info, "d"), str(info.distortion_model).strip().lower()
    is_fisheye = model in FISHEYE
    if not (is_fisheye or model in POLYNOMIAL) and (model not in ("", "none") or np.any(terms)):
        raise BadInput(f"CameraInfo: expected a lens of the model {', '.join((*POLYNOMIAL, *FISHEYE))}, got {model!r}; "
                       "--calibration names a camera file")
    if not np.all(np.isfinite(terms)) or not (
            len(terms) == 4 if is_fisheye else len(terms) in TERMS or not np.any(terms)):
        raise BadInput(f"CameraInfo: expected {'4' if is_fisheye else '4, 5, 8, 12 or 14'} finite terms of the lens "
                       f"{model}, got {terms.tolist()[:14]}")
    if not is_fisheye and not np.any(terms[5:]):
        return (replace(camera, distortion=terms[:5]) if np.any(terms) else camera), None
    for zoom in ZOOMS:
        lens = Lens(camera.matrix, terms, is_fisheye, replace(camera, fx=zoom * camera.fx, fy=zoom * camera.fy))
        if _is_filled(lens, camera):
            return lens.pinhole, lens
    raise BadInput(f"CameraInfo: expected a lens that can be taken out of the whole picture, got {model} with "
                   f"{terms.tolist()}")


def _is_filled(lens: Lens, camera: Camera) -> bool:
    """Whether all of a rectified picture is within the raw one, and the lens nowhere folds it over."""
    edge = lens.pinhole.rays(lens.pinhole.border())[:, :2]
    steps = np.linspace(0.0, 1.0, 41)[1:]
    centre = lens.project(np.zeros((1, 2)))
    seen = np.stack([lens.project(step * edge) for step in steps])
    away = np.linalg.norm(seen - centre, axis=2)
    return bool(np.all(np.diff(away, axis=0) > 0.0) and np.all(camera.inside(seen[-1], -0.5)))


def _find_misfit(info: Any, frame: str, size: tuple[int, int]) -> str:
    said = str(info.header.frame_id).lstrip("/")
    if size_of(info) != size:
        binned = "" if _binning(info) == (1, 1) and not np.any(_region(info)[:2]) else " after its binning and region"
        return f"{size_of(info)[0]} x {size_of(info)[1]} px{binned} for pictures of {size[0]} x {size[1]} px"
    return f"the frame {said!r} for pictures of {frame!r}" if said and frame and said != frame else ""


def _binning(info: Any) -> tuple[int, int]:
    return max(1, int(info.binning_x)), max(1, int(info.binning_y))


def _region(info: Any) -> tuple[int, int, int, int]:
    """Left, top, width and height [px] of the sensor's part that is read, of the whole sensor where none is named."""
    roi = info.roi
    if not (roi.width and roi.height):
        return 0, 0, int(info.width), int(info.height)
    return int(roi.x_offset), int(roi.y_offset), int(roi.width), int(roi.height)
