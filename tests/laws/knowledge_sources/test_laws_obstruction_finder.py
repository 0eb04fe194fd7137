"""Laws of the obstruction finder: what stands still in looks of several directions is before the camera."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from blackboard import Entry, Level, Post
from generated_boards import Bench, effect_on, made, reasons
from harvey.testing import check_source, plain_robot
from knowledge_sources.milestone.obstruction_finder import MIN_OBSTRUCTION_LOOKS, ObstructionFinder
from things_in_hall import known_by_sight
from world_models.entries import Evidence, FloorThing, FreeFloor, Obstacle, Obstruction, Segments

SOURCE = ObstructionFinder()
CORNERS = np.array([(70.0, 90.0), (190.0, 90.0), (190.0, 230.0), (70.0, 230.0)])
FRAME = np.stack([CORNERS, np.roll(CORNERS, -1, axis=0)], axis=1)
"""The four sides of what stands before the camera."""
TURN_RAD = math.radians(40.0)


def look(bench: Bench, number: int, sides: np.ndarray = FRAME) -> Entry[Segments]:
    """A look in another direction, with a line besides that is elsewhere each time."""
    milestone = bench.await_milestone(look_heading_rad=number * TURN_RAD, tried=(0.0,) if number else (),
                                      status="expected")
    other = np.array([[(12.0 + 9.0 * number, 10.0), (12.0 + 9.0 * number, 60.0)]])
    segments = np.concatenate([sides, other])
    entry = bench.put(Segments(f"CameraPicture-{number}", milestone.id, segments, np.full(len(segments), 0.3), 40.0))
    bench.revise(milestone, status="not testable")
    return entry


def looks(count: int, *, flipped: bool = False) -> tuple[Bench, Entry[Segments]]:
    sides = np.stack([255.0 - FRAME[..., 0], FRAME[..., 1]], axis=-1) if flipped else FRAME
    bench = Bench(plain_robot())
    bench.believe()
    bench.pursue()
    last = [look(bench, number, sides) for number in range(count)][-1]
    return bench, last


@pytest.mark.parametrize("count", [MIN_OBSTRUCTION_LOOKS - 1, MIN_OBSTRUCTION_LOOKS, MIN_OBSTRUCTION_LOOKS + 1])
@pytest.mark.parametrize("flipped", [False, True])
def test_in_so_many_looks_it_is_no_chance(count: int, flipped: bool) -> None:
    bench, last = looks(count, flipped=flipped)
    effects = bench.ask(SOURCE, last)
    assert (effects is not None) == (count >= MIN_OBSTRUCTION_LOOKS)
    if effects is not None:
        effect = effect_on(effects, Obstruction)
        outline = np.array(effect.value.outline_px)
        wanted = (255.0 - CORNERS[:, 0], CORNERS[:, 1]) if flipped else (CORNERS[:, 0], CORNERS[:, 1])
        for axis in (0, 1):
            assert outline[:, axis].min() == pytest.approx(wanted[axis].min(), abs=12.0)
            assert outline[:, axis].max() == pytest.approx(wanted[axis].max(), abs=12.0)
        assert {f"Segments-{k + 1}" for k in range(count)} == reasons(effect)
        bench.apply(*effects)
        assert bench.ask(SOURCE, last) is None  # the board says it


@pytest.mark.parametrize("first", ["with it", "without it"])
def test_what_the_last_looks_show_counts(first: str) -> None:
    """It may have come since; what they do not show any more is not before the camera."""
    bench = Bench(plain_robot())
    bench.believe()
    bench.pursue()
    bare = np.zeros((0, 2, 2))
    shown = [FRAME, FRAME, FRAME, bare, bare] if first == "with it" else [bare, bare, FRAME, FRAME, FRAME]
    last = [look(bench, number, sides) for number, sides in enumerate(shown)][-1]
    assert bool(made(bench.ask(SOURCE, last), Obstruction)) == (first == "without it")


LENS = FloorThing((), 0.1, 0.4, 0.1, 0.95, (60.0, 90.0, 251.0, 200.0), "unlike the floor")


@pytest.mark.parametrize("shifts", [(0.0, 4.0, -1.0), (0.0, 12.0, 12.0)])
@pytest.mark.parametrize("moved_m", [0.35, 0.1])
def test_what_keeps_its_box_while_it_would_have_moved_is_before_the_camera_and_no_thing(
    shifts: tuple[float, ...], moved_m: float
) -> None:
    """The right side is the picture's border; the box shifts by so many pixels."""
    bench = Bench(plain_robot())
    held = bench.stand(2.0, 2.0, 0.2, 0.2, by="camera")
    for number, shift_px in enumerate(shifts):
        footprint = tuple((x + number * moved_m, y) for x, y in held.value.footprint)
        left, *rest = LENS.box_px
        thing = replace(LENS, footprint=footprint, box_px=(left + shift_px, *rest))
        scan = bench.put(FreeFloor("camera", "hall", 0.0, 0.0, (), (), (), (), (), (thing,), 1.0))
    effects = bench.ask(SOURCE, scan) or ()
    assert len(effects) == (shifts[1] < 6.0 and moved_m > 0.3)
    bench.put(known_by_sight(replace(held.value, certainty=0.95)))
    for shows in (*effects, Post(Obstruction(((0.0, 0.0), (90.0, 0.0), (90.0, 90.0))))):
        (found,) = bench.apply(shows)[:1]
        taken = bench.ask(SOURCE, found.entry) or ()
        assert [type(effect.value) for effect in taken] == [Evidence, Obstacle] * (shows in effects)
        assert all(effect.value.status == "gone" for effect in taken[1:])


def test_what_was_known_is_a_reason_of_what_is_known_now() -> None:
    bench, last = looks(MIN_OBSTRUCTION_LOOKS)
    known = bench.put(Obstruction(((0.0, 0.0), (30.0, 0.0), (30.0, 30.0), (0.0, 30.0))))
    effect = effect_on(bench.ask(SOURCE, last), Obstruction)
    assert effect.entry is known and known.id in reasons(effect)


def test_looks_before_the_goal_do_not_count() -> None:
    bench, _ = looks(MIN_OBSTRUCTION_LOOKS)
    bench.revise(bench.view["Goal-1"], status="abandoned")
    bench.pursue()
    assert bench.ask(SOURCE, look(bench, 5)) is None


@pytest.mark.parametrize("was_tried", [False, True])
@pytest.mark.parametrize("in_doubt", [False, True])
def test_it_asks_only_when_a_look_told_nothing_or_the_belief_is_in_doubt(was_tried: bool, in_doubt: bool) -> None:
    bench, _ = looks(MIN_OBSTRUCTION_LOOKS)
    milestone = bench.await_milestone(look_heading_rad=3.0, tried=(0.0,) if was_tried else ())
    if in_doubt:
        bench.doubt(Level.PLAN)
    seen = bench.view["Segments-1"].value
    last = bench.put(replace(seen, milestone=milestone.id))
    assert (bench.ask(SOURCE, last) is not None) == (was_tried or in_doubt)


def test_it_keeps_the_laws_of_all_sources() -> None:
    check_source(SOURCE, *looks(MIN_OBSTRUCTION_LOOKS))
