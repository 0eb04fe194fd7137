"""Model reviser (§3.4): what is found or reported of the building revises the frames of its locales."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from blackboard import Change, Effect, Entry, Level, Posted, Revise, Revised, View, Watch
from knowledge_sources.methods.belief import weigh_among
from knowledge_sources.methods.calibration import compute_scale_sigma
from knowledge_sources.methods.floor import (
    is_width,
    place_walls,
    redraw,
    redraw_door,
    revise_by_difference,
    revise_by_door,
    revise_by_report,
    revise_by_thing,
)
from knowledge_sources.priority import Priority
from knowledge_sources.reads import find_building, find_frames, list_contradicted, list_filed_doors, name_model
from knowledge_sources.robot_knowledge_source import RobotKnowledgeSource
from world_models.building.locale_frame import LocaleFrame
from world_models.building.model_errors import BETWEEN, find_facing, measure_between
from world_models.entries import BELIEVED, KNOWN, OTHERWISE, CameraState, Difference, DoorState, Obstacle, UserReport
from world_models.entries.difference import DOORS, MODEL


class Statement(NamedTuple):
    """What an entry says of locales.

    Attributes:
        locales: whose frames it concerns.
        revise: a frame as it is known by it; raises ValueError where the frame has nothing that could be so.
        is_from_user: whether a user reported it, who is answered.
        error: why it concerns none, in words; besides: what else it rests on.
    """

    entry: Entry[Any]
    locales: tuple[str, ...]
    revise: Callable[[LocaleFrame], LocaleFrame]
    is_from_user: bool = False
    error: str = ""
    besides: tuple[Entry[Any], ...] = ()


class Case(NamedTuple):
    """Frames as they are known now, each with what says so; and answers to reports, in words."""

    frames: tuple[tuple[Entry[LocaleFrame], LocaleFrame, tuple[Entry[Any], ...]], ...]
    answers: tuple[tuple[Entry[UserReport], str], ...]


class ModelReviser(RobotKnowledgeSource):
    """Alone revises what is known of locales: by things, doors, what surely differs, and what somebody says.

    Of two that say otherwise the newer counts, and a report that is found to be wrong says so. All that is new of a
    locale comes into its frame at once. A door is in the frames of both its rooms, a wall in those of all at it. Walls
    are redrawn once it is sure that they, and not the camera, differ; where no wall explains that the model is inexact,
    the whole building is, until looks acquit it. What changes no plan revises no frame. What the model has nothing of
    is answered. It acts at once, before the next increment: the door may be just ahead.
    """

    level, priority = Level.ACTION, Priority.ENTER
    on = (Watch(UserReport, (Posted,)), Watch(Obstacle), Watch(DoorState),
          Watch(Difference, (Posted, Revised), lambda d: bool({"jamb", "wall"} & {rival.kind for rival in d.rivals})))
    writes = (LocaleFrame, UserReport)

    def bind(self, view: View, trigger: Change) -> Case | None:
        """The frames that differ by what is new, and all reports that are not answered yet."""
        statements = sorted(self._list_statements(view), key=lambda said: said.entry.cycle)
        new = [said for said in statements if said.is_from_user or said.entry is trigger.entry]
        frames, taken, errors = [], set[str](), {s.entry.id: s.error for s in statements if s.error}
        for frame in find_frames(view, {name for said in new for name in said.locales}):
            value, reasons = frame.value, list[Entry[Any]]()
            for said in statements:
                is_new = said in new or said.entry.cycle >= frame.cycle
                if not is_new or frame.value.name not in said.locales:
                    continue
                try:
                    revised = said.revise(value)
                except ValueError as error:
                    errors[said.entry.id] = str(error)
                    continue
                if revised.changes != value.changes:
                    value = revised
                    reasons += (said.entry, *said.besides)
            if reasons:
                frames.append((frame, value, tuple(reasons)))
                taken.update(entry.id for entry in reasons)
        from_user = [said.entry for said in statements if said.is_from_user]
        answers = tuple((entry, _answer(entry.id in taken, errors.get(entry.id))) for entry in from_user)
        answers += tuple((entry, OTHERWISE) for entry in list_contradicted(view, [value for _, value, _ in frames]))
        return Case(tuple(frames), answers) if frames or answers else None

    def act(self, view: View, case: Case) -> Iterable[Effect]:
        for report, answer in case.answers:
            yield Revise(report, replace(report.value, answer=answer), (report,))
        for frame, value, reasons in case.frames:
            yield Revise(frame, value, (*reasons, frame))

    def _list_statements(self, view: View) -> Iterator[Statement]:
        """What things on the floor and doors say, and reports that are not answered."""
        least_m = self._settings.action.min_footprint_change_m
        for entry in view.all(Obstacle):
            revise = partial(revise_by_thing, thing=entry.value, by=entry.author, least_m=least_m)
            yield Statement(entry, (entry.value.locale,), revise)
        for door in view.all(DoorState):
            yield Statement(door, door.value.between, partial(revise_by_door, door=door.value, by=door.author))
        yield from self._list_differences(view)
        for from_user in view.where(UserReport, lambda report: not report.answer):
            by_report = partial(revise_by_report, report=from_user.value, by=from_user.author)
            try:
                locales = tuple(find_building(view).find_elements(from_user.value.what))
            except ValueError as error:
                yield Statement(from_user, (), by_report, is_from_user=True, error=str(error))
            else:
                yield Statement(from_user, locales, by_report, is_from_user=True)

    def _list_differences(self, view: View) -> Iterator[Statement]:
        """What differences say of doors, of walls, and of all of the building where no wall explains it."""
        doors, building, name = list_filed_doors(view), find_building(view), name_model(view)
        general = view.where(Difference, lambda d: d.about == DOORS)
        for found in view.where(Difference, lambda d: d.about in doors):
            door, (*older, newer) = doors[found.value.about], sorted((found, *general), key=lambda entry: entry.cycle)
            here = door.pose_from(door.between[0]).position
            others = [told for entry in general for told in entry.value.counted if (told.x_m, told.y_m) != tuple(here)]
            revise = partial(redraw_door, door=door, found=weigh_among(found.value, others), by=found.author)
            yield Statement(newer, door.between, revise, besides=tuple(older))
        models = view.where(Difference, lambda d: d.about == name and d.is_sure and d.leader.kind == "wall")
        camera = view.latest(CameraState)
        scale = 0.0 if models or name != MODEL or camera is None else compute_scale_sigma(camera.value)
        widths = [(found, sides) for found in view.where(Difference, lambda d: BETWEEN in d.about)
                  if is_width(found.value, scale * measure_between(sides := find_facing(building, found.value.about)))]
        newest = max((*models, *(found for found, _ in widths)), key=lambda entry: entry.cycle, default=None)
        placed = place_walls([(found.value, sides) for found, sides in widths], newest.author) if newest else []
        yield from (Statement(newest, side.rooms, partial(redraw, change=change)) for side, change in placed if newest)
        is_drawn = all(redraw(frame := building.frame(side.rooms[0]), change) is frame for side, change in placed)
        for model in view.where(Difference, lambda d: d.about == name and is_drawn):
            yield Statement(model, (building.root,), partial(
                revise_by_difference, found=model.value, by=model.author))


def _answer(is_taken: bool, error: str | None) -> str:
    if error is not None:
        return f"which cannot be: {error}"
    return BELIEVED if is_taken else KNOWN
