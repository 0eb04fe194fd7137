"""What goes wrong from outside: bumps, kidnaps, lights, view, line, camera. Each happens once, at its moment."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from world_models.entries.location import Frames, Place
from world_models.frames import Pose2


@dataclass(frozen=True, slots=True)
class Moment:
    """When a fault strikes: as soon as all that is stated holds.

    Attributes:
        in_locale: only there; time and way then count from the first entry. "" for anywhere, counted from the start.
        after_m: way gone [m].
        after_s: time passed [s].
    """

    in_locale: str = ""
    after_m: float = 0.0
    after_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Displacement:
    """The robot is moved, by a bump or a kidnap.

    Attributes:
        kind: "bump" or "kidnap".
        moment: when.
        forward_m, left_m, turn_rad: where to, from the pose it has.
        distance_m: besides that, this far in a direction that is drawn; if it is above 0, the turn's sign is drawn too.
        place: where to, instead: a place in a locale, with the heading there.
        absolute: that place in the world frame, once the world is known.
    """

    kind: str
    moment: Moment = Moment()
    forward_m: float = 0.0
    left_m: float = 0.0
    turn_rad: float = 0.0
    distance_m: float = 0.0
    place: Place | None = None
    absolute: Pose2 | None = None

    @property
    def least_m(self) -> float:
        """How far the robot is moved at the least, where there is room; a place that is named is always come to."""
        return 0.0 if self.place is not None else abs(self.distance_m - math.hypot(self.forward_m, self.left_m))

    def drawn(self, rng: np.random.Generator) -> Pose2:
        """A displacement in the robot's frame; always two draws from ``rng``."""
        direction, coin = float(rng.uniform(-math.pi, math.pi)), float(rng.random())
        sign = -1.0 if self.distance_m > 0 and coin < 0.5 else 1.0
        return Pose2(
            self.forward_m + self.distance_m * math.cos(direction),
            self.left_m + self.distance_m * math.sin(direction),
            sign * self.turn_rad,
        )


@dataclass(frozen=True, slots=True)
class LightsOff:
    """The lights go off for a while."""

    moment: Moment = Moment()
    duration_s: float = 10.0


@dataclass(frozen=True, slots=True)
class Occlusion:
    """Something hides a part of the camera's view for a while.

    Attributes:
        part: of the picture, 0..1; where it is, and how dark, is drawn.
    """

    moment: Moment = Moment()
    duration_s: float = 10.0
    part: float = 0.2

    def __post_init__(self) -> None:
        if not 0.0 < self.part < 1.0:
            raise ValueError(f"expected a part of the view between 0 and 1, got {self.part}")


@dataclass(frozen=True, slots=True)
class Ailment:
    """Something between the agent and the body does not work for a while.

    Attributes:
        kind: one of :data:`sim.body.faulty_body.AILMENTS`.
    """

    kind: str
    moment: Moment = Moment()
    duration_s: float = 10.0


Fault = Displacement | LightsOff | Occlusion | Ailment


def kind_of(fault: Fault) -> str:
    """What a scenario calls it."""
    if isinstance(fault, LightsOff):
        return "lights_off"
    return "occluded" if isinstance(fault, Occlusion) else fault.kind


def placed(fault: Fault, world: Frames) -> Fault:
    """The fault with its place, if it has one, found in the world. ValueError where the world lacks its locale."""
    if isinstance(fault, Displacement) and fault.place is not None:
        return replace(fault, absolute=fault.place.in_world(world))
    return fault


@dataclass(frozen=True, slots=True)
class Odometer:
    """How long and how far the robot has been in one place since it first came there (or anywhere, for "")."""

    time_s: float = 0.0
    path_m: float = 0.0


@dataclass(frozen=True, slots=True)
class FaultWatch:
    """The faults that are still to come, and what their moments depend on.

    Attributes:
        pending: in the order of the scenario.
        odometers: (locale, odometer) for each locale that a pending fault names; "" counts everywhere.
    """

    pending: tuple[Fault, ...] = ()
    odometers: tuple[tuple[str, Odometer], ...] = ()

    @staticmethod
    def of(faults: tuple[Fault, ...]) -> FaultWatch:
        return FaultWatch(faults, tuple((name, Odometer()) for name in sorted({f.moment.in_locale for f in faults})))

    def advanced(self, time_s: float, path_m: float, locale: str) -> FaultWatch:
        """After ``time_s`` and ``path_m`` more, in ``locale``."""
        counted = tuple(
            (name, Odometer(o.time_s + time_s, o.path_m + path_m) if name in ("", locale) else o)
            for name, o in self.odometers
        )
        return replace(self, odometers=counted)

    def struck(self, locale: str) -> tuple[tuple[Fault, ...], FaultWatch]:
        """The faults whose moment has come, and the watch without them."""
        odometers = dict(self.odometers)
        due = tuple(f for f in self.pending if _is_due(f.moment, odometers[f.moment.in_locale], locale))
        return due, replace(self, pending=tuple(f for f in self.pending if f not in due))


def _is_due(moment: Moment, odometer: Odometer, locale: str) -> bool:
    here = moment.in_locale in ("", locale)
    return here and odometer.path_m >= moment.after_m and odometer.time_s >= moment.after_s


def free_displacement(
    pose: Pose2, displacement: Displacement, rng: np.random.Generator, is_free: Callable[[Pose2], bool]
) -> Pose2:
    """Where a displacement takes the robot: a free place. Draws again, then goes only part of the way, until it is one.

    Returns ``pose`` itself, turned, where even a small part of the way is blocked.
    """
    if displacement.absolute is not None:
        return displacement.absolute
    move = displacement.drawn(rng)
    for _ in range(50 if displacement.distance_m > 0 else 0):
        if is_free(pose @ move):
            return pose @ move
        move = displacement.drawn(rng)
    for part in np.linspace(1.0, 0.0, 21):
        there = pose @ Pose2(float(part) * move.x_m, float(part) * move.y_m, move.heading_rad)
        if is_free(there):
            return there
    return pose @ Pose2(0.0, 0.0, move.heading_rad)
