"""The small recording of the page "Try it on your own recording", driven by the simulator.

    python -m docs.tools.own_recording [FOLDER]

It drives the mission of ``docs/flat`` and keeps what a robot of one's own would record: pictures with their times, the
odometry, the camera's file; and the truth, for evo.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import harvey  # before numpy: it tells the libraries how to calculate

# isort: split
import numpy as np

from logs.export import write_tum
from logs.timeline import Timeline
from world_models.entries import MotionReport
from world_models.files.toml.camera_file import camera_text
from world_models.frames import Pose2

HERE = Path(__file__).parents[1] / "flat"
SETTINGS = {"motion.continuous": "on", "camera.width_px": 320, "camera.height_px": 240}
EVERY_S, TOLD_S = 0.3, 0.1
"""Between two pictures that are kept, and two lines of the odometry [s]."""


def write_recording(folder: Path) -> None:
    """Drive, and write the recording."""
    with tempfile.TemporaryDirectory() as kept:
        harvey.run(HERE / "flat-sim.toml", settings=SETTINGS, out=kept)
        run = harvey.open_run(kept)
        (folder / "rgb").mkdir(parents=True, exist_ok=True)
        last_s, listed = -EVERY_S, []
        for picture in run.pictures():
            if picture.time_s >= last_s + EVERY_S:
                name, last_s = f"rgb/{picture.time_s:.3f}.jpg", picture.time_s
                (folder / name).write_bytes(picture.jpeg)
                listed.append(f"{picture.time_s:.6f} {name}\n")
        (folder / "rgb.txt").write_text("# time [s], picture\n" + "".join(listed))
        history, counted, odometry = Timeline(Path(kept) / "journal.jsonl"), Pose2(0.0, 0.0, 0.0), []
        for record in history.of_kind(MotionReport):
            report = record.value
            odometry.append((report.sim_time_s - report.duration_s, counted.x_m, counted.y_m, counted.heading_rad))
            counted = counted @ Pose2(0.0, 0.0, report.turn_rad) @ Pose2(report.move_m, 0.0, 0.0)
            odometry.append((report.sim_time_s, counted.x_m, counted.y_m, counted.heading_rad))
        times, x, y, heading = np.array(odometry).T
        told = np.arange(0.0, times[-1] + 1.0, TOLD_S)
        ways = (np.interp(told, times, column) for column in (x, y, np.unwrap(heading)))
        write_tum(zip(told, zip(*ways, strict=True), strict=True), folder / "odometry.tum")
        write_tum([(time_s, (point.pose.x_m, point.pose.y_m, point.pose.heading_rad)) for point in run.true_track()
                   if (time_s := history.time_at(point.cycle)) is not None], folder / "truth.tum")
        robot = run.head.model(run.head.load_world())
        (folder / "camera.toml").write_text(camera_text(robot.lens, robot.mount, ("The camera of this recording.",)))


if __name__ == "__main__":
    write_recording(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "recording")
