"""Laws of buildings that their model describes by centimetres wrongly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.generated.floors import generated_floor
from sim.ground_truth.inexact import MAX_SIGMAS, TrueInexact, displace
from sim.scenario import parse_scenario
from sim.stage import build_stage
from world_models.files.construction.builder import build_world
from world_models.files.construction.specs import WorldSpec
from world_models.files.toml.source import Source
from world_models.files.toml.world_reader import WorldReader

SEEDS = st.integers(0, 200)
SIGMAS = st.sampled_from([0.02, 0.05, 0.10])


def read_floor(seed: int) -> WorldSpec:
    reader = WorldReader(Source.parse(generated_floor(seed, 4, open_share=1.0).text, f"floor-{seed}"))
    reader.read_base()
    return reader.spec()


@settings(max_examples=10, deadline=None)
@given(seed=SEEDS)
def test_without_differences_it_is_the_model(seed: int) -> None:
    spec, same = read_floor(seed), displace(read_floor(seed), TrueInexact()).spec
    for one, other in zip(build_world(spec).landmarks, build_world(same).landmarks, strict=True):
        assert one.name == other.name
        np.testing.assert_allclose(one.lines_world, other.lines_world, rtol=0, atol=1e-12)


@settings(max_examples=10, deadline=None)
@given(seed=SEEDS, sigma_m=SIGMAS)
def test_all_that_the_model_has_can_be_built_and_is_near(seed: int, sigma_m: float) -> None:
    spec = read_floor(seed)
    true, model = build_world(displace(spec, TrueInexact(sigma_m=sigma_m, seed=seed)).spec), build_world(spec)
    assert len(true.building_faults) <= len(model.building_faults)
    assert {mark.name for mark in true.landmarks} >= {mark.name for mark in model.landmarks if mark.kind != "wall"}
    known = {mark.name: mark for mark in model.landmarks}
    for mark in true.landmarks:
        if len(mark.lines_world) == len(known[mark.name].lines_world):
            off_m = np.linalg.norm(mark.lines_world - known[mark.name].lines_world, axis=2).max()
            assert off_m <= 3.0 * MAX_SIGMAS * sigma_m


@settings(max_examples=10, deadline=None)
@given(seed=SEEDS, sigma_m=SIGMAS)
def test_a_wall_stays_as_thick_as_it_is(seed: int, sigma_m: float) -> None:
    spec = read_floor(seed)
    true, model = build_world(displace(spec, TrueInexact(sigma_m=sigma_m, seed=seed)).spec), build_world(spec)
    thick = {d.name: np.linalg.norm(d.thresholds_world[0].mean(axis=0) - d.thresholds_world[1].mean(axis=0))
             for d in model.doorways}
    for door in true.doorways:
        across = door.thresholds_world[0].mean(axis=0) - door.thresholds_world[1].mean(axis=0)
        assert np.linalg.norm(across) == pytest.approx(thick[door.name], abs=1e-9)


def test_displacements_have_the_stated_spread() -> None:
    drawn = [displace(read_floor(seed), TrueInexact(sigma_m=0.05, seed=seed)) for seed in range(12)]
    walls = np.concatenate([list(d.walls_m.values()) for d in drawn])
    doors = np.concatenate([list(d.doors_m.values()) for d in drawn])
    for sizes in (walls, doors):
        assert 0.035 < np.sqrt(np.mean(sizes**2)) < 0.06 and np.abs(sizes).max() <= MAX_SIGMAS * 0.05


@settings(max_examples=6, deadline=None)
@given(seed=SEEDS)
def test_shares_of_things_are_missing_and_more(seed: int) -> None:
    spec = read_floor(seed)
    names = {f"{thing.locale}/{thing.name}" for thing in spec.things}
    none = displace(spec, TrueInexact(missing=1.0))
    assert not none.spec.things and set(none.missing) == names
    more = displace(spec, TrueInexact(extra=1.0, seed=seed))
    assert not names & set(more.extra) and len(more.extra) > 0.5 * len(names)
    assert not build_world(more.spec).building_faults


def test_the_stage_is_built_of_it_and_the_model_is_not() -> None:
    text = 'world = "research_center"\ngoal = "(ptrans (hallway (4,4,0)) (hallway (24,4,0)))"\n'
    exact, other = (build_stage(parse_scenario(text + more))
                    for more in ("", "[truth.inexact]\nsigma_cm = 5\nmissing = 0.3\nextra = 0.1\nseed = 7\n"))
    assert len(other.world.things) < len(exact.world.things)
    assert other.start_world == exact.start_world and other.goal_world == exact.goal_world
    low = [s.building.obstacles.segments_world.reshape(-1, 2).min(axis=0) for s in (exact, other)]
    assert not np.allclose(low[0], low[1], atol=1e-3)


@pytest.mark.parametrize("seed", [0, 3])
def test_all_doors_are_beside_and_all_corridors_wider_by_what_is_asked(seed: int) -> None:
    spec = read_floor(seed)
    doors = displace(spec, TrueInexact(door_m=0.1, seed=seed))
    assert set(np.round(np.abs(list(doors.doors_m.values())), 9)) <= {0.1, 0.05, 0.025}
    assert not any(doors.walls_m.values())
    wider = build_world(displace(spec, TrueInexact(corridor_m=0.1, seed=seed)).spec)
    model = build_world(spec)
    corridors = [name for name, locale in spec.locales.items() if locale.kind == "hallway"]
    for name in corridors:
        before, after = (np.ptp(world.outline(name), axis=0) for world in (model, wider))
        assert np.min(after) == pytest.approx(np.min(before) + 0.1)
        assert np.max(after) == pytest.approx(np.max(before))
    assert corridors
