"""Localizer mode: somebody else drives, and Harvey says where the robot is, with a certificate, or that it is lost.

The board, the sources that read pictures, judge and search, the journal and its replay are those of a mission; what
drives is left out. What is sensed comes as observations: what the wheels counted, and pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blackboard import Decision, Effect, Post, Revise, Scheduler
from harvey.agent import Agent, build_agent
from harvey.errors import BadInput
from harvey.runner.ports import STANDS_STILL, StillCamera, WorldPort, tell_robot
from harvey.runner.result import Refusals
from harvey.wiring import KNOWLEDGE_SOURCES
from harvey_ros2.messages.run_messages import KINDS, RunMessages, TimedMessage
from harvey_ros2.recordings.picture_lag import PictureLag
from knowledge_sources.goal.interpreter import interpreter
from knowledge_sources.methods.calibration import compute_camera_covariance
from knowledge_sources.milestone.line_finder import LineFinder
from knowledge_sources.milestone.matcher import Matcher
from knowledge_sources.milestone.med_r_and_t import MedRAndT
from knowledge_sources.milestone.milestone_judge import MilestoneJudge
from knowledge_sources.milestone.plan_adjuster import plan_adjuster
from knowledge_sources.model.rival_weigher import rival_weigher
from knowledge_sources.reads import HELD, LOST, OPEN_FAULT, find_camera
from knowledge_sources.relocalizer.alias_monitor import AliasMonitor
from knowledge_sources.relocalizer.localizer import Localizer
from knowledge_sources.relocalizer.panorama_builder import PanoramaBuilder
from knowledge_sources.relocalizer.pose_adopter import pose_adopter
from knowledge_sources.senses.camera_calibrator import camera_calibrator
from knowledge_sources.senses.correction_monitor import correction_monitor
from knowledge_sources.senses.lens_monitor import lens_monitor
from knowledge_sources.senses.travel_breaker import travel_breaker
from knowledge_sources.senses.yaw_calibrator import YawCalibrator
from logs.run_directory import RunDirectory
from logs.run_head import HARDWARE, RunHead
from logs.run_recorder import RunRecorder
from world_models.camera import YAW
from world_models.commands import check_command
from world_models.entries import BodyFault, CameraPicture, Certificate, Command, MotionReport, Outcome, diagonal
from world_models.files.toml.mission import Servo
from world_models.frames import Pose2
from world_models.plugins import GUESTS_GROUP, list_plugins
from world_models.robot import RobotModel

SEATED = (interpreter, LineFinder, Matcher, MedRAndT, lens_monitor, correction_monitor, rival_weigher, MilestoneJudge,
          camera_calibrator, AliasMonitor, plan_adjuster, YawCalibrator, travel_breaker, PanoramaBuilder, Localizer,
          pose_adopter)
"""The sources of a mission that are wanted here too."""
GUESTS = ("claim_reckoner", "view_expecter", "loss_declarer", "place_confirmer")
AUTHOR = "onlooker"
EVERY_S = 0.09
"""Pictures are checked no more often, by their own time [s]: ten a second."""
AGAIN_S = 0.5
"""After one that did not certify the place, the next is so much later: who walks by is out of it by then [s]."""
UNCOUNTED_S = 2.0
"""A lost robot without odometry looks so seldom: each look is searched by itself, which takes seconds [s]."""
APART_M, APART_RAD = 0.3, math.radians(20.0)
"""A lost robot's looks are at least so far apart."""
STANDING_M, STANDING_RAD = 0.02, math.radians(1.0)
"""A robot that has not moved so far since it was certified is not looked for again."""
STILL_M, STILL_RAD = 2e-4, 2e-4
BLIND_S, VOUCHED_M = 2.0, 1.0
"""It knows where it is so long after the last picture with odometry, and so far from the last that was certified."""
SIGMA_ANYWHERE_M, SIGMA_ANYWHERE_RAD = 5.0, math.pi


@dataclass(frozen=True, slots=True)
class FirstGuess:
    """Where the robot is at the beginning, as somebody says.

    Attributes:
        place: a locale with a point in feet, as ``(hallway (4,4,0))``; a bare locale where nothing more is known.
        heading_rad: in the locale's frame.
        sigma_m, sigma_rad: standard deviations; None where nobody knows: it begins lost.
    """

    place: str
    heading_rad: float = 0.0
    sigma_m: float | None = 0.1
    sigma_rad: float = 0.1

    def command(self) -> Command:
        """As an entry. Raises BadInput where the place is none."""
        text = f"(ptrans {self.place} {self.place})"
        try:
            check_command(text)
        except ValueError as error:
            raise BadInput(f"--start {self.place}: {error}") from None
        sigmas = (SIGMA_ANYWHERE_M, SIGMA_ANYWHERE_RAD) if self.sigma_m is None else (self.sigma_m, self.sigma_rad)
        return Command(text, self.heading_rad, None, diagonal(*sigmas))


def build_onlooker_head(name: str, world: Path, robot: RobotModel, guess: FirstGuess) -> RunHead:
    """The head of a run in localizer mode: it names who sits at its board."""
    seated = {source.called() for source in SEATED}
    away = tuple(source.called() for source in KNOWLEDGE_SOURCES if source.called() not in seated)
    installed = list_plugins(GUESTS_GROUP)
    return RunHead.of(HARDWARE, name, 0, world, robot, Servo(), guess.command(), without=away,
                      plugins={guest: installed[guest] for guest in GUESTS})


class Onlooker:
    """A run in localizer mode.

    Attributes:
        scheduler: its board, and who sits round it.
        messages: what is told of it; whether its belief is certified, and why it is lost.
        pictures: how many were checked; certified: how many of them vouched for the place; protection_m: how far off
            the place may be after each of these.
        heard_s: when something last came of it, be it of use or not [s, of the run].
        refusals: what was refused: after such a run nobody knows what it has missed.
    """

    def __init__(
        self, head: RunHead, out: Path | None = None, tell: Callable[[Iterable[TimedMessage]], None] = lambda _: None,
        *, messages: RunMessages, counts: bool = True,
    ) -> None:
        """Begin it. Raises BadInput and OSError.

        Args:
            tell: gets the messages for others as they come about.
            counts: whether the wheels tell what they counted; else only pictures come.
        """
        self._agent: Agent = build_agent(head)
        self.messages, self._tell, self._counts = messages, tell, counts
        self._files = None if out is None else RunDirectory(out)
        self._recorder = RunRecorder(self._files, head, self._agent.world, self._agent.robot)
        port = self._recorder.record_port(WorldPort(self._agent.store))
        self.refusals = Refusals()
        self.scheduler: Scheduler = self._agent.scheduler(
            ports=(port,), sinks=(*self._recorder.sinks, self.refusals, self._hear))
        tell_robot(self.scheduler, self._agent.robot)
        self.scheduler.post([Post(head.task())], "user")
        self._settle()
        if HELD.find(self.scheduler.view) is None:
            raise BadInput("--start: expected a place in the building, got none that was understood")
        self._counted = Pose2(0.0, 0.0, 0.0)
        self._moved, self._last_s, self._glimpsed = Pose2(0.0, 0.0, 0.0), -math.inf, Pose2(math.inf, 0.0, 0.0)
        self._reported_s = self._seen_s = self.heard_s = 0.0
        self.pictures = self.certified = 0
        self.protection_m = list[float]()
        self._still, self._lag = StillCamera(), PictureLag()
        self._vouched_m, self._vouched_s, self._verdict = math.inf, -math.inf, ""

    @property
    def is_lost(self) -> bool:
        return LOST.find(self.scheduler.view) is not None

    def judge(self) -> tuple[bool, str]:
        """Whether it knows where the robot is, by certificates, and that in words."""
        if self.is_lost:
            return False, "lost"
        if refused := self.refusals.told():
            return False, f"it does not know where it is: {'; '.join(refused)}"
        if self.messages.unsure:
            return False, f"it does not know where it is: {self.messages.unsure}"
        if not self.certified:
            return False, f"was told where it is; 0 of {self.pictures} pictures said so"
        if not self.messages.is_certified:
            return False, "it does not know where it is: the last pictures do not say so"
        if self.heard_s - (self._seen_s if self._counts else self._vouched_s) > BLIND_S:
            return False, (f"it does not know where it is: pictures with odometry came, or said so, until"
                           f" {self._seen_s if self._counts else self._vouched_s:.1f} s of {self.heard_s:.1f} s")
        if self._vouched_m > VOUCHED_M:
            return False, f"it does not know where it is: no picture said so on the last {self._vouched_m:.1f} m"
        return True, "it knows where it is"

    def belief(self) -> tuple[Pose2, NDArray[np.float64]]:
        """Where the robot is believed to be, with all motion so far, and the covariance (3, 3) of the last report.

        The belief is of where the camera looks; what is told is where the robot faces, less sure by the camera's yaw.
        """
        view = self.scheduler.view
        held, camera = HELD.of(view), find_camera(view)
        turn, move = self._agent.robot.actuator, self._moved
        forward = Pose2(move.x_m * turn.reach, move.y_m * turn.reach, move.heading_rad)
        yaw_variance = compute_camera_covariance(camera)[YAW, YAW]
        heading, arm_m = held.pose.heading_rad, camera.mount.forward_m
        turned = np.array([arm_m * math.sin(heading), -arm_m * math.cos(heading), 1.0])  # about the camera
        pose, covariance = held.pose @ forward, held.covariance + yaw_variance * np.outer(turned, turned)
        c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        there = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return pose, covariance + (there @ self._lag.widen() @ there.T if self._counts else 0.0)

    def move(self, step: Pose2, time_s: float) -> None:
        """The wheels counted a motion until a time [s, of the run]: a pose in the frame of the one before."""
        self._moved, self._counted = self._moved @ step, self._counted @ step
        self._vouched_m += math.hypot(step.x_m, step.y_m)
        self._still.move(step.heading_rad, step.x_m)
        self._note_count(time_s)

    def _note_count(self, time_s: float) -> None:
        there, reach = self._counted, self._agent.robot.actuator.reach
        self._lag.count(time_s, Pose2(there.x_m * reach, there.y_m * reach, there.heading_rad))

    def wants(self, time_s: float) -> bool:
        """Whether a picture of this time is of use now."""
        if not self._counts:
            return time_s - self._last_s >= (UNCOUNTED_S if self.is_lost else EVERY_S)
        if self.is_lost:
            there = self._glimpsed if not math.isfinite(self._glimpsed.x_m) else self._glimpsed @ self._moved
            return not math.isfinite(there.x_m) or math.hypot(there.x_m, there.y_m) >= APART_M or (
                abs(there.heading_rad) >= APART_RAD)
        if self.messages.is_certified and math.hypot(self._moved.x_m, self._moved.y_m) < STANDING_M and (
                abs(self._moved.heading_rad) < STANDING_RAD):
            return False  # the same picture again tells nothing
        return time_s - self._last_s >= (EVERY_S if self.messages.is_certified else AGAIN_S)

    def pass_by(self, time_s: float) -> None:
        """A picture with its odometry came that is not wanted."""
        self._seen_s = time_s

    def look(self, jpeg: bytes, time_s: float) -> None:
        """A picture, taken where the wheels have counted up to now [s, of the run]."""
        self._seen_s = time_s
        self._note_count(time_s)
        if self._stands_still(jpeg, time_s):
            self.tell_pose()
            return
        lost = self.is_lost
        self._report(time_s)
        lost = lost or self.is_lost  # it may have become so by the report
        picture = CameraPicture(jpeg, self.pictures, time_s, "probe" if lost else "milestone")
        self.pictures, self._last_s = self.pictures + 1, time_s
        if lost:
            self._glimpsed = Pose2(0.0, 0.0, 0.0)
        effect = Post(picture)
        self._recorder.record_picture(effect)
        self._verdict = ""
        self._post(effect)
        if self._counts:
            self._compare_with_wheels(time_s)
        if self._verdict == "verified" and self.messages.is_certified:
            self.certified, self._vouched_m, self._vouched_s = self.certified + 1, 0.0, time_s
            self.protection_m.append(HELD.of(self.scheduler.view).value.protection_m)
        if not self.is_lost:
            self._glimpsed = Pose2(math.inf, 0.0, 0.0)
        self.tell_pose()

    def tell_pose(self) -> None:
        """Tell where the robot is and, where that is certified, how its odometry lies in the map."""
        pose, covariance = self.belief()
        self._tell([self.messages.pose(pose, covariance)])
        if self.messages.is_certified and self._counts:
            self._tell([self.messages.transform(pose, self.messages.odometry)])

    def close(self, why: str) -> None:
        """End the run."""
        kind = "lost" if self.is_lost else "reached" if self.judge()[0] else "failed"
        self._post(Post(Outcome(kind, why)))
        self._recorder.draw_end(kind, None)
        self._recorder.close()
        if self._files is not None:
            self._files.write_result({
                "scenario": self._files.path.name, "seed": 0, "outcome": kind, "reason": why,
                "decisions": self.scheduler.cycle, "pictures": self.pictures})

    def _stands_still(self, jpeg: bytes, time_s: float) -> bool:
        """Whether the camera stands still; a fault on the board says so, and the wheels go on being counted."""
        wrong = self._still.find(jpeg)
        fault = self.scheduler.view.newest(OPEN_FAULT, True)
        if wrong and fault is None:
            self._post(Post(BodyFault("camera", STANDS_STILL, wrong, "", time_s)))
        elif not wrong and fault is not None:
            self._post(Revise(fault, replace(fault.value, status="over")))
        if wrong:
            self._last_s = time_s
            self._report(time_s)
        return bool(wrong)

    def _compare_with_wheels(self, time_s: float) -> None:
        """Find out from a picture that tells the place how late pictures are."""
        if self._verdict == "verified" and not self.is_lost:
            self._lag.see(time_s, HELD.of(self.scheduler.view).pose)
            self._tell(list(self.messages.doubt("stamps", self._lag.complaint)))
        else:
            self._lag.forget_place()

    def _report(self, time_s: float) -> None:
        """Post the motion since the last picture: a turn toward where it came, the way there, and a turn."""
        moved, took_s = self._moved, max(0.0, time_s - self._reported_s)
        self._moved, self._reported_s = Pose2(0.0, 0.0, 0.0), time_s
        gone = math.hypot(moved.x_m, moved.y_m)
        parts: list[tuple[float, float]] = []
        if gone > STILL_M:
            ahead = math.atan2(moved.y_m, moved.x_m)
            back = abs(ahead) > math.pi / 2.0
            first = math.remainder(ahead + math.pi, math.tau) if back else ahead
            parts.append((first, -gone if back else gone))
            moved = replace(moved, heading_rad=math.remainder(moved.heading_rad - first, math.tau))
        if abs(moved.heading_rad) > STILL_RAD:
            parts.append((moved.heading_rad, 0.0))
        if not self._counts and took_s > 0.0:
            parts.append((0.0, 0.0))
        for turn, move in parts:
            if math.isfinite(self._glimpsed.x_m):
                self._glimpsed = self._glimpsed @ Pose2(0.0, 0.0, turn) @ Pose2(move, 0.0, 0.0)
            self._post(Post(MotionReport(turn, move, took_s / len(parts), time_s)))

    def _post(self, effect: Effect) -> None:
        self.scheduler.post([effect], AUTHOR)
        self._settle()

    def _settle(self) -> None:
        """Cycle until nothing is left to do."""
        while self.scheduler.step() is not None:
            pass

    def _hear(self, decision: Decision) -> None:
        for change in (*decision.observed, *decision.made):
            value: Any = change.entry.value
            if isinstance(value, Certificate):
                self._verdict = value.verdict
            if isinstance(value, KINDS):
                self._tell(list(self.messages.take(value)))  # even where nobody listens: certificates follow from it
