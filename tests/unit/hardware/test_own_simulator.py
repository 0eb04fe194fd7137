"""A body of one's own: the example of docs/how-to/own-simulator.md drives, and what fails is told."""

from __future__ import annotations

import math
import runpy
from pathlib import Path

import numpy as np
import pytest

import harvey
from harvey.errors import BadInput
from harvey.hardware.hardware_mission import load_mission
from harvey.hardware.own_body import OwnBody, build_robot
from harvey.runner.ports import Body
from world_models.entries import BodyFault, CameraPicture, Course, MotionReport, MotorCommand, Ride
from world_models.files.toml.camera_file import load_camera

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/how-to/own-simulator.md").read_text(encoding="utf-8")


def test_the_example_reaches_its_goal_and_its_run_is_decided_the_same_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    off_m = runpy.run_path(str(ROOT / "examples/own_simulator.py"))["main"](tmp_path)
    assert capsys.readouterr().out.startswith("reached: ")
    assert off_m < 0.02
    run = harvey.open_run(tmp_path / "run")
    assert run.replay() is None
    assert run.result["outcome"] == "reached" and run.result["milestones"]["verified"] >= 3


def test_every_method_of_a_body_is_on_the_page() -> None:
    for name in (name for name in vars(Body) if not name.startswith("_")):
        assert name == "look" or f"`{name}(" in PAGE, name
    assert OwnBody.__abstractmethods__ == {"time_s", "execute", "see", "wait"}


def test_the_camera_file_of_the_page_is_read(tmp_path: Path) -> None:
    (tmp_path / "camera.toml").write_text(PAGE.split("```toml\n")[1].split("```")[0], encoding="utf-8")
    camera, mount, _ = load_camera(tmp_path / "camera.toml")
    assert mount is not None and math.degrees(mount.tilt_rad) == pytest.approx(5.0)
    assert math.degrees(2.0 * math.atan(camera.width / 2.0 / camera.fx)) == pytest.approx(75.0, abs=0.1)


class Blind(OwnBody):
    """A body that does nothing, and whose pictures are of this type."""

    def __init__(self, kind: type = np.uint8) -> None:
        self.kind = kind

    @property
    def time_s(self) -> float:
        return 1.5

    def execute(self, command: MotorCommand, /) -> MotionReport:
        return MotionReport(command.turn_rad, command.move_m, 0.0, self.time_s)

    def see(self, purpose: str, /) -> np.ndarray:
        image = np.zeros((4, 6, 3), self.kind)
        image[..., 0] = 200
        return image

    def wait(self, duration_s: float, /) -> float:
        return self.time_s


def test_pictures_are_numbered_and_red_stays_red() -> None:
    body = Blind()
    first, second = body.look("probe"), body.look("track")
    assert isinstance(first, CameraPicture) and isinstance(second, CameraPicture)
    assert (first.number, second.number, second.purpose, second.sim_time_s) == (0, 1, "track", 1.5)
    from knowledge_sources.methods.features import read_picture

    red, green, blue = read_picture(first.jpeg).color.reshape(-1, 3).mean(axis=0)
    assert red > 150 and green < 80 and blue < 80


def test_what_a_simple_body_cannot_do_is_a_fault() -> None:
    body = Blind(np.float64)
    unfit = body.look("probe")
    assert isinstance(unfit, BodyFault) and "expected an image of uint8, got float64" in unfit.detail
    steered = body.steer(Course("Leg-1", 0.5, 0.0))
    assert isinstance(steered, BodyFault) and steered.what == "base refuses"
    assert isinstance(body.ride(Ride("PlanSketch-1", 0, "lift", "a", "b")), BodyFault)
    assert body.take_contact() is None and body.ranges() is None
    claimed = body.claim()
    assert isinstance(claimed, MotionReport) and claimed.move_m == 0.0


CAMERA = "[camera]\nwidth_px = 6\nheight_px = 4\nfx_px = 5.0\nfy_px = 5.0\ncx_px = 2.5\ncy_px = 1.5\n"


def test_a_camera_of_which_something_is_not_told_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "camera.toml"
    with pytest.raises(BadInput, match=r"camera\.toml"):
        build_robot(load_mission(ROOT / "docs/flat/mission.toml", {"camera.calibration": str(file)}))
    file.write_text(CAMERA, encoding="utf-8")
    with pytest.raises(BadInput, match=r"expected \[mount\]"):
        build_robot(load_mission(ROOT / "docs/flat/mission.toml", {"camera.calibration": str(file)}))
    with pytest.raises(BadInput, match=r"expected \[camera\] calibration"):
        goal = {"world": str(ROOT / "docs/flat/flat.toml"), "goal": "Go from the hall to the kitchen"}
        build_robot(load_mission(None, goal))
