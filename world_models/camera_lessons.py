"""What was believed of the camera and has turned out wrong, in words and numbers (§3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from world_models.camera import CAMERA_UNKNOWNS, subtract_cameras
from world_models.entries.robot import CameraState

MIN_SIGMAS = 3.0
"""What is off by less than so many standard deviations is as believed."""
WORTH_TELLING = (math.radians(0.1), math.radians(0.1), math.radians(0.2), 0.005, 0.005, 2.0, 2.0)
"""Nor is less than this told; in the order of ``CAMERA_UNKNOWNS``."""
WORDS = (("looks", "degrees lower", "degrees higher"), ("is rolled by", "degrees clockwise", "degrees anticlockwise"),
         ("looks", "degrees further left", "degrees further right"), ("is", "mm higher", "mm lower"),
         ("has a focal length", "% longer", "% shorter"),
         ("has its principal point", "px further right", "px further left"),
         ("has its principal point", "px lower", "px higher"))
"""How each is told: a verb, and what a positive and a negative difference is."""
SCALES = (*[math.degrees(1.0)] * 3, 1000.0, 100.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class CameraLesson:
    """One thing about the camera that is otherwise than told.

    Attributes:
        what: which of :data:`~world_models.camera.CAMERA_UNKNOWNS`.
        off: by how much it is more than told [rad, m, part of the focal length, px].
        sigma: standard deviation of that.
    """

    what: str
    off: float
    sigma: float

    def text(self) -> str:
        """``camera looks 1.10 degrees lower than told (+-0.03)``."""
        i = CAMERA_UNKNOWNS.index(self.what)
        verb, more, less = WORDS[i]
        unit = more if self.off > 0.0 else less
        return f"camera {verb} {abs(self.off) * SCALES[i]:.2f} {unit} than told (+-{self.sigma * SCALES[i]:.2f})"


def find_camera_lessons(told: CameraState, learnt: CameraState) -> tuple[CameraLesson, ...]:
    """What is otherwise than told, surely and by enough to be worth telling; empty where nothing was learnt."""
    if not learnt.covariance:
        return ()
    off = subtract_cameras(learnt.lens, learnt.mount, told.lens, told.mount)
    sigmas = [math.sqrt(row[i]) for i, row in enumerate(learnt.covariance)]
    return tuple(
        CameraLesson(name, by, sigma)
        for name, by, sigma, least in zip(CAMERA_UNKNOWNS, off, sigmas, WORTH_TELLING, strict=True)
        if abs(by) > max(least, MIN_SIGMAS * sigma))
