"""Laws of the probe photographer: a lost robot has one bright picture from where it stands, and asks for no more."""

from __future__ import annotations

import numpy as np
import pytest

from blackboard import Entry
from generated_boards import Bench, all_reasons
from harvey.testing import check_source, plain_robot
from knowledge_sources.reads import is_dark
from knowledge_sources.relocalizer.probe_photographer import MAX_DARK_FRAMES, ProbePhotographer
from world_models.entries import PictureRequest, Segments

SOURCE = ProbePhotographer()


def looked(contrast: float = 40.0, brightness: float = 120.0, milestone: str = "") -> Segments:
    return Segments("CameraPicture-1", milestone, np.zeros((0, 2, 2)), np.zeros(0), contrast, brightness)


def lost() -> tuple[Bench, Entry[object]]:
    bench = Bench(plain_robot())
    bench.believe()
    return bench, bench.doubt()


def test_lost_it_asks_for_a_picture_for_the_search_and_names_the_doubt() -> None:
    bench, doubt = lost()
    effects = bench.ask(SOURCE, doubt)
    assert effects is not None
    assert [e.value for e in effects] == [PictureRequest("probe")] and all_reasons(effects) == {doubt.id}


@pytest.mark.parametrize(("contrast", "brightness"), [(40.0, 120.0), (0.0, 120.0), (0.0, 0.0)])
def test_a_picture_counts_unless_it_is_dark(contrast: float, brightness: float) -> None:
    """A bare wall in the light has no contrast, and is a picture; the dark is none."""
    bench, doubt = lost()
    seen = bench.put(looked(contrast, brightness))
    assert is_dark(seen.value) == (contrast == brightness == 0.0)
    for trigger in (doubt, seen):
        assert (bench.ask(SOURCE, trigger) is not None) == is_dark(seen.value)


def test_what_was_seen_before_the_last_motion_or_before_it_was_lost_or_for_a_milestone_does_not_count() -> None:
    bench = Bench(plain_robot())
    belief = bench.believe()
    bench.put(looked())
    doubt = bench.doubt()
    assert bench.ask(SOURCE, doubt) is not None
    bench.put(looked(milestone="Milestone-1"))
    assert bench.ask(SOURCE, doubt) is not None
    bench.put(looked())
    assert bench.ask(SOURCE, doubt) is None
    _, report = bench.move()
    moved = bench.revise(belief, motion=report.id, basis="odometry")
    assert bench.ask(SOURCE, moved) is not None
    bench.put(looked())
    assert bench.ask(SOURCE, moved) is None


@pytest.mark.parametrize(("taken", "asks"), [(MAX_DARK_FRAMES - 1, True), (MAX_DARK_FRAMES, False)])
def test_it_waits_for_light_so_long(taken: int, asks: bool) -> None:
    bench, doubt = lost()
    for _ in range(taken):
        bench.put(looked(0.0, 0.0))
    assert (bench.ask(SOURCE, doubt) is not None) == asks


def test_it_keeps_the_laws_of_all_sources() -> None:
    check_source(SOURCE, *lost())
