"""The simulated body: what the motor and the camera port talk to, with the truth hidden behind."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim.body.actuator import STEP_M, ActuatorParameters, Slip, Wheels, arc_displacement, arc_steps
from sim.body.building import Building
from sim.body.rolling import Roll
from sim.faults.faults import Ailment, Displacement, Fault, FaultWatch, LightsOff, Occlusion, free_displacement, kind_of
from sim.render.occluder import Occluder
from sim.render.optics import Optics
from sim.render.sensor import SensorParameters, compressed, exposed, pass_over
from sim.truth import Truth
from world_models.camera import Camera, CameraMount
from world_models.entries.body import BodyFault, Course, Frame, MotionReport, MotorCommand, Odometry, Ride, RideReport
from world_models.frames import Pose, Pose2

BLUR_PARTS = 3
"""Pictures of which one is made that is exposed on the move."""
FRAME_S = 0.1
"""Time that taking a picture takes [s]."""
WATCHDOG_S = 0.5
"""A base that hears nothing any more goes on for so long before it stops by itself [s]."""
DRAWS = 100
"""So often a place to be put down at is drawn, until one is free."""
SHORT_M = 0.005
"""A bump that moves the robot less far than it should, by more than this, is told of."""
GOES_ON: Mapping[str, float] = {"link_lost": WATCHDOG_S, "nonsense": WATCHDOG_S, "stall": 0.0}
"""Ailments that break a motion off, and how long it goes on [s]."""


class SimulatedBody:
    """A robot with a camera in a building.

    The same arguments and the same calls give the same answers. Wheels, camera, faults and putting down draw from
    random streams of their own, so that a fault does not change the noise.
    """

    def __init__(
        self,
        building: Building,
        start: Pose2,
        camera: Camera,
        mount: CameraMount,
        *,
        seed: int,
        actuator: ActuatorParameters | None = None,
        sensor: SensorParameters | None = None,
        faults: tuple[Fault, ...] = (),
        put_down_sigma_m: float = 0.0,
        put_down_sigma_rad: float = 0.0,
    ) -> None:
        """Put the robot down near ``start`` (world frame), with the given standard deviations of place and heading."""
        placing, wheels, pixels, chance = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(4))
        self._building, self._mount, self._optics = building, mount, Optics.of(camera)
        self._sensor = sensor or SensorParameters()
        self._wheel_rng, self._pixel_rng, self._fault_rng = wheels, pixels, chance
        self._wheels = Wheels.drawn(actuator or ActuatorParameters(), wheels)
        self._watch = FaultWatch.of(faults)
        self._dark_until_s = 0.0
        self._occluders: tuple[Occluder, ...] = ()
        self._hindered: list[str] = []
        self._ailing: dict[str, tuple[float, float]] = {}
        self._frames = 0
        self._known: Mapping[int, bytes] = {}
        self._helped: dict[int, int] = {}
        self._slip: Slip | None = None
        self._stuck = False
        self._roll = Roll()
        self._counted = Pose2(0.0, 0.0, 0.0)
        self._truth = Truth(start, locale=building.locale_at(start))
        there = self._put_down(placing, put_down_sigma_m, put_down_sigma_rad)
        self._truth = Truth(there, locale=building.locale_at(there))
        self._track = [self._truth]

    def _put_down(self, rng: np.random.Generator, sigma_m: float, sigma_rad: float) -> Pose2:
        """A place about the start that is free; the start itself where none is found."""
        start = self._truth.world_from_robot
        for _ in range(DRAWS):
            x, y, turn = rng.standard_normal(3) * (sigma_m, sigma_m, sigma_rad)
            there = start @ Pose2(x, y, turn)
            if self._is_free(there):
                return there
        return start

    @property
    def truth(self) -> Truth:
        """The robot's true state. Not for knowledge sources."""
        return self._truth

    @property
    def track(self) -> tuple[Truth, ...]:
        """Every true state so far, one at least every two centimetres of the way. Not for knowledge sources."""
        return tuple(self._track)

    @property
    def frames(self) -> int:
        """How many pictures were taken."""
        return self._frames

    @property
    def curvature_per_m(self) -> float:
        """Of the arc that its wheels make of a straight way, on the average. Not for knowledge sources."""
        return self._wheels.curvature_per_m

    @property
    def amiss(self) -> tuple[str, ...]:
        """Which faults did not happen, or not as they were asked for, in words. Not for knowledge sources."""
        return (*self._hindered, *(f"{kind_of(fault)}: its moment did not come" for fault in self._watch.pending))

    @property
    def ailing(self) -> tuple[str, ...]:
        """What does not work now, of :data:`sim.body.faulty_body.AILMENTS`."""
        now_s = self._truth.time_s
        return tuple(kind for kind, (_, until_s) in self._ailing.items() if now_s < until_s)

    def wait(self, duration_s: float) -> float:
        """Stand still for a while; returns the time after it."""
        self._pass(duration_s)
        return self._truth.time_s

    def execute(self, command: MotorCommand) -> MotionReport:
        """TURN in place, then MOVE straight ahead, as well as the wheels can; what is returned is the encoders' claim.

        Running into something stops the motion there, and so does the watchdog when the line fails; the claim is of
        the part that was gone.
        """
        began_s = self._truth.time_s
        self._pass(self._wheels.parameters.command_s)
        self._turn(command.turn_rad)
        gone = self._move(command.move_m)
        turn, move = self._wheels.claimed(command.turn_rad, command.move_m * gone)
        self._count(turn, move)
        now_s = self._truth.time_s
        return MotionReport(turn_rad=turn, move_m=move, duration_s=now_s - began_s, sim_time_s=now_s)

    def turn(self, turn_rad: float) -> MotionReport:
        """TURN in place."""
        return self.execute(MotorCommand(turn_rad, 0.0))

    def move(self, move_m: float) -> MotionReport:
        """MOVE straight ahead."""
        return self.execute(MotorCommand(0.0, move_m))

    def stop(self) -> None:
        """It stands between commands."""

    def odometry(self) -> Odometry:
        """Where the encoders claim that it is, from where it was put down."""
        there = self._counted
        return Odometry(there.x_m, there.y_m, there.heading_rad, self._truth.time_s)

    def heartbeat(self) -> None:
        """It hears everything."""

    def close(self) -> None:
        """There is nothing to let go."""

    def roll(self, turn_rad: float, move_m: float, duration_s: float) -> tuple[float, float]:
        """A short part of a motion, for whoever drives the wheels: a turn in place or a move; both 0 to stand.

        The motion errs as a whole, from the first part to the next stand. Returns what the wheels rolled, (turn, move):
        nothing while something is in the way.
        """
        if turn_rad == move_m == 0.0:
            self._slip, self._stuck = None, False
            self._pass(duration_s)
            return 0.0, 0.0
        slip = self._slip = self._slip or self._wheels.slip(self._wheel_rng)
        before = self._truth.world_from_robot
        there = before @ Pose2(*self._wheels.skittered(turn_rad, self._wheel_rng), turn_rad * slip.turn_factor)
        there = there @ arc_displacement(move_m * slip.length_factor, slip.curvature_per_m)
        if self._building.obstacles.blocks(before, there):
            hit = 0 if self._stuck else 1
            self._truth, self._stuck = replace(self._truth, collisions=self._truth.collisions + hit), True
            self._pass(duration_s)
            return 0.0, 0.0
        self._go(there, duration_s)
        self._count(turn_rad, move_m)
        return turn_rad, move_m

    def steer(self, course: Course) -> tuple[MotionReport, Frame] | BodyFault:
        """Roll on by a course until the next picture, or come to a stand; what is steered holds from the picture on.

        Returns what the encoders claim since the last call, and the picture: taken on the move, so that no time passes.
        In contact it stands, and a fault tells so.
        """
        began_s, parameters = self._truth.time_s, self._wheels.parameters
        each_s = 1.0 / self._sensor.frames_per_s
        self._roll = self._roll.steered(min(course.speed_m_per_s, parameters.speed_m_per_s), course.curvature_per_m)
        touched = self._roll_on(each_s)
        while not course.is_rolling and self._roll.speed_m_per_s > 0.0 and not touched:
            touched = self._roll_on(each_s)
        turn, move = self._roll.claimed(self._wheels)
        self._roll = self._roll.told(turn, move) if course.is_rolling and not touched else Roll()
        now_s = self._truth.time_s
        if touched:
            return BodyFault("base", "stalled", "something is in the way", "", now_s, turn, move)
        return MotionReport(turn, move, now_s - began_s, now_s), self._taken("track")

    def halt(self, goes_on_s: float) -> MotionReport:
        """A base that hears nothing any more on the move: it goes on for so long, and then comes to a stand."""
        began_s = self._truth.time_s
        touched = goes_on_s > 0.0 and self._roll_on(goes_on_s)
        self._roll = self._roll.steered(0.0, self._roll.curvature_per_m)
        while self._roll.speed_m_per_s > 0.0 and not touched:
            touched = self._roll_on(1.0 / self._sensor.frames_per_s)
        turn, move = self._roll.claimed(self._wheels)
        self._roll = Roll()
        return MotionReport(turn, move, self._truth.time_s - began_s, self._truth.time_s)

    def _roll_on(self, duration_s: float) -> bool:
        """Roll for a while, in steps of the simulation; whether something was touched."""
        parameters = self._wheels.parameters
        steps = max(1, math.ceil(duration_s * parameters.speed_m_per_s / STEP_M))
        for _ in range(steps):
            if self._roll.errs_anew(parameters.increment_m):
                self._roll = self._roll.with_slip(self._wheels.slip(self._wheel_rng))
            step, self._roll = self._roll.after(duration_s / steps, parameters.acceleration_m_per_s2)
            before = self._truth.world_from_robot
            if self._building.obstacles.blocks(before, before @ step):
                self._truth = replace(self._truth, collisions=self._truth.collisions + 1)
                self._pass(duration_s / steps)
                return True
            self._go(before @ step, duration_s / steps)
        return False

    def ride(self, ride: Ride) -> RideReport | BodyFault:
        """Stand in the car until somebody presses the button and the doors open; what is told is what was asked for."""
        began_s = self._truth.time_s
        carried = self._building.elevators.carry(ride, self._truth, self._helped)
        if isinstance(carried, str):
            return BodyFault("elevator", "no ride", carried, "", began_s)
        self._helped[carried.helper] = self._helped.get(carried.helper, 0) + 1
        self._pass(carried.comes_s)
        if self._building.on_floor is not None:
            self._building = self._building.on_floor(carried.floor_m)
        self._truth = replace(self._truth, world_from_robot=carried.world_from_robot, locale=carried.locale)
        self._pass(carried.takes_s)
        now_s = self._truth.time_s
        return RideReport(ride.passage, ride.destination, now_s - began_s, now_s)

    @property
    def _standing(self) -> Pose:
        """world_from_robot, on the floor that it stands on."""
        return self._truth.world_from_robot.lifted(self._building.floor_m)

    def recall(self, pictures: Mapping[int, bytes]) -> None:
        """Pictures, by number, that are known from before: they are not made once more. All else goes on as it does."""
        self._known = pictures

    def look(self, purpose: str = "") -> Frame:
        """Take a picture: the JPEG bytes that the camera delivers, for the purpose of the request."""
        self._pass(FRAME_S)
        return self._taken(purpose)

    def _taken(self, purpose: str) -> Frame:
        number, self._frames = self._frames, self._frames + 1
        known = self._known.get(number)
        if known is not None:
            pass_over(self._pixel_rng)
        jpeg = self.picture() if known is None else known
        return Frame(jpeg=jpeg, number=number, sim_time_s=self._truth.time_s, purpose=purpose)

    def picture(self) -> bytes:
        """The JPEG bytes that the camera delivers at this moment; no time passes for it, and it is not counted."""
        radiance = self._radiance()
        for occluder in self._occluders:
            if self._truth.time_s < occluder.until_s:
                radiance = occluder.before(radiance)
        image = exposed(radiance, self._sensor, self._pixel_rng, lights_on=self._truth.lights_on)
        return compressed(image, self._sensor.jpeg_quality)

    def _radiance(self) -> NDArray[np.float32]:
        """(h, w, 3) what comes through the lens: on the move, the mean over the time that the picture is exposed."""
        back_s = self._sensor.exposure_s if self._roll.speed_m_per_s > 0.0 else 0.0
        parts = BLUR_PARTS if back_s > 0.0 else 1
        total = self._radiance_from(self._standing)
        for part in range(1, parts):
            earlier = self._roll.step(-back_s * part / (parts - 1))
            total = total + self._radiance_from((self._truth.world_from_robot @ earlier).lifted(self._building.floor_m))
        return total if parts == 1 else np.asarray(total / parts, np.float32)

    def _radiance_from(self, world_from_robot: Pose) -> NDArray[np.float32]:
        camera_from_world = self._mount.camera_from_robot @ world_from_robot.inverse()
        return self._optics.radiance(self._building.renderer, camera_from_world)

    def _turn(self, turn_rad: float) -> None:
        done = self._wheels.turned(turn_rad, self._wheel_rng)
        before = self._truth.world_from_robot
        aside = before @ Pose2(done.x_m, done.y_m, done.heading_rad)
        stuck = self._building.obstacles.blocks(before, aside)
        self._go(before @ Pose2(0.0, 0.0, done.heading_rad) if stuck else aside, self._wheels.turn_s(turn_rad))

    def _move(self, move_m: float) -> float:
        """Move until done or in contact; returns the part that was gone, 0..1."""
        steps = list(arc_steps(*self._wheels.arc(move_m, self._wheel_rng)))
        each_s = self._wheels.move_s(move_m) / max(1, len(steps))
        for index, step in enumerate(steps):
            if self._is_broken_off():
                return index / len(steps)
            before = self._truth.world_from_robot
            if self._building.obstacles.blocks(before, before @ step):
                self._truth = replace(self._truth, collisions=self._truth.collisions + 1)
                self._track.append(self._truth)
                return index / len(steps)
            self._go(before @ step, each_s)
        return 1.0

    def _count(self, turn_rad: float, move_m: float) -> None:
        """What the encoders add to where they claim that it is."""
        self._counted = self._counted @ Pose2(0.0, 0.0, turn_rad) @ Pose2(move_m, 0.0, 0.0)

    def _go(self, there: Pose2, duration_s: float) -> None:
        """The robot drives itself to a near pose."""
        way_m = there.distance_to(self._truth.world_from_robot)
        self._truth = replace(
            self._truth, world_from_robot=there, path_m=self._truth.path_m + way_m,
            locale=self._building.locale_at(there),
        )
        self._pass(duration_s, way_m)

    def _pass(self, duration_s: float, way_m: float = 0.0) -> None:
        """Time passes, and faults whose moment has come strike."""
        self._watch = self._watch.advanced(duration_s, way_m, self._truth.locale)
        due, self._watch = self._watch.struck(self._truth.locale)
        self._truth = replace(self._truth, time_s=self._truth.time_s + duration_s)
        for fault in due:
            self._suffer(fault)
        self._truth = replace(self._truth, lights_on=self._truth.time_s >= self._dark_until_s)
        self._track.append(self._truth)

    def _suffer(self, fault: Fault) -> None:
        if isinstance(fault, LightsOff):
            self._dark_until_s = self._truth.time_s + fault.duration_s
        elif isinstance(fault, Occlusion):
            until_s = self._truth.time_s + fault.duration_s
            self._occluders += (Occluder.drawn(fault.part, until_s, self._fault_rng),)
        elif isinstance(fault, Ailment):
            self._ailing[fault.kind] = (self._truth.time_s, self._truth.time_s + fault.duration_s)
        elif isinstance(fault, Displacement):
            before = self._truth.world_from_robot
            there = free_displacement(before, fault, self._fault_rng, self._is_free)
            moved_m = there.distance_to(before)
            if fault.least_m - moved_m > SHORT_M:
                self._hindered.append(f"{fault.kind}: {moved_m:.2f} m of {fault.least_m:.2f} m, for want of room")
            self._truth = replace(self._truth, world_from_robot=there, locale=self._building.locale_at(there))

    def _is_broken_off(self) -> bool:
        now_s = self._truth.time_s
        since = ((self._ailing[kind][0], goes_on_s) for kind, goes_on_s in GOES_ON.items() if kind in self.ailing)
        return any(now_s >= began_s + goes_on_s for began_s, goes_on_s in since)

    def _is_free(self, pose: Pose2) -> bool:
        """Free of walls, and still in the same locale: nobody carries it through a wall."""
        same = self._building.locale_at(pose) == self._truth.locale
        return same and self._building.obstacles.clearance_m(pose) >= 0.02
