"""What every knowledge source must be; sources are found by looking into the folder."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
from pathlib import Path

import pytest

from blackboard import KnowledgeSource, Level, Role
from harvey.wiring import SUBJECTS, knowledge_sources, load_kinds, sources_of
from knowledge_sources.priority import Priority
from world_models.building.locale_frame import FrameRequest, LocaleFrame
from world_models.entries import Outcome

FOLDER = Path(__file__).parents[3] / "knowledge_sources"
FILES = {path.stem: path for subject in SUBJECTS for path in sorted((FOLDER / subject).glob("[!_]*.py"))}
TREES = {stem: ast.parse(path.read_text(encoding="utf-8")) for stem, path in FILES.items()}
FROM_OUTSIDE = set(load_kinds().of_role(Role.OBSERVATION))
"""What no knowledge source writes, but the user, the body and the clock of the mission."""
LAWS = Path(__file__).parents[2] / "laws" / "knowledge_sources"


def sources_in(stem: str) -> list[type[KnowledgeSource]]:
    return sources_of(importlib.import_module(f"knowledge_sources.{FILES[stem].parent.name}.{stem}"))


KNOWLEDGE_SOURCES = {stem: found[0] for stem in FILES if (found := sources_in(stem))}
each_source = pytest.mark.parametrize("source", KNOWLEDGE_SOURCES.values(), ids=KNOWLEDGE_SOURCES)


def test_there_is_one_knowledge_source_a_file_and_the_file_has_its_name() -> None:
    assert len(KNOWLEDGE_SOURCES) >= 10
    assert [stem for stem in KNOWLEDGE_SOURCES if len(sources_in(stem)) > 1] == []
    assert all(object.__new__(source).name == stem for stem, source in KNOWLEDGE_SOURCES.items())


def test_each_folder_is_a_subject_or_what_the_sources_share() -> None:
    folders = {path.parent.name for path in FOLDER.glob("*/__init__.py")}
    assert folders == {*SUBJECTS, "methods", "reads"}


def test_each_has_its_laws() -> None:
    """In a file of its own: those of all sources, on a board on which it acts, and what it alone must do."""
    files = {stem: LAWS / f"test_laws_{stem}.py" for stem in KNOWLEDGE_SOURCES}
    assert [stem for stem, file in files.items() if not file.exists() or "check_source(" not in file.read_text()] == []


def test_every_knowledge_source_is_wired() -> None:
    assert {type(source) for source in knowledge_sources()} == set(KNOWLEDGE_SOURCES.values())


@each_source
def test_it_says_at_which_level_it_works_what_it_watches_and_what_it_writes(source: type[KnowledgeSource]) -> None:
    assert isinstance(source.level, Level) and (source.closes is None or isinstance(source.closes, Level))
    assert source.on and source.writes
    for kind in (*(watch.value_type for watch in source.on), *source.writes):
        assert dataclasses.is_dataclass(kind) and kind.__dataclass_params__.frozen, kind


@each_source
def test_it_says_what_it_is_and_where_the_method_comes_from(source: type[KnowledgeSource]) -> None:
    assert source.__doc__ and "§" in (inspect.getmodule(source).__doc__ or "") + source.__doc__


def test_what_is_watched_is_written_by_somebody() -> None:
    written = {kind for source in KNOWLEDGE_SOURCES.values() for kind in source.writes} | FROM_OUTSIDE
    watched = {watch.value_type for source in KNOWLEDGE_SOURCES.values() for watch in source.on}
    assert sorted(kind.__name__ for kind in watched - written) == []


@each_source
def test_it_receives_settings_and_nothing_else(source: type[KnowledgeSource]) -> None:
    """So no building, no robot, no body and no truth can be handed to it."""
    given = list(inspect.signature(source).parameters.values())
    assert [p.annotation for p in given] in ([], ["Settings"])


@pytest.mark.parametrize("stem", KNOWLEDGE_SOURCES)
def test_it_keeps_no_memory_but_the_board(stem: str) -> None:
    """It assigns to itself nowhere but in __init__, and writes no log of its own."""
    for function in (n for n in ast.walk(TREES[stem]) if isinstance(n, ast.FunctionDef) and n.name != "__init__"):
        stored = [n for n in ast.walk(function) if isinstance(n, ast.Attribute) and isinstance(n.ctx, ast.Store)]
        assert [ast.unparse(n) for n in stored] == []
        decorators = {ast.unparse(d).split("(")[0].split(".")[-1] for d in function.decorator_list}
        assert not decorators & {"cache", "lru_cache", "cached_property"}
    called = {ast.unparse(n.func) for n in ast.walk(TREES[stem]) if isinstance(n, ast.Call)}
    assert not called & {"print", "open", "setattr", "object.__setattr__", "logging.getLogger"}


@pytest.mark.parametrize("stem", KNOWLEDGE_SOURCES)
def test_it_knows_no_other_knowledge_source(stem: str) -> None:
    modules = {n.module for n in ast.walk(TREES[stem]) if isinstance(n, ast.ImportFrom)}
    assert not modules & {f"knowledge_sources.{other}" for other in KNOWLEDGE_SOURCES}


MOST_LINES = 150
SHARED: dict[str, tuple[int, str]] = {
    "CameraState": (3, "learnt from lines, from the way, and told again to who was lost"),
    "Discrepancy": (13, "who measures a difference posts it; who corrects it says so"),
    "DoorState": (3, "by a leaf in sight, by a touch, and by what a shut door explains"),
    "Drift": (4, "the belief's other half: who turns the heading restarts it"),
    "Evidence": (11, "each who finds that something is not as expected; one weighs it"),
    "FreeFloor": (2, "two senses"),
    "Goal": (4, "set, reached, replaced because lost, replaced because asked"),
    "Hypothesis": (9, "each correction of the belief is one rule"),
    "Impasse": (9, "who sees no way on says so; the mission monitor decides"),
    "Leg": (2, "two ways to drive: in increments, and on the move"),
    "Milestone": (7, "a chain: chosen, predicted, updated, judged, withdrawn"),
    "MotorCommand": (2, "on the way, and to look round when lost"),
    "Obstacle": (5, "by sight, by touch, by a halt, moved with the belief, and taken back with what was on the lens"),
    "Obstruction": (2, "in looks at milestones, and in looks of who is lost"),
    "PictureRequest": (4, "who needs a picture asks for it"),
    "PlanSketch": (8, "a chain: drawn, refined, advanced, led round, withdrawn"),
    "Tracks": (4, "followed, taken again, and dropped on another floor or with what is gone"),
    "AliasOdds": (2, "kept by pictures, ended where a search finds another place"),
    "Travel": (4, "gone on, begun again by either calibration, broken off"),
}
"""The kinds that several knowledge sources write: how many at most, and why. It may only shrink."""


def test_each_kind_is_written_by_one_knowledge_source_but_for_a_short_list() -> None:
    writers: dict[str, int] = {}
    for source in KNOWLEDGE_SOURCES.values():
        for kind in source.writes:
            writers[kind.__name__] = writers.get(kind.__name__, 0) + 1
    writers.pop(FrameRequest.__name__)  # a source that lacks a frame asks for it
    assert {kind: count for kind, count in writers.items() if count > 1} == {
        kind: count for kind, (count, _) in SHARED.items()}
    assert writers[LocaleFrame.__name__] == writers[Outcome.__name__] == 1


@pytest.mark.parametrize("stem", KNOWLEDGE_SOURCES)
def test_it_is_one_rule_in_a_short_file(stem: str) -> None:
    """It does not ask of what type its trigger is: what it watches are several reasons to do one thing."""
    assert FILES[stem].read_text(encoding="utf-8").count("\n") <= MOST_LINES
    asked = [n.args[0] for n in ast.walk(TREES[stem])
             if isinstance(n, ast.Call) and ast.unparse(n.func) in ("isinstance", "type", "issubclass")]
    asked += [n.subject for n in ast.walk(TREES[stem]) if isinstance(n, ast.Match)]
    assert not [ast.unparse(n) for n in asked if "trigger" in ast.unparse(n)]


@each_source
def test_its_priority_is_one_of_the_named_scale_or_rated_by_the_case(source: type[KnowledgeSource]) -> None:
    assert isinstance(source.priority, Priority) or source.rate is not KnowledgeSource.rate
