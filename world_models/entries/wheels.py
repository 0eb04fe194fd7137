"""What is learnt of the wheels during a run (§3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from blackboard.kinds import inference
from world_models import words
from world_models.actuator import MAX_INNOVATION_SIGMAS, ActuatorModel
from world_models.frames import wrap_angle


@inference()
@dataclass(frozen=True, slots=True)
class Drift:
    """Online estimate of the wheels' curvature bias: a one-dimensional Kalman filter.

    One measurement is the change of heading over a stretch of way, from :meth:`restart` to :meth:`update`.

    Attributes:
        curvature_per_m: of a MOVE; positive drifts to the left.
        sigma_per_m: its standard deviation.
        heading_rad: believed at the start of the stretch [rad, world].
        turned_rad, turned_variance: turns commanded since, and the variance of their execution.
        gone_m: metres driven since.
    """

    curvature_per_m: float
    sigma_per_m: float
    heading_rad: float
    turned_rad: float = 0.0
    turned_variance: float = 0.0
    gone_m: float = 0.0

    @staticmethod
    def unknown(actuator: ActuatorModel, heading_rad: float) -> Drift:
        """The prior: zero curvature, the actuator model's standard deviation."""
        return Drift(0.0, actuator.curvature_sigma_per_m, heading_rad)

    def after_motion(
        self, actuator: ActuatorModel, turn_rad: float, move_m: float, *, on_the_spot: bool = True
    ) -> Drift:
        """The stretch extended by a reported TURN and MOVE; ``on_the_spot=False`` for a turn steered along an arc."""
        variance = actuator.turn_variance(turn_rad) if on_the_spot else (actuator.turn_sigma * turn_rad) ** 2
        return replace(
            self, turned_rad=self.turned_rad + turn_rad, gone_m=self.gone_m + actuator.reach * move_m,
            turned_variance=self.turned_variance + variance,
        )

    def restart(self, heading_rad: float) -> Drift:
        """The same estimate; a new stretch starts here."""
        return Drift(self.curvature_per_m, self.sigma_per_m, heading_rad)

    def update(self, actuator: ActuatorModel, heading_rad: float, sigma_rad: float) -> Drift:
        """Kalman update with the heading measured at the end of a stretch; a new stretch starts here.

        An innovation above MAX_INNOVATION_SIGMAS, as after a push, leaves the estimate as it was.

        Args:
            heading_rad: measured [rad, world].
            sigma_rad: standard deviation of the measured change of heading.
        """
        if self.gone_m <= 0.0:
            return self.restart(heading_rad)
        bent = wrap_angle(heading_rad - self.heading_rad - self.turned_rad) / self.gone_m
        noise = (self.turned_variance + sigma_rad**2) / self.gone_m**2 + actuator.bend_sigma_per_m**2
        if (bent - self.curvature_per_m) ** 2 > MAX_INNOVATION_SIGMAS**2 * (self.sigma_per_m**2 + noise):
            return self.restart(heading_rad)
        gain = self.sigma_per_m**2 / (self.sigma_per_m**2 + noise)
        curvature = self.curvature_per_m + gain * (bent - self.curvature_per_m)
        return Drift(curvature, math.sqrt(1.0 - gain) * self.sigma_per_m, heading_rad)

    def sentence(self) -> str:
        spread = f"+-{math.degrees(self.sigma_per_m):.2f}"
        return (f"the wheels drift by {words.bend(self.curvature_per_m)} ({spread}); by what was seen until"
                f" {words.metres(self.gone_m)} ago")
