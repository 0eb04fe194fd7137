"""Mover: what moves by itself, or may: where it is, how it moves, and how surely."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from blackboard import inference
from world_models import words

LAST_MOVERS = 24
"""The newest that stay on the board."""
SURE_LOG_ODDS = math.log(19.0)
"""What moves so surely is acted on: 95 %."""
SLOW_M_PER_S = 0.2
"""Who is slower stands, as far as anybody can tell."""
MIN_SIGHTS = 3
"""What was seen less often may be an echo gone astray, and its velocity is not known."""
PAUSES_S = 4.0
"""Who walks and stops goes on within so long, or stands."""
MoverStatus = Literal["may move", "moves", "gone"]


@inference(keep=LAST_MOVERS)
@dataclass(frozen=True, slots=True)
class Mover:
    """Something on the floor that the model lacks, followed from sight to sight.

    Attributes:
        name: as ``mover-1``.
        locale: of the belief that it was seen by.
        x_m, y_m, vx_m_per_s, vy_m_per_s: place and velocity [world].
        covariance: (4, 4) of these.
        stood_x_m, stood_y_m: where it would be if it stood; stood_sigma_m: standard deviation along each axis.
        log_odds: that it moves, against that it stands, or is something else each time.
        at_s, seen_s: the moment of all this, and of the last sight, by the body's clock.
        sights: how many.
        walked_s: when it was last seen to walk; None: never.
        evidence: the last sight, in words.
        status: may move, moves (surely), or gone: out of sight, or its place is seen free.
    """

    name: str
    locale: str
    x_m: float
    y_m: float
    vx_m_per_s: float
    vy_m_per_s: float
    covariance: tuple[tuple[float, ...], ...]
    stood_x_m: float
    stood_y_m: float
    stood_sigma_m: float
    log_odds: float
    at_s: float
    seen_s: float
    sights: int
    evidence: str = ""
    status: MoverStatus = "may move"
    walked_s: float | None = None

    @property
    def is_moving(self) -> bool:
        """Whether it surely moves."""
        return self.status == "moves"

    @property
    def is_walking(self) -> bool:
        """Whether it rather walks than stands."""
        return self.status != "gone" and self.log_odds > 0.0 and self.speed_m_per_s >= SLOW_M_PER_S

    @property
    def may_go_on(self) -> bool:
        """Whether it may walk, or go on: it is not known to stand, or has walked until just now."""
        if self.walked_s is not None and self.at_s - self.walked_s <= PAUSES_S:
            return True
        return self.log_odds > -SURE_LOG_ODDS and (self.sights < MIN_SIGHTS or self.speed_m_per_s >= SLOW_M_PER_S
                                                   or self.log_odds < SURE_LOG_ODDS)

    @property
    def state(self) -> NDArray[np.float64]:
        """(4,) x, y [m], and its velocity [m/s]."""
        return np.array([self.x_m, self.y_m, self.vx_m_per_s, self.vy_m_per_s])

    @property
    def speed_m_per_s(self) -> float:
        return math.hypot(self.vx_m_per_s, self.vy_m_per_s)

    @property
    def sigma_m(self) -> float:
        """Standard deviation of its place along the worse axis."""
        return math.sqrt(max(self.covariance[0][0], self.covariance[1][1]))

    def words(self) -> str:
        """``somebody at (12.30, 0.90) m of the building, walking at 1.1 m/s``."""
        way = f"walking at {self.speed_m_per_s:.1f} m/s" if self.is_moving else "who may be walking"
        return f"somebody at {words.point(self.x_m, self.y_m)} of the building, {way}"

    def sentence(self) -> str:
        p = 1.0 / (1.0 + math.exp(-self.log_odds))
        ended = " is out of sight" if self.status == "gone" else ""
        return (f"{self.name}: {self.words()}{ended}, known to {words.metres(self.sigma_m)}; it moves: {p:.0%}, by"
                f" {words.count(self.sights, 'sight')}, the last at {self.seen_s:.1f} s: {self.evidence}")
