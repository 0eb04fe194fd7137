"""A body of your own: another simulator, or a robot behind a library of its own, in one class.

A class under :class:`OwnBody` says how to move, what the camera shows and what time it is; :func:`drive_body` drives a
mission with it. docs/how-to/own-simulator.md is the recipe.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from blackboard import Sink
from harvey.agent import build_agent
from harvey.agent_settings import Pairs
from harvey.errors import BadInput
from harvey.hardware.drivers.capture import picture_of
from harvey.hardware.hardware_mission import HardwareMission
from harvey.runner.result import MissionResult
from harvey.runner.run import Run, RunReferee
from logs.run_directory import RunDirectory
from logs.run_head import HARDWARE, RunHead, load_known_world
from logs.run_recorder import RunRecorder
from world_models.entries import (
    BodyFault,
    CameraPicture,
    Contact,
    Course,
    MotionReport,
    MotorCommand,
    Ranges,
    Ride,
    RideReport,
)
from world_models.files.toml.camera_file import load_camera
from world_models.files.toml.source import WorldError
from world_models.robot import RobotModel

ON_THE_MOVE = "it cannot be steered on the move: drive it with motion.continuous=off"


class OwnBody(ABC):
    """A body that turns on the spot, moves ahead and sees: a :class:`harvey.runner.ports.Body`.

    Four methods must be given; the others are those of a robot without bumper and range sensors, and may be.
    """

    _seen = 0

    @property
    @abstractmethod
    def time_s(self) -> float:
        """The body's own time [s]: by it the mission is limited and all is dated. It may stand while Harvey thinks."""

    @abstractmethod
    def execute(self, command: MotorCommand, /) -> MotionReport | BodyFault:
        """TURN on the spot, then MOVE ahead; return when the robot stands again.

        A command that something in the way breaks off is reported as far as it was carried out, and
        :meth:`take_contact` tells of the touch.
        """

    @abstractmethod
    def see(self, purpose: str, /) -> NDArray[np.uint8]:
        """What the camera shows now: (height, width, 3) red, green, blue, of the size in the camera file."""

    @abstractmethod
    def wait(self, duration_s: float, /) -> float:
        """Let time pass without moving; return :attr:`time_s` after it."""

    def take_contact(self) -> Contact | None:
        """What was touched since the last call; None without a bumper."""
        return None

    def ranges(self) -> Ranges | None:
        """What range sensors measure; None without any."""
        return None

    def claim(self) -> MotionReport | BodyFault:
        """What the wheels counted since the last command began, asked for after a fault only."""
        return MotionReport(0.0, 0.0, 0.0, self.time_s)

    def look(self, purpose: str, /) -> CameraPicture | BodyFault:
        """What is seen, as the JPEG that the board gets and the run keeps."""
        image = self.see(purpose)
        picture = picture_of(np.ascontiguousarray(image[..., ::-1]))
        if picture is None:
            return BodyFault("camera", "frame dropped", f"expected an image of uint8, got {image.dtype}", "",
                             self.time_s)
        self._seen += 1
        return CameraPicture(picture.jpeg, self._seen - 1, self.time_s, purpose)

    def steer(self, _course: Course, /) -> tuple[MotionReport, CameraPicture] | BodyFault:
        """Refuses: a motion is one command, from one stand to the next."""
        return BodyFault("base", "base refuses", ON_THE_MOVE, "", self.time_s, 0.0, 0.0)

    def ride(self, _ride: Ride, /) -> RideReport | BodyFault:
        """No elevator."""
        return BodyFault("elevator", "no ride", "nobody is told to press the button", "", self.time_s)

    def stop(self) -> None:
        """Stand still for good; called once, at the end."""
        return


def build_robot(mission: HardwareMission) -> RobotModel:
    """The robot as a mission's file describes it: world, camera file, wheels, radius. Raises BadInput."""
    if not mission.camera.calibration:
        raise BadInput(f"{mission.name}: expected [camera] calibration = the camera file, got none")
    try:
        world, seen = load_known_world(mission.world), load_camera(mission.calibration)
    except (WorldError, OSError) as error:
        raise BadInput(str(error)) from None
    if seen.mount is None:
        raise BadInput(f"{mission.calibration}: expected [mount], how the camera is mounted, got none")
    return RobotModel(world, seen.camera, seen.mount, mission.actuator, mission.base.radius_m, deviation=seen.deviation)


def drive_body(
    mission: HardwareMission, body: OwnBody, *, seed: int = 0, out: Path | None = None, sinks: Sequence[Sink] = (),
    live: bool = False, settings: Pairs = (), referee: RunReferee | None = None,
) -> MissionResult:
    """Drive a mission with a body of your own, to the outcome.

    Args:
        mission: world, goal, start, ``[camera] calibration``, ``[base] radius_m`` and ``[actuator]`` of its file count;
            port and source do not.
        seed: noted in the run's files, where the body has chance.
        out: the run directory; None keeps nothing.
        sinks: called with every decision.
        settings: of the agent.
        referee: who knows the truth, and completes the result by it.

    Raises:
        BadInput: something of the mission cannot be used.
    """
    robot = build_robot(mission)
    head = RunHead.of(HARDWARE, mission.name, seed, mission.world, robot, mission.servo, mission.command,
                      scenario=mission.source.data, folder=str(mission.folder.resolve()), constants=tuple(settings))
    agent, files = build_agent(head), None if out is None else RunDirectory(out)
    recorder = RunRecorder(files, head, agent.world, agent.robot, live=live)
    run = Run(head, agent, body, recorder, limits=mission.limits, clock=lambda: body.time_s, referee=referee,
              sinks=sinks, told=mission.told)
    return run.drive(files)
