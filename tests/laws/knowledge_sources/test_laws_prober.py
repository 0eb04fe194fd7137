"""Laws of the prober: the motion that a search asks for is carried out, slowly where nothing tells of the floor."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from generated_boards import Bench, all_reasons
from harvey.testing import check_source, plain_robot
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


def test_it_keeps_the_laws_of_all_sources() -> None:
    bench = Bench(plain_robot())
    bench.believe()
    bench.doubt()
    check_source(Prober, bench, bench.put(PlaceSearch("probe", "", (0.1, 0.0))))
