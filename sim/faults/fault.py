"""What every fault is: a trigger, its keys in a scenario file, what it does to the body; and which are due."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol

import numpy as np

from sim.render.sensor import Occluder
from sim.truth import Truth
from world_models.entries import Place
from world_models.frames import Pose2
from world_models.units import Bounds, check_bounds

TRIGGER_BOUNDS: Mapping[str, Bounds] = {"after_m": Bounds(0.0, 1e6), "after_s": Bounds(0.0, 1e6)}
DURATION = Bounds(0.0, 1e6, above=True)
"""Of a fault that lasts for a while [s]."""


class FaultTarget(Protocol):
    """What a fault can read of the simulated body and do to it. Poses are in the world frame."""

    @property
    def truth(self) -> Truth:
        """The robot's true state: pose, time, locale."""
        ...

    @property
    def fault_rng(self) -> np.random.Generator:
        """Random numbers for faults only, so that a fault does not change the noise of wheels and camera."""
        ...

    def is_free(self, world_from_robot: Pose2) -> bool:
        """Whether the robot could stand there: clear of obstacles, and in the locale where it is now."""
        ...

    def world_from_place(self, place: Place) -> Pose2:
        """The pose of a robot at a place in a locale."""
        ...

    def put_robot(self, world_from_robot: Pose2) -> None:
        """Move the robot without its wheels: the encoders count nothing."""
        ...

    def turn_lights_off(self, duration_s: float) -> None:
        """Turn the building's lights off from now on, for a while."""
        ...

    def add_occluder(self, occluder: Occluder) -> None:
        """Put something before the camera, until its time is over."""
        ...

    def freeze_camera(self, duration_s: float) -> None:
        """Have the camera deliver its last picture from now on, for a while."""
        ...

    def delay_camera(self, lag_s: float) -> None:
        """Have the camera deliver what it saw so long ago from now on, as if it were new."""
        ...

    def miscount(self, most_m: float) -> None:
        """Have the encoders count each motion by up to so much wrongly from now on."""
        ...

    def turn_camera(self, tilt_rad: float, roll_rad: float, yaw_rad: float) -> None:
        """Turn the camera's mounting from now on: downward, clockwise as it looks, to the left."""
        ...

    def start_device_fault(self, fault: DeviceFault) -> None:
        """Let a device fail from now on, for the fault's duration."""
        ...

    def report_missed(self, reason: str) -> None:
        """Record that a fault did not happen as it was asked for; the result lists it under ``amiss``."""
        ...


@dataclass(frozen=True, slots=True)
class Fault(ABC):
    """Something that goes wrong once, as soon as its trigger holds.

    A subclass is a frozen dataclass. Its fields are its keys in ``[[faults]]``, in SI units with the unit as suffix;
    lengths (``_m``) may also be written there with ``_ft`` or ``_in``, angles (``_rad``) with ``_deg``. Every field has
    a default.

    Attributes:
        kind: what a scenario calls it.
        bounds: of its fields, by name; values outside are refused.
        in_locale: happens only there; path and time then count from the first entry. "" for anywhere, counted from
            the start.
        after_m: path length before it happens [m].
        after_s: time before it happens [s].
    """

    kind: ClassVar[str]
    bounds: ClassVar[Mapping[str, Bounds]] = {}

    in_locale: str = ""
    after_m: float = 0.0
    after_s: float = 0.0

    def __post_init__(self) -> None:
        check_bounds(self, {**TRIGGER_BOUNDS, **self.bounds})

    @property
    def destination(self) -> Place | None:
        """The place where it puts the robot, from the key ``to_locale``; checked against the building beforehand."""
        return None

    @property
    def words(self) -> str:
        """What happens, for those who read of the run afterwards."""
        return f"{self.kind.replace('_', ' ')} happens"

    @abstractmethod
    def apply(self, body: FaultTarget) -> None:
        """Make it happen."""


@dataclass(frozen=True, slots=True)
class PassingFault(Fault):
    """A fault that is over after a while.

    Attributes:
        duration_s: for how long it lasts [s].
    """

    bounds: ClassVar[Mapping[str, Bounds]] = {"duration_s": DURATION}

    duration_s: float = 10.0


@dataclass(frozen=True, slots=True)
class DeviceFault(PassingFault):
    """A device does not work for a while; every request to it is answered by a ``BodyFault`` with these words.

    Attributes:
        part: the device, "base" or "camera".
        what: the fault in the words of the hardware drivers; detail: the same in a sentence's words.
        stops_motion_after_s: a motion is broken off this long after the fault began [s]; None: it is completed.
        odometry_arrives: whether the encoders' counts are still read while it lasts.
    """

    part: ClassVar[str]
    what: ClassVar[str]
    detail: ClassVar[str]
    stops_motion_after_s: ClassVar[float | None] = None
    odometry_arrives: ClassVar[bool] = True

    @property
    def words(self) -> str:
        return f"the {self.part} fails for {self.duration_s:g} s: {self.detail}"

    def apply(self, body: FaultTarget) -> None:
        body.start_device_fault(self)


@dataclass(frozen=True, slots=True)
class Progress:
    """Time and path length spent in one locale since the robot first entered it (or anywhere, for "")."""

    time_s: float = 0.0
    path_m: float = 0.0


@dataclass(frozen=True, slots=True)
class FaultSchedule:
    """The faults that are still to come, and what their triggers depend on.

    Attributes:
        pending: in the order of the scenario.
        progress: (locale, progress) for each locale that a fault names; "" counts everywhere.
    """

    pending: tuple[Fault, ...] = ()
    progress: tuple[tuple[str, Progress], ...] = ()

    @staticmethod
    def of(faults: tuple[Fault, ...]) -> FaultSchedule:
        """The schedule at the start of a run."""
        return FaultSchedule(faults, tuple((name, Progress()) for name in sorted({f.in_locale for f in faults})))

    def advance(self, time_s: float, path_m: float, locale: str) -> FaultSchedule:
        """The schedule after ``time_s`` and ``path_m`` more in ``locale``."""
        return replace(self, progress=tuple(
            (name, Progress(p.time_s + time_s, p.path_m + path_m) if name in ("", locale) else p)
            for name, p in self.progress
        ))

    def take_due(self, locale: str) -> tuple[tuple[Fault, ...], FaultSchedule]:
        """The faults that are due for a robot in ``locale``, and the schedule without them."""
        due = tuple(fault for fault in self.pending if self._is_due(fault, locale))
        return due, replace(self, pending=tuple(fault for fault in self.pending if fault not in due))

    def _is_due(self, fault: Fault, locale: str) -> bool:
        progress = dict(self.progress)[fault.in_locale]
        here = fault.in_locale in ("", locale)
        return here and progress.path_m >= fault.after_m and progress.time_s >= fault.after_s
