"""Tasks: what a text asks for, however it is said, and the shortest tour."""

from __future__ import annotations

import re
import tomllib
from itertools import pairwise, permutations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import harvey
from harvey.runner.resume import find_remains
from harvey.simulation.simulated_run import resume_mission
from harvey_words.tasks.task_tour import order_stops
from harvey_words.tasks.task_words import TaskWordsError, read_wanted
from logs.run_directory import RunDirectory
from sim.scenario import parse_scenario
from tests.recorded_runs import cut_off

TEXTS = tomllib.loads((Path(__file__).parent / "data/tasks.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("texts", TEXTS["alike"])
def test_paraphrases_ask_for_the_same(texts: list[str]) -> None:
    assert [read_wanted(text) for text in texts] == [read_wanted(texts[0])] * len(texts)


@pytest.mark.parametrize("text", TEXTS["refused"])
def test_what_is_not_understood_is_named(text: str) -> None:
    with pytest.raises(TaskWordsError, match=TEXTS["refused"][text]):
        read_wanted(text)


@pytest.mark.parametrize(("text", "places", "told"), TEXTS["told"])
def test_a_way_in_a_task_is_told_apart_from_places(text: str, places: list[str], told: list[str]) -> None:
    steps = read_wanted(text)
    assert [step.phrase for step in steps if not step.is_told] == places
    assert [step.phrase for step in steps if step.is_told] == told


@given(st.text(max_size=10_000) | st.lists(st.sampled_from(str(TEXTS).split())).map(" ".join))
def test_no_text_raises_anything_else(text: str) -> None:
    try:
        assert read_wanted(text)
    except TaskWordsError as error:
        assert str(error).startswith("expected")


@given(st.integers(1, 11), st.integers(0, 1000))
def test_a_tour_is_the_shortest(n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    places, ends = rng.uniform(0.0, 50.0, (n + 1, 2)), rng.uniform(0.0, 50.0, n) * (seed % 2)
    ways = np.linalg.norm(places[:, None] - places, axis=2)

    def measure(order: tuple[int, ...]) -> float:
        return float(sum(ways[a, b] for a, b in pairwise((0, *(stop + 1 for stop in order)))) + ends[order[-1]])

    order = order_stops(ways, ends)
    assert sorted(order) == list(range(n))
    assert n > 6 or measure(order) == pytest.approx(min(map(measure, permutations(range(n)))))


def test_the_scenario_of_the_readme_is_read() -> None:
    readme = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    block, = re.findall(r"^```toml\n(.*?)^```$", readme, re.MULTILINE | re.DOTALL)
    read = parse_scenario(f'world = "two_ways"\ngoal = "(ptrans (reception (15,12,0)) (archive (9,6,0)))"\n{block}')
    assert [helper.room for helper in read.helper] == ["library"]


def test_a_task_is_done_replayed_and_gone_on_with(tmp_path: Path) -> None:
    said = "Wait for a word, then leave by the rust door and walk to the fire hose, then come back within 1 second"
    mission = parse_scenario(f'world = "two_ways"\ngoal = "(ptrans (reception (15,12,0)) (archive (9,6,0)))"\n'
                             f'task = "{said}"\nstart.put_down_sigma_m = 0.03\n[[helper]]\nroom = "reception"\n')
    whole = harvey.run(mission, out=tmp_path / "whole")
    assert whole.outcome == "blocked" and "3 of 4 steps were done" in whole.reason and whole.final_error_m is not None
    assert "hose" in whole.reason and "was seen" in whole.reason
    assert harvey.open_run(tmp_path / "whole").replay() is None
    cut = cut_off(RunDirectory(tmp_path / "whole"), tmp_path / "cut", 12)
    assert resume_mission(cut, find_remains(cut)).reason == whole.reason
