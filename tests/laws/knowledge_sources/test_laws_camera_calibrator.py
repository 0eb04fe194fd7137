"""Laws of the camera calibrator: what a verified picture says of the camera is known from then on, and no more sure."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blackboard import Entry, Revise
from generated_boards import Bench, effect_on, made, reasons
from harvey.testing import check_source, plain_robot
from knowledge_sources.methods.calibration import (
    LEAST_SIGMA_CENTRE_PX,
    LEAST_SIGMA_FOCAL,
    LEAST_SIGMA_M,
    LEAST_SIGMA_RAD,
    MAX_COUNTED,
    compute_camera_covariance,
)
from knowledge_sources.senses.camera_calibrator import camera_calibrator
from world_models.entries import CameraState, Certificate, MilestoneVerdict, PoseFix, Travel, begin_travel, diagonal
from world_models.frames import Pose2

SOURCE = camera_calibrator
FLOORS = (*(LEAST_SIGMA_RAD,) * 3, LEAST_SIGMA_M, LEAST_SIGMA_FOCAL, LEAST_SIGMA_CENTRE_PX, LEAST_SIGMA_CENTRE_PX)
YAW = 2
HERE = Pose2(3.0, 1.5, 0.4)
small = st.floats(-0.02, 0.02)


def verify(bench: Bench, step: tuple[float, ...], sigmas: tuple[float, ...], pose: Pose2 = HERE,
           verdict: MilestoneVerdict = "verified") -> tuple[Entry[PoseFix], Entry[Certificate]]:
    """A milestone that is verified from a pose, and says this of the camera."""
    covariance = tuple(map(tuple, np.diag(np.square(sigmas)).tolist())) if step else ()
    fix = bench.put(PoseFix("LineMatch-1", pose, np.diag([1e-4, 1e-4, 1e-5]), np.ones(0, bool), np.zeros(0), (),
                            step, covariance))
    return fix, bench.put(
        Certificate("Milestone-1", fix.id, verdict, "", 9, 9, 9, 0.9, 1.0, 0.0, 0.0, 3.0, 30.0, 0.001, 0.001,
                    0.006))


@settings(max_examples=40)
@given(st.tuples(small, small, small, small), st.tuples(*[st.floats(1e-5, 0.1)] * 7))
def test_the_camera_is_moved_by_the_step_and_no_surer_than_lines_may_make_it(
    angles: tuple[float, float, float, float], sigmas: tuple[float, ...]
) -> None:
    bench = Bench(plain_robot())
    camera = bench.view["CameraState-1"]
    fix, certificate = verify(bench, (*angles, 0.0, 0.0, 0.0), sigmas)
    effects = bench.ask(SOURCE, certificate)
    effect = effect_on(effects, CameraState)
    old, new = camera.value.mount, effect.value.mount
    assert (new.tilt_rad, new.roll_rad, new.yaw_rad, new.height_m) == pytest.approx(
        (old.tilt_rad + angles[0], old.roll_rad + angles[1], old.yaw_rad + angles[2], old.height_m + angles[3]))
    assert (effect.value.nominal_mount, effect.value.nominal_lens) == (old, camera.value.lens)
    wanted = [max(sigma, floor) ** 2 for sigma, floor in zip(sigmas, FLOORS, strict=True)]
    assert np.allclose(effect.value.covariance, np.diag(wanted), atol=1e-15)
    assert effect.value.counted == ((HERE.x_m, HERE.y_m, HERE.heading_rad),)
    assert reasons(effect) == {certificate.id, fix.id, camera.id}


def test_so_many_looks_are_remembered_and_what_was_told_first() -> None:
    bench = Bench(plain_robot())
    told = bench.view["CameraState-1"].value
    for number in range(MAX_COUNTED + 3):
        _, certificate = verify(bench, (1e-3,) + (0.0,) * 6, (0.01,) * 7, Pose2(float(number), 0.0, 0.0))
        bench.apply(*bench.ask(SOURCE, certificate) or ())
    now = bench.view["CameraState-1"].value
    assert [look[0] for look in now.counted] == [float(n) for n in range(3, MAX_COUNTED + 3)]
    assert now.as_nominal().mount == told.mount
    assert now.mount.tilt_rad == pytest.approx(told.mount.tilt_rad + 1e-3 * (MAX_COUNTED + 3))


@pytest.mark.parametrize("more", [-1e-6, 1e-6])
def test_only_where_the_yaw_is_less_sure_than_before_does_its_way_end(more: float) -> None:
    bench = Bench(plain_robot())
    camera = bench.view["CameraState-1"].value
    before = math.sqrt(compute_camera_covariance(camera)[YAW, YAW])
    travel = bench.put(begin_travel(Pose2(0.0, 0.0, 0.0), diagonal(0.1, 0.1), 0.0, 0.1))
    sigmas = [0.01] * 7
    sigmas[YAW] = before + more
    fix, certificate = verify(bench, (0.0, 0.0, 0.005) + (0.0,) * 4, tuple(sigmas))
    effects = bench.ask(SOURCE, certificate)
    ways = made(effects, Travel)
    assert bool(ways) == (more > 0.0)
    if ways:
        (way,) = ways
        assert (way.began, way.gone_m, way.heading_rad) == (HERE, 0.0, HERE.heading_rad)
        assert way.yaw_rad == pytest.approx(camera.mount.yaw_rad + 0.005)
        assert way.yaw_variance == pytest.approx(sigmas[YAW] ** 2)
        assert np.array_equal(way.covariance, fix.value.covariance)  # of the pose, not of the camera
        effect = effect_on(effects, Travel)
        assert isinstance(effect, Revise) and effect.entry.id == travel.id and reasons(effect) == {"CameraState"}


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    check_source(SOURCE, bench, verify(bench, (0.01,) * 7, (0.01,) * 7)[1], without=("PoseFix-1", "CameraState-1"))
    assert bench.ask(SOURCE, verify(bench, (), (0.01,) * 7)[1]) is None  # the lines say nothing of it
