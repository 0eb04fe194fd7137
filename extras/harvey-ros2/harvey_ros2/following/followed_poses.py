"""What ``harvey follow`` says while it goes on, and where it was: as a table, or for evo."""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from harvey.errors import BadInput
from harvey_ros2.messages.messages import seconds
from harvey_ros2.messages.run_messages import PROTECTION, UNKNOWN, TimedMessage
from logs.export import write_tum

COLUMNS = ("time_s", "state", "x_m", "y_m", "heading_rad", "protection_m")


class FollowedPoses:
    """Prints when it is lost and found; counts how often it was lost, and keeps where it was.

    Attributes:
        lost: how often.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._said, self._level = "", ""
        self._poses: list[tuple[float, str, tuple[float, float, float], str]] = []

    def hear(self, messages: Iterable[TimedMessage]) -> None:
        """Messages as they come about."""
        for item in messages:
            if item.topic == "harvey/pose":
                self._keep(item.message)
            if item.topic != "/diagnostics":
                continue
            status = item.message.status[0]
            self._level = next((pair.value for pair in status.values if pair.key == PROTECTION), "")
            if status.message != self._said:
                self.lost += status.level == 2
                self._said = status.message
                print(f"{item.time_s:8.1f} s  {status.message}", file=sys.stderr, flush=True)

    def _keep(self, message: Any) -> None:
        at, turn = message.pose.pose.position, message.pose.pose.orientation
        state = "certified" if message.pose.covariance[0] < UNKNOWN else self._said.partition(":")[0] or "not certified"
        self._poses.append((seconds(message.header.stamp), state, (at.x, at.y, 2.0 * math.atan2(turn.z, turn.w)),
                            self._level if state == "certified" else ""))

    def write(self, path: Path) -> None:
        """As TUM's lines, where the name ends in ``.tum``, what is certified; else a table of all, without a pose where
        it is lost, and with a protection level where the picture itself vouched for the place.

        Raises BadInput where the file cannot be written.
        """
        if path.suffix == ".tum":
            write_tum([(time_s, pose) for time_s, state, pose, _ in self._poses if state == "certified"], path)
            return
        try:
            with path.open("w", encoding="utf-8", newline="") as file:
                writer = csv.writer(file, lineterminator="\n")
                writer.writerow(COLUMNS)
                for time_s, state, pose, level in self._poses:
                    there = [f"{one:.4f}" for one in pose] if state != "lost" else [""] * 3
                    writer.writerow([f"{time_s:.6f}", state, *there, level])
        except OSError as error:
            raise BadInput(f"--poses {path}: expected a file to write to, got: {error.strerror}") from None
