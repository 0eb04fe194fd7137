"""Laws of the prober: the motion that a search asks for is carried out, slowly where nothing tells of the floor."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from blackboard import Level, Posted
from generated_boards import Bench, all_reasons, wakes
from harvey.testing import plain_robot
from knowledge_sources.relocalizer.prober import Prober
from knowledge_sources.settings import DEFAULT
from world_models.entries import MotorCommand, PlaceSearch

CREEP = DEFAULT.action.creep_speed_m_per_s


@given(st.floats(-3.1, 3.1), st.sampled_from((0.0, 1e-9, 0.4)), st.booleans())
def test_it_drives_what_the_search_says(turn_rad: float, move_m: float, keeps_to_seen_floor: bool) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    doubt = bench.doubt()
    search = bench.put(PlaceSearch("probe", "two places", (turn_rad, move_m)))
    settings = replace(DEFAULT, action=replace(DEFAULT.action, keeps_to_seen_floor=keeps_to_seen_floor))
    effects = bench.ask(Prober(settings), search)
    assert effects is not None
    (effect,) = effects
    slowly = CREEP if keeps_to_seen_floor and move_m > 0.0 else None
    assert effect.value == MotorCommand(turn_rad, move_m, slowly)
    assert all_reasons(effects) == {search.id, doubt.id}


@pytest.mark.parametrize(("status", "probe", "acts"), [
    ("probe", (0.1, 0.0), True), ("probe", None, False), ("found", (0.1, 0.0), False)])
def test_only_a_search_that_asks_for_a_motion_wakes_it(
    status: str, probe: tuple[float, float] | None, acts: bool
) -> None:
    search = Bench().put(PlaceSearch(status, "", probe))
    assert wakes(Prober(), Posted(search)) == acts


@pytest.mark.parametrize("lacks", ["nothing", "belief", "doubt", "level", "rest"])
def test_it_probes_only_when_lost_and_standing(lacks: str) -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.doubt(Level.PLAN if lacks == "level" else Level.GOAL)
    search = bench.put(PlaceSearch("probe", "", (0.1, 0.0)))
    if lacks != "level":
        bench.lack(lacks)
    assert (bench.ask(Prober(), search) is not None) == (lacks == "nothing")
