"""Each number of the pose and matching rooms reaches the method: changed far enough, it changes some result."""

from __future__ import annotations

from dataclasses import Field, fields, replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.paper import pose_scenes
from experiments.paper.pose_solvers import r_and_t, r_then_t, trunc_r_and_t
from knowledge_sources.methods.matching import Peak, match_in_space, match_lines, match_on_floor
from knowledge_sources.methods.pose import (
    fit_displacements,
    med_r_and_t,
    planar_from_lines,
    planar_from_points,
    r_and_t_ml,
)
from knowledge_sources.settings import MatchingSettings, PoseSettings
from world_models.building.model_errors import LineErrors
from world_models.camera import Camera, CameraMount
from world_models.frames import Pose, Pose2

CAMERA = Camera.from_field_of_view(np.radians(65.0))
MOUNT = CameraMount(1.0, 0.1, 0.05).camera_from_robot
TRUTH = Pose2(0.4, -0.1, 0.05)
SIGMA_PX = 0.4
TIGHT_PX = 0.15
"""Stated to the robust solvers, so that many lines are on the border of the inliers."""
SQUARE = 100.0 * np.array([[[1, 1], [1, 2]], [[1, 1], [2, 1]], [[2, 1], [2, 2]], [[1, 2], [2, 2]]])
Array = NDArray[np.float64]


def build_hall() -> Array:
    """Long edges and unevenly spaced doors (n, 2, 3)."""
    lines = [[[1.5, y, z], [18.0, y, z]] for y in (-1.2, 1.2) for z in (0.0, 2.4)]
    for x, y in ((2.6, -1.2), (4.1, 1.2), (6.3, -1.2), (7.0, 1.2), (10.2, -1.2), (12.9, 1.2)):
        lines += [[[x, y, 0.0], [x, y, 2.1]], [[x + 0.9, y, 0.0], [x + 0.9, y, 2.1]], [[x, y, 2.1], [x + 0.9, y, 2.1]]]
    return np.array([*lines, [[18.0, -1.2, 0.0], [18.0, 1.2, 0.0]]])


def observe(rng: np.random.Generator) -> tuple[Array, Array]:
    """The visible lines (n, 2, 3) of the hall and their noisy segments (n, 2, 2)."""
    segments, visible = CAMERA.project_segments(build_hall(), MOUNT @ TRUTH.lifted().inverse())
    return build_hall()[visible], segments[visible] + rng.normal(0.0, SIGMA_PX, segments[visible].shape)


def spoil(segments: Array, part: float, rng: np.random.Generator) -> Array:
    """A part of the segments anywhere."""
    wrong = rng.permutation(len(segments))[: int(part * len(segments))]
    out = segments.copy()
    out[wrong] = rng.uniform(0.0, 511.0, (len(wrong), 2, 2))
    return out


def build_errors(lines: Array) -> LineErrors:
    """Each wall of the hall known to 5 cm across, and each of three groups of its lines to 4 cm along."""
    sides = [lines[:, 0, 1] * side > 0.0 for side in (-1.0, 1.0)]
    groups = [(lines[:, 0, 0] > low) & (lines[:, 0, 0] < low + 4.0) for low in (2.0, 6.0, 10.0)]
    shifts = [np.outer(side, (0.0, 0.05, 0.0)) for side in sides] + [np.outer(g, (0.04, 0.0, 0.0)) for g in groups]
    return LineErrors(("right", "left", "near", "middle", "far"), np.array(shifts))


def solve_inexact(settings: PoseSettings) -> list[Array]:
    """The results where the model is inexact: poses, and displacements found among clutter."""
    out: list[Array] = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        lines = build_hall()
        errors = build_errors(lines)
        true = errors.displace(lines, rng.normal(size=len(errors.displacement_modes)))
        segments, seen = CAMERA.project_segments(true, MOUNT @ TRUTH.lifted().inverse())
        segments = segments[seen] + rng.normal(0.0, SIGMA_PX, segments[seen].shape)
        lines, errors = lines[seen], errors.take(np.flatnonzero(seen))
        prior = Pose2(TRUTH.x_m + 0.1, TRUTH.y_m - 0.1, TRUTH.heading_rad + 0.02)
        covariance = np.diag([0.2, 0.2, 0.05]) ** 2
        for part in (0.0, 0.3):
            planar = planar_from_lines(lines, spoil(segments, part, rng), CAMERA, MOUNT, prior, sigma_px=SIGMA_PX,
                                       prior_covariance=covariance, errors=errors, settings=settings)
            out += [np.array([planar.world_from_robot.x_m]), planar.covariance, planar.inliers]
        beside = segments + rng.uniform(-6.0, 6.0, (len(segments), 1, 2)) + rng.normal(0.0, 3.0, segments.shape)
        for stays in (None, covariance):
            fit = fit_displacements(lines, errors, np.concatenate([segments, beside]), CAMERA, MOUNT, prior, stays,
                                    settings)
            out += [fit.amplitudes, fit.pairs]
    return out


def solve_all(settings: PoseSettings) -> bytes:
    """The results of every solver: few and many lines, near and far priors, with and without outliers."""
    out: list[Array] = []
    scene = pose_scenes.corridor(10)
    for seed in range(6):
        rng = np.random.default_rng(seed)
        noisy = pose_scenes.end_noise(scene.segments_px, SIGMA_PX, rng)
        along = noisy[8, 1] - noisy[8, 0]
        noisy[8] += along * (1.0 + 3.0 / np.linalg.norm(along))  # 3 px beyond the end of its line
        truth = scene.camera_from_world
        far = truth.perturbed(rng.uniform(-0.3, 0.3, 3), rng.uniform(-1.0, 1.0, 3))
        for part, count in ((0.0, len(scene)), (0.45, len(scene)), (0.0, 3), (0.0, 2), (0.0, 5)):
            segments = spoil(noisy, part, rng)[:count]
            data: Any = (scene.lines_world[:count], segments, scene.camera, far)
            for solver in (r_then_t, r_and_t, r_and_t_ml):
                estimate = solver(*data, sigma_px=SIGMA_PX, settings=settings)
                out += [estimate.camera_from_world.translation, estimate.covariance, estimate.inliers]
                out.append(np.array([estimate.ok]))
            for robust, sigma_px in product((med_r_and_t, trunc_r_and_t), (TIGHT_PX, SIGMA_PX)):
                drawn = np.random.default_rng(seed)
                estimate = robust(*data, sigma_px=sigma_px, probability=0.99, rng=drawn, settings=settings)
                out += [estimate.camera_from_world.translation, estimate.covariance, estimate.inliers]
                out.append(np.array([estimate.ok]))
        lines, segments = observe(rng)
        prior = Pose2(TRUTH.x_m + rng.uniform(-1.0, 1.0), TRUTH.y_m + 0.5, TRUTH.heading_rad + rng.uniform(-0.2, 0.2))
        for part, count in ((0.0, len(lines)), (0.5, len(lines)), (0.6, len(lines)), (0.0, 2), (0.0, 5)):
            planar = planar_from_lines(lines[:count], spoil(segments, part, rng)[:count], CAMERA, MOUNT, prior,
                                       sigma_px=TIGHT_PX, settings=settings)
            out += [np.array([planar.world_from_robot.x_m]), planar.covariance, planar.inliers]
        ends, pixels = lines.reshape(-1, 3), spoil(segments, 0.3, rng).reshape(-1, 2)
        planar = planar_from_points(ends, pixels, CAMERA, MOUNT, prior, sigma_px=SIGMA_PX, settings=settings)
        out += [np.array([planar.world_from_robot.x_m]), planar.covariance, planar.inliers]
    out += solve_inexact(settings)
    return b"".join(np.ascontiguousarray(array).tobytes() for array in out)


def match_all(settings: MatchingSettings) -> bytes:
    """The results of the three matchers, in clutter, and of a wrong start."""
    wrong_start = match_lines(SQUARE, np.concatenate([SQUARE, SQUARE[:1] + np.array([3.0, 0.0])]), settings,
                              start=Peak(0.0, (0.0, 0.0), 0.0), first_pairs=((0, 4), (1, 1), (2, 2), (3, 3)))
    out: list[Array] = [wrong_start.pairs]
    for seed in range(8):
        rng = np.random.default_rng(seed)
        lines, segments = observe(rng)
        span = segments[:, 1] - segments[:, 0]
        halves = [np.stack([segments[:, 0] + a * span, segments[:, 0] + b * span], axis=1)
                  for a, b in ((0.02, 0.45), (0.55, 0.98))]
        start, angle = rng.uniform(0.0, 511.0, (120, 2)), rng.uniform(0.0, np.pi, 120)
        length = rng.exponential(30.0, (120, 1)) + 10.0
        clutter = np.stack([start, start + length * np.stack([np.cos(angle), np.sin(angle)], axis=1)], axis=1)
        beside = np.concatenate(halves) + rng.uniform(-4.0, 4.0, (2 * len(segments), 1, 2))
        data = np.concatenate([*halves, *([beside] if seed % 2 else []), clutter])
        turn = rng.uniform(-0.1, 0.1)
        rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        model_px = (segments - 256.0) @ rotation + 256.0 + rng.uniform(-15.0, 15.0, 2)
        match = match_lines(model_px, data, settings)
        out += [match.pairs, np.array([match.steps, match.e_match, *match.transform.shift_px])]
        prior = Pose2(TRUTH.x_m + 0.3, TRUTH.y_m - 0.25, TRUTH.heading_rad + 0.08)
        floor = match_on_floor(lines, data, CAMERA, MOUNT, prior, np.diag([0.2, 0.2, 0.06]) ** 2, settings)
        far = Pose2(TRUTH.x_m + 0.9, TRUTH.y_m - 0.6, TRUTH.heading_rad + 0.25)
        lost = match_on_floor(lines[::3], data, CAMERA, MOUNT, far, np.diag([0.6, 0.6, 0.2]) ** 2, settings)
        out += [lost.pairs, np.array([lost.e_match])]
        camera: Pose = (MOUNT @ TRUTH.lifted().inverse()).perturbed(np.full(3, 0.02), np.full(3, 0.15))
        space = match_in_space(lines, data, CAMERA, camera, np.diag([0.02**2] * 3 + [0.15**2] * 3), settings)
        out += [floor.pairs, np.array([floor.e_match]), space.pairs, np.array([space.e_match])]
    return b"".join(np.ascontiguousarray(array).tobytes() for array in out)


def list_values(field: Field[Any]) -> list[Any]:
    """Other values of a setting, some far from its default."""
    default: Any = field.default
    if isinstance(default, bool):
        return [not default]
    if isinstance(default, int):
        return [value for value in (2, 1, 3 * default, 0) if value != default]
    if isinstance(default, tuple):
        return [tuple(0.3 * value for value in default), default[:1]]
    values = (factor * default for factor in (0.3, 0.9, 1.5, 10.0, 0.05, 1e10))
    return [value for value in values if value <= field.metadata["most"]]


@cache
def solve_by_default() -> bytes:
    return solve_all(PoseSettings())


@cache
def match_by_default() -> bytes:
    return match_all(MatchingSettings())


@pytest.mark.parametrize("field", fields(PoseSettings), ids=lambda field: field.name)
def test_a_setting_of_the_pose_solvers_changes_a_result(field: Field[Any]) -> None:
    changed = (solve_all(replace(PoseSettings(), **{field.name: value})) for value in list_values(field))
    assert any(result != solve_by_default() for result in changed)


@pytest.mark.parametrize("field", fields(MatchingSettings), ids=lambda field: field.name)
def test_a_setting_of_the_matchers_changes_a_result(field: Field[Any]) -> None:
    changed = (match_all(replace(MatchingSettings(), **{field.name: value})) for value in list_values(field))
    assert any(result != match_by_default() for result in changed)
