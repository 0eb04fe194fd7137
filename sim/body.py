"""The simulated body: what the motor and the camera port talk to, with the truth hidden behind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sim.actuator import ActuatorParameters, Slip, Wheels, arc_displacement, arc_steps
from sim.building import Building
from sim.faults import Ailment, Displacement, Fault, FaultWatch, LightsOff, free_displacement
from sim.optics import Optics
from sim.sensor import SensorParameters, compressed, exposed, pass_over
from sim.truth import Truth
from world_models.body import Frame, MotionReport, MotorCommand, Odometry
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose2

FRAME_S = 0.1
"""Time that taking a picture takes [s]."""
WATCHDOG_S = 0.5
"""A base that hears nothing any more goes on for so long before it stops by itself [s]."""
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
        self._ailing: dict[str, tuple[float, float]] = {}
        self._frames = 0
        self._known: Mapping[int, bytes] = {}
        self._slip: Slip | None = None
        self._stuck = False
        self._counted = Pose2(0.0, 0.0, 0.0)
        x, y, turn = placing.standard_normal(3) * (put_down_sigma_m, put_down_sigma_m, put_down_sigma_rad)
        there = start @ Pose2(x, y, turn)
        self._truth = Truth(there, locale=building.locale_at(there))
        self._track = [self._truth]

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
    def ailing(self) -> tuple[str, ...]:
        """What does not work now, of :data:`sim.ailments.AILMENTS`."""
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

    def recall(self, pictures: Mapping[int, bytes]) -> None:
        """Pictures, by number, that are known from before: they are not made once more. All else goes on as it does."""
        self._known = pictures

    def look(self, purpose: str = "") -> Frame:
        """Take a picture: the JPEG bytes that the camera delivers, for the purpose of the request."""
        self._pass(FRAME_S)
        number, self._frames = self._frames, self._frames + 1
        known = self._known.get(number)
        if known is not None:
            pass_over(self._pixel_rng)
        jpeg = self.picture() if known is None else known
        return Frame(jpeg=jpeg, number=number, sim_time_s=self._truth.time_s, purpose=purpose)

    def picture(self) -> bytes:
        """The JPEG bytes that the camera delivers at this moment; no time passes for it, and it is not counted."""
        camera_from_world = self._mount.camera_from_robot @ self._truth.world_from_robot.lifted().inverse()
        radiance = self._optics.radiance(self._building.renderer, camera_from_world)
        image = exposed(radiance, self._sensor, self._pixel_rng, lights_on=self._truth.lights_on)
        return compressed(image, self._sensor.jpeg_quality)

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
        elif isinstance(fault, Ailment):
            self._ailing[fault.kind] = (self._truth.time_s, self._truth.time_s + fault.duration_s)
        elif isinstance(fault, Displacement):
            there = free_displacement(self._truth.world_from_robot, fault, self._fault_rng, self._is_free)
            self._truth = replace(self._truth, world_from_robot=there, locale=self._building.locale_at(there))

    def _is_broken_off(self) -> bool:
        now_s = self._truth.time_s
        since = ((self._ailing[kind][0], goes_on_s) for kind, goes_on_s in GOES_ON.items() if kind in self.ailing)
        return any(now_s >= began_s + goes_on_s for began_s, goes_on_s in since)

    def _is_free(self, pose: Pose2) -> bool:
        """Free of walls, and still in the same locale: a kidnap does not go through a wall."""
        same = self._building.locale_at(pose) == self._truth.locale
        return same and self._building.obstacles.clearance_m(pose) >= 0.02
