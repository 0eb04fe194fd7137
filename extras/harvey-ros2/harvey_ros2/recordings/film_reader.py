"""Pictures that are no bag's: a video, or a folder in the order of the numbers in the names or of its list ``rgb.txt``;
without odometry, or beside that of a file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from heapq import merge
from pathlib import Path

import cv2
import numpy as np

from harvey.errors import BadInput
from harvey.hardware.drivers.capture import CapturedPicture, picture_of
from harvey_ros2.recordings.bag_reader import BagItem
from harvey_ros2.recordings.odometry_file import read_picture_times
from harvey_ros2.robot.picture_message import decompress_picture
from world_models.camera import Camera
from world_models.files.regular_files import expect_regular, read_regular
from world_models.words import by_numbers

VIDEOS = (".mp4", ".avi", ".mkv", ".mov", ".webm", ".m4v", ".mpg")
PICTURES = (".jpg", ".jpeg", ".png")
LIST = "rgb.txt"
"""Lines of time [s] and name: what TUM's data sets call it."""
MOST_HZ = 1000.0


def is_film(path: Path) -> bool:
    """Whether this is a video by its name, or a folder with pictures that is no bag."""
    return path.suffix.lower() in VIDEOS if not path.is_dir() else (
        not (path / "metadata.yaml").exists() and ((path / LIST).is_file() or bool(_list_pictures(path))))


class Film:
    """Pictures, so many a second, or by the times of a list.

    Attributes:
        left_out: what was, with how often: ``pictures that are not whole``.
    """

    def __init__(self, path: Path, rate_hz: float = 0.0) -> None:
        """``rate_hz``: pictures a second; 0 for what the video says. Raises BadInput."""
        self._path, self.left_out = path, Counter[str]()
        self._listed: list[tuple[float, Path]] | None = None
        if path.is_dir() and (path / LIST).is_file() and not rate_hz:
            self._listed, said_hz = read_picture_times(path / LIST), MOST_HZ
        elif path.is_dir():
            said_hz = 0.0
        else:
            try:
                expect_regular(path)  # a pipe would be waited for
            except OSError as error:
                raise BadInput(f"{path}: expected a video, got: {error.strerror}") from None
            video = cv2.VideoCapture(str(path))
            said_hz = video.get(cv2.CAP_PROP_FPS) if video.isOpened() else -1.0
            video.release()
            if said_hz < 0.0:
                raise BadInput(f"{path}: expected a video, got a file that is none, or none at all")
        self._rate_hz = rate_hz or said_hz
        if not 0.0 < self._rate_hz <= MOST_HZ:
            raise BadInput(f"--rate: expected how many pictures a second {path} has, above 0 up to {MOST_HZ:g}, got "
                           f"{self._rate_hz:g}")

    def check_size(self, camera: Camera) -> None:
        """Raises BadInput where the first picture is not of the camera's size, or there is none."""
        first = next(self._read(Counter()), None)
        if first is None:
            raise BadInput(f"{self._path}: expected pictures, got none that is whole")
        if first[1].size != (camera.width, camera.height):
            wide, high = first[1].size
            raise BadInput(f"{self._path}: expected pictures of {camera.width} x {camera.height} px, as --calibration "
                           f"says, got {wide} x {high}")

    def items(self) -> Iterator[BagItem]:
        """Each picture with its time from the first; those that are not whole, or of another size, are left out."""
        size = None
        for number, picture in self._read(self.left_out):
            size = size or picture.size
            if picture.size == size:
                time_s = number / self._rate_hz if self._listed is None else self._listed[number][0]
                yield BagItem(time_s, jpeg=picture.jpeg)
            else:
                self.left_out["pictures of another size than the first"] += 1

    def beside(self, odometry: Sequence[BagItem]) -> Iterator[BagItem]:
        """Pictures and odometry in the order of time; without a list they begin at the same time."""
        begins_s = odometry[0].time_s if self._listed is None else 0.0
        pictures = (replace(item, time_s=begins_s + item.time_s) for item in self.items())
        yield from merge(odometry, pictures, key=lambda item: item.time_s)

    def _read(self, left_out: Counter[str]) -> Iterator[tuple[int, CapturedPicture]]:
        for number, retrieved in enumerate(self._retrieve()):
            picture = None if retrieved is None else picture_of(retrieved)
            if picture is None:
                left_out["pictures that are not whole"] += 1
            else:
                yield number, picture

    def _retrieve(self) -> Iterator[np.ndarray | None]:
        """JPEG bytes or pixels of each; None for one that cannot be read."""
        if self._path.is_dir():
            for path in _list_pictures(self._path) if self._listed is None else [path for _, path in self._listed]:
                try:
                    pixels = decompress_picture(np.frombuffer(read_regular(path), np.uint8), path.suffix)
                except OSError:
                    pixels = ""
                yield None if isinstance(pixels, str) else pixels
            return
        video = cv2.VideoCapture(str(self._path))
        try:
            while (read := video.read())[0]:
                yield read[1]
        finally:
            video.release()


def _list_pictures(folder: Path) -> list[Path]:
    found = (path for path in folder.iterdir() if path.suffix.lower() in PICTURES and path.is_file())
    return sorted(found, key=by_numbers)
