"""The simulated body: what the motor and the camera port talk to, with the truth hidden behind."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sim.body.body_camera import BodyCamera
from sim.body.senses import Bumper, RangeRing
from sim.body.simulated_building import SimulatedBuilding
from sim.body.wheel_errors import (
    STEP_M,
    ActuatorParameters,
    ContinuousMotion,
    SimulatedWheels,
    Slip,
    arc_steps,
)
from sim.faults.fault import DeviceFault, Fault, FaultSchedule
from sim.render.lighting import Lighting
from sim.render.sensor import Occluder, SensorParameters
from sim.truth import Truth
from world_models.actuator import arc
from world_models.camera import Camera, CameraMount
from world_models.entries import (
    BodyFault,
    CameraPicture,
    Contact,
    Course,
    MotionReport,
    MotorCommand,
    Place,
    Ranges,
    Ride,
    RideReport,
)
from world_models.frames import Pose2, wrap_angle
from world_models.words import degrees, metres

FRAME_S = 0.1
"""Time that taking a picture takes [s]."""
MAX_PUT_DOWN_DRAWS = 100
"""Random poses that are tried for a free one to put the robot down at."""
MIN_CLEARANCE_M = 0.02
"""A fault moves the robot only to where it has this much room."""


class SimulatedBody:
    """A robot with a camera in a building; the target of the scenario's faults.

    The same arguments and the same calls give the same answers. Wheels, camera, sonars, faults and putting down draw
    from random streams of their own, so that a fault does not change the noise. Poses are in the world frame.
    """

    def __init__(
        self,
        building: SimulatedBuilding,
        start: Pose2,
        camera: Camera,
        mount: CameraMount,
        *,
        seed: int,
        actuator: ActuatorParameters | None = None,
        sensor: SensorParameters | None = None,
        bumper: Bumper | None = None,
        ranges: RangeRing | None = None,
        faults: tuple[Fault, ...] = (),
        lighting: Lighting | None = None,
        put_down_sigma_m: float = 0.0,
        put_down_sigma_rad: float = 0.0,
    ) -> None:
        """Put the robot down near ``start`` (world frame), with the given standard deviations of place and heading."""
        streams = [np.random.default_rng(stream) for stream in np.random.SeedSequence(seed).spawn(5)]
        put_down_rng, self._wheel_rng, pixel_rng, self.fault_rng, self._range_rng = streams
        self._building = building
        self._camera = BodyCamera(camera, mount, sensor or SensorParameters(), pixel_rng, lighting)
        self._bumper, self._ring = bumper or Bumper(), ranges or RangeRing()
        self._wheels = SimulatedWheels.draw(actuator or ActuatorParameters(), self._wheel_rng)
        self._schedule = FaultSchedule.of(faults)
        self._dark_until_s = 0.0
        self._missed: list[str] = []
        self._happened: list[str] = []
        self._device_faults: dict[str, tuple[DeviceFault, float]] = {}  # with the time at which each began
        self._helped: dict[int, int] = {}
        self._slip: Slip | None = None
        self._touching_rad: float | None = None
        self._contact: Contact | None = None
        self._motion = ContinuousMotion()
        self._frozen_until_s, self._lag_s, self._delivered, self._owed_s = 0.0, 0.0, b"", 0.0
        self._most_jump_m = 0.0
        self._truth = Truth(start, locale=building.locale_at(start))
        there = self._draw_put_down(put_down_rng, put_down_sigma_m, put_down_sigma_rad)
        self._truth = Truth(there, locale=building.locale_at(there))
        self._track = [self._truth]

    def _draw_put_down(self, rng: np.random.Generator, sigma_m: float, sigma_rad: float) -> Pose2:
        """A free pose near the start; the start itself where none is found."""
        start = self._truth.world_from_robot
        for _ in range(MAX_PUT_DOWN_DRAWS):
            x, y, turn = rng.standard_normal(3) * (sigma_m, sigma_m, sigma_rad)
            there = start @ Pose2(x, y, turn)
            if self.is_free(there):
                return there
        return start

    @property
    def truth(self) -> Truth:
        """The robot's true state. Not for knowledge sources."""
        return self._truth

    @property
    def time_s(self) -> float:
        """Its time [s]."""
        return self._truth.time_s

    @property
    def track(self) -> tuple[Truth, ...]:
        """Every true state so far, one at least every two centimetres of the way. Not for knowledge sources."""
        return tuple(self._track)

    @property
    def frames(self) -> int:
        """How many pictures were taken."""
        return self._camera.frames

    @property
    def building(self) -> SimulatedBuilding:
        """The building as it is at this moment. Not for knowledge sources."""
        return self._building

    @property
    def curvature_per_m(self) -> float:
        """Mean curvature of this run's wheels on a straight move [1/m]. Not for knowledge sources."""
        return self._wheels.curvature_per_m

    @property
    def speed_m_per_s(self) -> float:
        """Of every move that is not asked to be slower."""
        return self._wheels.parameters.speed_m_per_s

    @property
    def missed_faults(self) -> tuple[str, ...]:
        """Which faults did not happen, or not as they were asked for, in words. Not for knowledge sources."""
        return (*self._missed, *(f"{fault.kind}: its moment did not come" for fault in self._schedule.pending))

    @property
    def happened(self) -> tuple[str, ...]:
        """What its faults did to it so far, in words, oldest first. Not for knowledge sources."""
        return tuple(self._happened)

    @property
    def device_faults(self) -> Mapping[str, DeviceFault]:
        """The devices' faults at this moment, by kind."""
        now_s = self._truth.time_s
        return {kind: fault for kind, (fault, began_s) in self._device_faults.items()
                if now_s < began_s + fault.duration_s}

    def wait(self, duration_s: float) -> float:
        """Stand still for a while; returns the time after it [s]."""
        self._advance_time(duration_s)
        return self._truth.time_s

    def charge(self, duration_s: float) -> None:
        """Thinking takes time, which passes with the next act; a robot on the move follows its course meanwhile."""
        self._owed_s += duration_s

    def execute(self, command: MotorCommand) -> MotionReport:
        """TURN in place, then MOVE straight ahead, as well as the wheels can. Returns what the encoders report.

        A contact ends the motion, and so does a device fault that stops it; the report is of the part that was done.
        """
        owed_s, self._owed_s = self._owed_s, 0.0
        began_s = self._truth.time_s + owed_s
        self._advance_time(owed_s + self._wheels.parameters.command_s)
        self._turn(command.turn_rad)
        done = self._move(command.move_m, command.speed_m_per_s)
        turn, move = self._wheels.quantize(command.turn_rad, command.move_m * done)
        if self._most_jump_m and move:
            move += float(self.fault_rng.uniform(-self._most_jump_m, self._most_jump_m))
        now_s = self._truth.time_s
        return MotionReport(turn_rad=turn, move_m=move, duration_s=now_s - began_s, sim_time_s=now_s)

    def turn(self, turn_rad: float) -> MotionReport:
        """TURN in place."""
        return self.execute(MotorCommand(turn_rad, 0.0))

    def move(self, move_m: float) -> MotionReport:
        """MOVE straight ahead."""
        return self.execute(MotorCommand(0.0, move_m))

    @property
    def touching_rad(self) -> float | None:
        """The true direction in which :meth:`roll` touches something, from the heading; None: nothing is touched."""
        return self._touching_rad

    def take_contact(self) -> Contact | None:
        """What the bumper felt since the last call, the last of it."""
        contact, self._contact = self._contact, None
        return contact

    @property
    def has_ranges(self) -> bool:
        """Whether it has a ring of sonars."""
        return self._ring.sensors > 0

    def ranges(self) -> Ranges | None:
        """What the ring of sonars measures; None without one."""
        obstacles, truth = self._building.obstacles, self._truth
        return self._ring.measure(obstacles.segments_world, truth.world_from_robot, self._range_rng, truth.time_s)

    def echo(self, sensor: Pose2) -> float | None:
        """What a sonar of an emulated base hears, from the sensor [m]; its pose is in the robot's frame."""
        pose = self._truth.world_from_robot @ sensor
        return self._ring.hear(self._building.obstacles.segments_world, pose, self._range_rng)

    def roll(self, turn_rad: float, move_m: float, duration_s: float) -> tuple[float, float]:
        """A short part of a motion that an emulated base drives: a turn in place or a move; both 0 to stand.

        All parts of a motion, from one stand to the next, share their errors. Returns what the wheels rolled,
        (turn [rad], move [m]): nothing while something is in the way.
        """
        if turn_rad == move_m == 0.0:
            self._slip, self._touching_rad = None, None
            self._advance_time(duration_s)
            return 0.0, 0.0
        slip = self._slip = self._slip or self._wheels.sample_slip(self._wheel_rng)
        before = self._truth.world_from_robot
        there = before @ Pose2(*self._wheels.sample_skitter(turn_rad, self._wheel_rng), turn_rad * slip.turn_factor)
        there = there @ arc(move_m * slip.length_factor, slip.curvature_per_m)
        if self._building.obstacles.blocks(before, there):
            if self._touching_rad is None:
                self._touching_rad = self._count_collision(there, duration_s)
            self._advance_time(duration_s)
            return 0.0, 0.0
        self._drive_to(there, duration_s)
        return turn_rad, move_m

    def steer(self, course: Course) -> tuple[MotionReport, CameraPicture] | BodyFault:
        """Follow a course until the next picture, or stop; the course holds from this picture on.

        Returns what the encoders counted since the last call, and the picture; it is taken on the move, in no time.
        A contact ends the motion with a fault.
        """
        began_s, parameters = self._truth.time_s, self._wheels.parameters
        each_s, self._owed_s = max(self._owed_s, 1.0 / self._camera.sensor.frames_per_s), 0.0
        self._motion = self._motion.steer(min(course.speed_m_per_s, parameters.speed_m_per_s), course.curvature_per_m)
        touched = self._follow_arc(each_s)
        while not course.is_rolling and self._motion.speed_m_per_s > 0.0 and not touched:
            touched = self._follow_arc(each_s)
        turn, move = self._motion.read_encoders(self._wheels)
        goes_on = course.is_rolling and not touched
        self._motion = self._motion.mark_reported(turn, move) if goes_on else ContinuousMotion()
        now_s = self._truth.time_s
        if touched:
            return BodyFault("base", "stalled", "something is in the way", "", now_s, turn, move)
        return MotionReport(turn, move, now_s - began_s, now_s), self._take_frame("track")

    def halt(self, after_s: float) -> MotionReport:
        """Break off a motion on the move: the base follows its course for ``after_s`` more, then stops."""
        began_s = self._truth.time_s
        touched = after_s > 0.0 and self._follow_arc(after_s)
        self._motion = self._motion.steer(0.0, self._motion.curvature_per_m)
        while self._motion.speed_m_per_s > 0.0 and not touched:
            touched = self._follow_arc(1.0 / self._camera.sensor.frames_per_s)
        turn, move = self._motion.read_encoders(self._wheels)
        self._motion = ContinuousMotion()
        return MotionReport(turn, move, self._truth.time_s - began_s, self._truth.time_s)

    def _follow_arc(self, duration_s: float) -> bool:
        """Move on for a while, in steps of the simulation; returns whether something was touched."""
        parameters = self._wheels.parameters
        steps = max(1, math.ceil(duration_s * parameters.speed_m_per_s / STEP_M))
        for _ in range(steps):
            if self._motion.needs_slip(parameters.increment_m):
                self._motion = self._motion.with_slip(self._wheels.sample_slip(self._wheel_rng))
            step, self._motion = self._motion.advance(duration_s / steps, parameters.acceleration_m_per_s2)
            before = self._truth.world_from_robot
            if self._building.obstacles.blocks(before, before @ step):
                self._count_collision(before @ step, duration_s / steps)
                self._advance_time(duration_s / steps)
                return True
            self._drive_to(before @ step, duration_s / steps)
        return False

    def ride(self, ride: Ride) -> RideReport | BodyFault:
        """Wait in the car until a helper presses the button and the doors open. The report repeats the request: which
        landing the car really went to is not known to the robot.
        """
        began_s = self._truth.time_s
        outcome = self._building.elevators.carry(ride, self._truth, self._helped)
        if isinstance(outcome, str):
            return BodyFault("elevator", "no ride", outcome, "", began_s)
        self._helped[outcome.helper] = self._helped.get(outcome.helper, 0) + 1
        self._advance_time(outcome.comes_s)
        if self._building.on_floor is not None:
            self._building = self._building.on_floor(outcome.floor_m)
        self._truth = replace(self._truth, world_from_robot=outcome.world_from_robot, locale=outcome.locale)
        self._advance_time(outcome.takes_s)
        now_s = self._truth.time_s
        return RideReport(ride.passage, ride.destination, now_s - began_s, now_s)

    def use_recorded(self, pictures: Mapping[int, bytes]) -> None:
        """Deliver these pictures (JPEG, by frame number) instead of rendering them; all else goes on as it would."""
        self._camera.use_recorded(pictures)

    def look(self, purpose: str = "") -> CameraPicture:
        """Take a picture, for the purpose of the request."""
        owed_s, self._owed_s = self._owed_s, 0.0
        self._advance_time(owed_s + FRAME_S)
        return self._take_frame(purpose)

    def picture(self) -> bytes:
        """The JPEG bytes of a picture at this moment; it takes no time and is not counted."""
        return self._deliver(self._camera.take_jpeg(self._building, self._seen, self._motion))

    def _take_frame(self, purpose: str) -> CameraPicture:
        frame = self._camera.take_frame(self._building, self._seen, self._motion, purpose)
        return replace(frame, jpeg=self._deliver(frame.jpeg), sim_time_s=self._truth.time_s)

    @property
    def _seen(self) -> Truth:
        """The state that a picture of now shows: an earlier one, where pictures come late."""
        if not self._lag_s:
            return self._truth
        number = bisect_right(self._track, self._truth.time_s - self._lag_s, key=lambda truth: truth.time_s)
        return self._track[max(0, number - 1)]

    def _deliver(self, jpeg: bytes) -> bytes:
        """A picture as it leaves the camera: the last one again, where that is frozen."""
        if self._truth.time_s >= self._frozen_until_s:
            self._delivered = jpeg
        return self._delivered or jpeg

    def _turn(self, turn_rad: float) -> None:
        done = self._wheels.sample_turn(turn_rad, self._wheel_rng)
        before = self._truth.world_from_robot
        aside = before @ Pose2(done.x_m, done.y_m, done.heading_rad)
        blocked = self._building.obstacles.blocks(before, aside)
        self._drive_to(before @ Pose2(0.0, 0.0, done.heading_rad) if blocked else aside, self._wheels.turn_s(turn_rad))

    def _move(self, move_m: float, speed_m_per_s: float | None) -> float:
        """Move until it is done, in contact or broken off; returns the part that was done, 0..1."""
        steps = list(arc_steps(*self._wheels.sample_arc(move_m, self._wheel_rng)))
        slowed = 1.0 if speed_m_per_s is None else max(1.0, self._wheels.parameters.speed_m_per_s / speed_m_per_s)
        each_s = slowed * self._wheels.move_s(move_m) / max(1, len(steps))
        for index, step in enumerate(steps):
            if self._is_broken_off():
                return index / len(steps)
            before = self._truth.world_from_robot
            if self._building.obstacles.blocks(before, before @ step):
                self._count_collision(before @ step, each_s)
                self._track.append(self._truth)
                return index / len(steps)
            self._drive_to(before @ step, each_s)
        return 1.0

    def _is_broken_off(self) -> bool:
        """Whether a device fault ends the motion now."""
        now_s = self._truth.time_s
        return any(
            fault.stops_motion_after_s is not None
            and now_s >= self._device_faults[kind][1] + fault.stops_motion_after_s
            for kind, fault in self.device_faults.items()
        )

    def _count_collision(self, there: Pose2, within_s: float) -> float:
        """Something is touched in a step to ``there``; returns its direction from the heading [rad]."""
        speed_m_per_s = there.distance_to(self._truth.world_from_robot) / within_s
        self._truth = replace(self._truth, collisions=self._truth.collisions + 1, contact_m_per_s=speed_m_per_s)
        direction_rad = self._building.obstacles.nearest_direction_rad(there)
        self._contact = self._bumper.feel(direction_rad, self._truth.time_s)
        return direction_rad

    def _drive_to(self, there: Pose2, duration_s: float) -> None:
        """Drive to a near pose: time and path count."""
        way_m = there.distance_to(self._truth.world_from_robot)
        self._truth = replace(
            self._truth, world_from_robot=there, path_m=self._truth.path_m + way_m,
            locale=self._building.locale_at(there),
        )
        self._advance_time(duration_s, way_m)

    def _advance_time(self, duration_s: float, way_m: float = 0.0) -> None:
        """Let time pass, and apply the faults that are due."""
        self._schedule = self._schedule.advance(duration_s, way_m, self._truth.locale)
        due, self._schedule = self._schedule.take_due(self._truth.locale)
        self._truth = replace(self._truth, time_s=self._truth.time_s + duration_s)
        self._follow_changes()
        for fault in due:
            before = self._truth.world_from_robot
            fault.apply(self)
            self._happened.append(f"{fault.words}{_moved(before, self._truth.world_from_robot)}")
        self._truth = replace(self._truth, lights_on=self._truth.time_s >= self._dark_until_s)
        self._track.append(self._truth)

    def _follow_changes(self) -> None:
        """Let the building change with time. What would be put where the robot stands waits until it has gone."""
        if self._building.at_time is None:
            return
        here = self._truth.world_from_robot
        now = self._building.at_time(self._truth.time_s, here)
        if now is not self._building and not self._is_run_into(now.obstacles.clearance_m(here)):
            self._building = now
            self._happened += now.news

    def _is_run_into(self, clearance_m: float) -> bool:
        return clearance_m < 0.0 and clearance_m < self._building.obstacles.clearance_m(self._truth.world_from_robot)

    # What faults may do: see sim.faults.fault.FaultTarget.

    def is_free(self, world_from_robot: Pose2) -> bool:
        """Whether the robot could stand there: clear of obstacles, and in the locale where it is now."""
        same = self._building.locale_at(world_from_robot) == self._truth.locale
        return same and self._building.obstacles.clearance_m(world_from_robot) >= MIN_CLEARANCE_M

    def world_from_place(self, place: Place) -> Pose2:
        """The pose of a robot at a place. Raises ValueError where the building has no such locale."""
        return self._building.world_from_place(place)

    def put_robot(self, world_from_robot: Pose2) -> None:
        """Move the robot without its wheels."""
        locale = self._building.locale_at(world_from_robot)
        self._truth = replace(self._truth, world_from_robot=world_from_robot, locale=locale)

    def turn_lights_off(self, duration_s: float) -> None:
        """Turn the building's lights off for a while."""
        self._dark_until_s = self._truth.time_s + duration_s

    def freeze_camera(self, duration_s: float) -> None:
        """Have the camera deliver its last picture for a while."""
        self._frozen_until_s = self._truth.time_s + duration_s

    def delay_camera(self, lag_s: float) -> None:
        """Have the camera deliver what it saw so long ago from now on."""
        self._lag_s = lag_s

    def miscount(self, most_m: float) -> None:
        """Have the encoders count each motion by up to so much wrongly from now on."""
        self._most_jump_m = most_m

    def add_occluder(self, occluder: Occluder) -> None:
        """Put something before the camera, until its time is over."""
        self._camera.add_occluder(occluder)

    def turn_camera(self, tilt_rad: float, roll_rad: float, yaw_rad: float) -> None:
        """Turn the camera's mounting: downward, clockwise as it looks, to the left."""
        self._camera.turn_mount(tilt_rad, roll_rad, yaw_rad)

    def start_device_fault(self, fault: DeviceFault) -> None:
        """Let a device fail for the fault's duration."""
        self._device_faults[fault.kind] = fault, self._truth.time_s

    def report_missed(self, reason: str) -> None:
        """Record that a fault did not happen as it was asked for."""
        self._missed.append(reason)


def _moved(before: Pose2, now: Pose2) -> str:
    """By how much a robot was moved, in words; "" for one that was not."""
    if before == now:
        return ""
    turned_rad = wrap_angle(now.heading_rad - before.heading_rad)
    return f": it stands {metres(now.distance_to(before))} from where it stood, turned by {degrees(abs(turned_rad))}"
