"""Frames on the board: asked for before they come, in any order, gone when nobody needs them, back when asked for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from random import Random
from typing import Any

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from blackboard import (
    Change,
    Decision,
    Effect,
    Level,
    Post,
    Posted,
    Ref,
    Registry,
    Revise,
    Scheduler,
    View,
    Watch,
    decision_record,
)
from blackboard.kinds import Kind
from experiments.generated.missions import HALLWAY
from harvey.agent import build_agent
from harvey.runner.ports import WorldPort
from harvey.runner.replay import open_originals
from harvey.simulation.simulated_run import run_mission
from harvey.wiring import load_kinds
from knowledge_sources.model.model_reviser import ModelReviser
from knowledge_sources.reads import find_building, find_frames
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from logs.records import EntryRecord, decision_of, effect_of
from logs.run_directory import RunDirectory
from logs.run_head import RunHead
from logs.timeline import Timeline
from sim.scenario import parse_scenario
from sim.stage import Stage, build_stage
from strategies import Note
from without_frames import list_decided
from world_models.building.locale_frame import LocaleFrame
from world_models.building.world import World
from world_models.entries import Hypothesis, UserReport, diagonal
from world_models.entries.entry_kinds import KINDS
from world_models.files.toml.source import Source
from world_models.files.world_files import read_world
from world_models.frame_store import FrameStore
from world_models.frames import Pose2

ROOTS = ("two-doors", "research-center")
FEW = 1
"""So many frames stay that nothing on the board names."""


def check_asked_for(decisions: Iterable[Mapping[str, Any]], left: Mapping[int, Iterable[str]] = {}) -> int:
    """Each frame rests on a request that names its locale, and is on the board once; returns how many came.

    Args:
        left: ids of the entries that left memory, by cycle.
    """
    requests, there, came = dict[str, Any](), dict[str, str](), 0
    for data in decisions:
        decision = decision_of(data)
        for entry in decision.observed:
            if entry.type != LocaleFrame.__name__ or entry.change != "Posted":
                continue
            name = entry.fields["locale"]
            (reason,) = entry.because
            assert name in requests[reason]["locales"] or (name in ROOTS and "" in requests[reason]["locales"])
            assert entry.author == "world" and name not in there.values()
            there[entry.id] = name
            came += 1
        requests |= {entry.ref: entry.fields for entry in decision.made if entry.type == "FrameRequest"}
        for id in left.get(decision.cycle, ()):
            there.pop(id, None)
    return came


def test_a_frame_that_nobody_asked_for_is_never_on_the_board(told_run: RunDirectory, lost_run: RunDirectory) -> None:
    assert check_asked_for(record.data for record in Timeline(told_run.journal).decisions()) == 3
    assert check_asked_for(record.data for record in Timeline(lost_run.journal).decisions()) > 8


@given(st.integers(0, 2**32))
@settings(max_examples=2, phases=(Phase.explicit, Phase.generate))
def test_the_order_in_which_frames_arrive_does_not_change_decisions(lost_run: RunDirectory, seed: int) -> None:
    """What the world answered in one cycle comes in another order, so the entries have other names."""
    agent = build_agent(RunHead.read(lost_run.path))
    originals, scheduler, random = open_originals(lost_run, agent.store), agent.scheduler(), Random(seed)
    records, decided, most = list(Timeline(lost_run.journal).decisions()), list[Any](), 0
    for record in records:
        frames = [i for i, entry in enumerate(record.observed) if entry.type == LocaleFrame.__name__]
        most = max(most, len(frames))
        for entry in _shuffled(record.observed, random):
            scheduler.post([effect_of(entry, originals, scheduler.view, scheduler.kinds)], entry.author)
        decision = scheduler.step()
        assert decision is not None
        decided.append(decision_record(decision))
    assert most >= 6
    assert list_decided(decided) == list_decided(record.data for record in records)
    assert [_list_used(data, decided) for data in decided] == [
        _list_used(record.data, [r.data for r in records]) for record in records]


def _shuffled(observed: Iterable[EntryRecord], random: Random) -> list[EntryRecord]:
    """The answers of the world in another order, then the rest."""
    world = [entry for entry in observed if entry.author == "world"]
    random.shuffle(world)
    return world + [entry for entry in observed if entry.author != "world"]


def _list_used(data: Mapping[str, Any], decisions: Iterable[Mapping[str, Any]]) -> set[str]:
    """What an act read, frames by the name of their locale."""
    names = {entry["entry"].partition(".")[0]: entry["value"]["locale"] for decision in decisions
             for entry in decision["observed"] if entry["type"] == LocaleFrame.__name__}
    split = [ref.partition(".") for ref in data.get("used", ())]
    return {f"{names.get(id, id)}.{revision}" for id, _, revision in split}


def test_frames_that_left_come_back_and_the_robot_does_the_same() -> None:
    """Along a hallway with eight rooms at it, which are seen into all the way; one frame stays that nothing names."""
    stage = build_stage(parse_scenario(HALLWAY, "hallway"))
    usual, few = _drive(stage, None), _drive(stage, FEW)
    assert list_decided(few.data) == list_decided(usual.data)
    came = check_asked_for(few.data, few.left)
    assert came > 2 * check_asked_for(usual.data, usual.left)
    assert 0 < came - sum(map(len, few.left.values())) <= 11


@dataclass(frozen=True)
class Driven:
    """The decisions of a mission, and the frames that left memory, by cycle."""

    data: list[Mapping[str, Any]]
    left: Mapping[int, list[str]]


def _drive(stage: Stage, keep: int | None) -> Driven:
    decisions: list[Decision] = []
    with pytest.MonkeyPatch.context() as patch:
        marks = _marks_with(load_kinds(), keep)
        patch.setattr(Registry, "marks", lambda _self: marks)
        assert run_mission(stage, 3, sinks=[decisions.append]).outcome == "reached"
    return Driven([decision_record(d) for d in decisions], {d.cycle: _frames_in(d.left) for d in decisions})


def _marks_with(kinds: Registry, keep: int | None) -> Mapping[type[Any], Kind]:
    known = kinds.marks()
    return known if keep is None else {**known, LocaleFrame: replace(known[LocaleFrame], keep=keep)}


def _frames_in(refs: Iterable[Ref]) -> list[str]:
    return [ref.id for ref in refs if ref.id.startswith(LocaleFrame.__name__)]


ROOMS = 24
CHAIN = """
name = "chain"
units = "metres"
include = ["standard"]
[defaults]
kind = "office"
[locales]
""" + "".join(f'r{i} = {{ at = [{4.2 * i}, 0], size = [4, 4], things = [["picture", "north", 2.0]] }}\n'
              for i in range(ROOMS)) + "[doors]\n" + "".join(
    f'd{i} = {{ between = ["r{i}", "r{i + 1}"], wall = "east", along = 2.0, open = true }}\n'
    for i in range(ROOMS - 1))


class Visitor(RobotKnowledgeSource):
    """Goes to the room of a note, and asks for what is known of it and of its neighbours."""

    level = Level.ACTION
    on = (Watch(Note, (Posted,)),)
    writes = (Hypothesis,)

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        room = trigger.entry.value.text
        doors = find_building(view).doorways_of(room)
        frames = find_frames(view, [room, *(door.other(room) for door in doors)])
        there = Hypothesis(room, Pose2(2.0, 2.0, 0.0), diagonal(0.1, 0.1), "command")
        last = view.latest(Hypothesis)
        yield Post(there, frames) if last is None else Revise(last, there, frames)


@pytest.fixture(scope="module")
def chain() -> World:
    return read_world(Source.parse(CHAIN, "chain.toml"))


rooms = st.integers(0, ROOMS - 1)
visits = st.one_of(
    rooms.map(lambda i: Note(f"r{i}")),
    st.builds(UserReport, rooms.map(lambda i: f"r{i}/picture-1"), st.sampled_from(("gone", "there"))),
)


@given(st.lists(visits, min_size=10, max_size=60))
@settings(max_examples=30)
def test_what_nobody_needs_leaves_and_what_is_believed_otherwise_stays(
    chain: World, steps: list[Note | UserReport]
) -> None:
    """However many rooms the robot visits, the board holds those that it is in, those that changed, and a few more."""
    sources = (Visitor(), ModelReviser())
    scheduler = Scheduler(sources, ports=[WorldPort(FrameStore(chain))], kinds=KINDS,
                          retention=_marks_with(load_kinds(), FEW))
    gone = set[str]()
    for step in steps:
        scheduler.post([Post(step)], "test")
        while (decision := scheduler.step()) is not None:
            assert not decision.refused
        frames = {entry.value.name: entry.value for entry in scheduler.view.all(LocaleFrame)}
        assert len(frames) == len(scheduler.view.all(LocaleFrame))
        if isinstance(step, UserReport):
            gone = gone | {step.what} if step.state == "gone" else gone - {step.what}
        assert {change.name for frame in frames.values() for change in frame.changes} == gone
        assert len([frame for frame in frames.values() if not frame.changes]) <= FEW + 2 * 3 + 2
        believed = scheduler.view.latest(Hypothesis)
        assert believed is None or believed.value.locale in frames
