"""The simulated wheels against what the paper measured (§3.2, §5, Table 1)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim.body.wheel_errors import ActuatorParameters, SimulatedWheels
from world_models.actuator import arc
from world_models.frames import Pose2

INCH_M = 0.0254


def open_loop_run(seed: int, increments: int = 10) -> tuple[SimulatedWheels, Pose2]:
    """One run of two-foot increments along x without servoing."""
    rng = np.random.default_rng(seed)
    wheels = SimulatedWheels.draw(ActuatorParameters(), rng)
    pose = Pose2(0.0, 0.0, 0.0)
    for _ in range(increments):
        pose = pose @ arc(*wheels.sample_arc(24 * INCH_M, rng))
    return wheels, pose


def test_twenty_feet_without_servoing_end_two_to_twelve_inches_off_the_line() -> None:
    off = np.array([abs(open_loop_run(seed)[1].y_m) / INCH_M for seed in range(400)])
    assert np.mean((off >= 2.0) & (off <= 12.0)) > 0.95
    assert off.min() < 3.0 and off.max() > 9.0


def test_drift_goes_either_way() -> None:
    left = [open_loop_run(seed)[1].y_m > 0 for seed in range(400)]
    assert 0.4 < np.mean(left) < 0.6


def test_moves_fall_short_by_a_factor_that_is_constant_within_a_run() -> None:
    ratios = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        wheels = SimulatedWheels.draw(ActuatorParameters(), rng)
        lengths = [wheels.sample_arc(24 * INCH_M, rng)[0] / (24 * INCH_M) for _ in range(10)]
        assert np.std(lengths) < 0.01
        ratios.append(np.mean(lengths))
    assert 0.936 < min(ratios) < 0.945 and 0.955 < max(ratios) < 0.964
    assert min(ratios) < 228.3 / 240.0 < max(ratios)


def test_turns_skitter_by_millimetres_and_err_by_about_two_percent() -> None:
    rng = np.random.default_rng(1)
    wheels = SimulatedWheels.draw(ActuatorParameters(), rng)
    turns = [wheels.sample_turn(math.pi / 2.0, rng) for _ in range(500)]
    assert 0.002 < np.std([t.x_m for t in turns]) < 0.004
    assert 0.002 < np.std([t.y_m for t in turns]) < 0.004
    assert 1.6 < math.degrees(float(np.std([t.heading_rad for t in turns]))) < 2.1
    assert wheels.sample_turn(0.0, rng) == Pose2(0.0, 0.0, 0.0)


def test_the_encoders_claim_what_was_commanded_to_their_resolution() -> None:
    parameters = ActuatorParameters(encoder_step_m=0.002, encoder_step_rad=0.001)
    wheels = SimulatedWheels.draw(parameters, np.random.default_rng(0))
    turn, move = wheels.quantize(0.12345, -0.5031)
    assert (turn, move) == pytest.approx((0.123, -0.504), abs=1e-12)


@pytest.mark.parametrize("bad", [{"turn_sigma_rad": -1.0}, {"shortfall_low": 0.5}, {"speed_m_per_s": 0.0},
                                 {"distance_sigma": math.nan}])
def test_impossible_parameters_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"expected .* got"):
        ActuatorParameters(**bad)
