"""A run as tables: decisions, believed poses with their covariance, milestones, turning points, and the true poses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, fields

from harvey.errors import BadInput
from harvey.run_files.run_directory import RunDirectory
from harvey.run_files.run_head import SIMULATOR, RunHead
from harvey.story.milestones import MilestoneRow, read_milestones
from harvey.story.turns import read_turning_points
from harvey.why.decisions import time_at
from harvey.why.history import History
from harvey.why.sentences import value_of
from logs.reader import read_true_track
from logs.turning_points import TurningPoint
from world_models.building.world import World
from world_models.entries.location import Hypothesis

Cell = str | int | float | bool | None
SEPARATOR = " "
"""Between the names of entries in one cell: names have no blank."""


@dataclass(frozen=True, slots=True)
class Table:
    """One table.

    Attributes:
        name: of its file.
        columns: their names end in their unit: _m, _rad, _s.
        kinds: of each column: str, int, float or bool; a cell may be None too, where nothing is known.
        rows: as many cells as columns.
    """

    name: str
    columns: tuple[str, ...]
    kinds: tuple[type, ...]
    rows: Sequence[tuple[Cell, ...]]


DECISIONS: Mapping[str, type] = {
    "cycle": int, "time_s": float, "level": str, "knowledge_source": str, "trigger": str, "rating": float,
    "pending": int, "observed": str, "made": str, "refused": str}
POSES: Mapping[str, type] = {
    "cycle": int, "time_s": float, "entry": str, "locale": str, "x_m": float, "y_m": float, "heading_rad": float,
    "sigma_m": float, "sigma_rad": float, "cov_xx": float, "cov_xy": float, "cov_xh": float, "cov_yy": float,
    "cov_yh": float, "cov_hh": float, "basis": str, "status": str, "weight": float, "world_x_m": float,
    "world_y_m": float, "world_heading_rad": float}
"""Pose and covariance are in the locale's frame; h is the heading."""
MILESTONES: Mapping[str, type] = {
    "cycle": int, "time_s": float, "name": str, "verdict": str, "expected": int, "matched": int,
    "deviation_m": float, "deviation_rad": float, "p_false": float, "entries": str}
TURNS: Mapping[str, type] = {"cycle": int, "time_s": float, "kind": str, "text": str}
TRUTH: Mapping[str, type] = {"cycle": int, "world_x_m": float, "world_y_m": float, "world_heading_rad": float}


def read_tables(run: RunDirectory, history: History) -> Iterator[Table]:
    """All of them; the true poses only of a simulated run that has its recording.

    Raises:
        BadInput, RecordingError: the journal or the recording cannot be read.
    """
    yield _table("decisions", DECISIONS, [*_decisions(history)])
    yield _table("poses", POSES, [*_poses(history, _world(run))])
    yield _table("milestones", MILESTONES, [_milestone(row) for row in read_milestones(history)])
    yield _table("turning_points", TURNS, [_turn(point) for point in read_turning_points(history)])
    if _kind(run) == SIMULATOR and run.recording.is_file():
        yield _table("truth", TRUTH, read_true_track(run.recording))


def _table(name: str, columns: Mapping[str, type], rows: Sequence[tuple[Cell, ...]]) -> Table:
    return Table(name, tuple(columns), tuple(columns.values()), rows)


def _decisions(history: History) -> Iterator[tuple[Cell, ...]]:
    for decision in history.decisions():
        chosen = decision.chosen
        who = (None, None, None) if chosen is None else (chosen.source, chosen.trigger, chosen.rating)
        observed, made = (SEPARATOR.join(one.ref for one in some) for some in (decision.observed, decision.made))
        yield (decision.cycle, time_at(history, decision.cycle), decision.focus, *who, decision.pending, observed, made,
               decision.refused)


def _poses(history: History, world: World | None) -> Iterator[tuple[Cell, ...]]:
    for record in history.of_kind("Hypothesis"):
        if record.change == "Retracted":
            continue
        value = value_of(record, Hypothesis)
        pose, (xx, xy, xh), (_, yy, yh), (_, _, hh) = value.locale_from_robot, *value.covariance
        there = None if world is None else value.world_from_robot(world)
        in_world = (None, None, None) if there is None else (there.x_m, there.y_m, there.heading_rad)
        yield (record.cycle, time_at(history, record.cycle), record.ref, value.locale, pose.x_m, pose.y_m,
               pose.heading_rad, value.sigma_m, value.sigma_rad, xx, xy, xh, yy, yh, hh, value.basis, value.status,
               value.weight, *in_world)


def _milestone(row: MilestoneRow) -> tuple[Cell, ...]:
    *cells, refs = (getattr(row, field.name) for field in fields(row))
    return (*cells, SEPARATOR.join(refs))


def _turn(point: TurningPoint) -> tuple[Cell, ...]:
    cycle, kind, text, time_s = astuple(point)
    return cycle, time_s, kind, text


def _world(run: RunDirectory) -> World | None:
    """The world of the run; None where its file is not as it was, so that nothing is placed in another."""
    try:
        return RunHead.read(run.path).load_world()
    except BadInput:
        return None


def _kind(run: RunDirectory) -> str:
    try:
        return RunHead.read(run.path).kind
    except BadInput:
        return ""
