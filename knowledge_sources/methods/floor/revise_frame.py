"""What is known of a locale after something was found there, a door was looked at, or somebody said how it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from knowledge_sources.methods.floor.footprints import measure_change_m
from world_models.building.changes import find_along, outline_door
from world_models.building.locale_frame import UNDONE, FrameChange, LocaleFrame
from world_models.building.locales import Doorway
from world_models.building.model_errors import INEXACT_M, Side
from world_models.entries import DOOR_STATES, RISK, Difference, DoorState, Obstacle, UserReport
from world_models.entries.difference import SURE

MIN_BESIDE_SIGMAS = 3.0
"""What stands beside is drawn there from so many standard deviations on."""
MAX_BESIDE_SIGMA_M = 0.025  # and once its place is as well known as that
MIN_BESIDE_CHANGE_M = 0.005  # a place that is found to be otherwise by less is drawn as it was: nothing is planned anew
MIN_HEIGHT_CHANGE_M = 0.15  # a thing in a frame is revised where its top is so much higher or lower


def revise_by_thing(frame: LocaleFrame, thing: Obstacle, by: str, least_m: float) -> LocaleFrame:
    """A frame with a thing as it is known now; the same frame where no plan could change by it.

    Args:
        least_m: a change of the footprint by less is none.
    """
    known = next((c for c in frame.changes if (c.what, c.name) == ("extra", thing.name)), None)
    if not thing.is_there:
        return frame if known is None else frame.restored("extra", thing.name)
    height_m = thing.height_m + thing.sigma_height_m if thing.is_height_known else 0.0
    change = FrameChange("extra", thing.name, by, thing.footprint, round(height_m, 2))
    if known is None:
        return frame.changed(change)
    moved_m = measure_change_m(known.footprint, change.footprint)
    is_touched = thing.touched_s == thing.seen_s
    same_height = abs(known.height_m - change.height_m) < MIN_HEIGHT_CHANGE_M
    if not is_touched and moved_m < least_m and same_height:
        return frame
    return frame.restored("extra", thing.name).changed(change)


def revise_by_door(frame: LocaleFrame, door: DoorState, by: str) -> LocaleFrame:
    """A frame in which a door is as it was seen; the same frame as long as that is not certain."""
    is_shut = any((change.what, change.name) == ("shut", door.door) for change in frame.changes)
    if door.state == "shut" and not is_shut:
        return frame.changed(FrameChange("shut", door.door, by))
    return frame.restored("shut", door.door) if door.state == "open" and is_shut else frame


def revise_by_difference(frame: LocaleFrame, found: Difference, by: str) -> LocaleFrame:
    """The building's frame, whose model is surely inexact, or as it was measured; else the same frame.

    It is acquitted only where it is inexact with a probability of at most :data:`RISK`: all poses rest on that then.
    """
    what, wall = found.leader, found.find("wall")
    if frame.is_inexact:
        is_acquitted = what.kind == "chance" and (wall is None or wall.p <= RISK)
        return frame.restored("inexact", frame.name) if is_acquitted else frame
    return frame.changed(FrameChange("inexact", frame.name, by)) if what.p >= SURE and what.kind == "wall" else frame


def redraw_door(frame: LocaleFrame, door: Doorway, found: Difference, by: str) -> LocaleFrame:
    """A frame in which a door stands where it was surely found, or where the file has it again; else the same frame.

    Args:
        door: as the file has it.
    """
    known, jamb = next((c for c in frame.changes if (c.what, c.name) == ("beside", door.name)), None), found.leader
    if found.is_sure and jamb.kind == "jamb":
        if abs(jamb.off) < MIN_BESIDE_SIGMAS * jamb.sigma or jamb.sigma > MAX_BESIDE_SIGMA_M:
            return frame
        x_m, y_m = (jamb.off * find_along(door)).round(4).tolist()
        return redraw(frame, FrameChange("beside", door.name, by, outline_door(door), 0.0, (x_m, y_m),
                                         round(jamb.sigma, 4)))
    return frame.restored("beside", door.name) if known is not None and jamb.kind == "chance" else frame


def redraw(frame: LocaleFrame, change: FrameChange) -> LocaleFrame:
    """A frame in which something stands beside; the same frame where that is drawn already, as near as it matters."""
    known = next((c for c in frame.changes if (c.what, c.name) == ("beside", change.name)), None)
    if known is None:
        return frame.changed(change)
    moved_m = math.dist(known.by_m, change.by_m)
    return frame if moved_m < MIN_BESIDE_CHANGE_M else frame.restored("beside", change.name).changed(change)


def is_width(found: Difference, camera_m: float) -> bool:
    """Whether walls that face each other are surely farther apart, or nearer, than in the file.

    Args:
        camera_m: by how much the camera may make it seem so, a standard deviation.
    """
    wall = found.leader
    least_m = MIN_BESIDE_SIGMAS * math.hypot(wall.sigma, camera_m)
    return found.is_sure and wall.kind == "wall" and abs(wall.off) >= least_m


def place_walls(found: Sequence[tuple[Difference, tuple[Side, Side]]], by: str) -> list[tuple[Side, FrameChange]]:
    """Where the walls stand of which it is known how far apart they are: the likeliest places, all at once.

    Each may be displaced alike before anything is measured. Distances leave open where both of two walls are, and so
    does the covariance. The deviations that are stated count as independent errors: of each wall the sum of its row,
    which is never less.
    """
    sides = {side.mode: side for _, pair in found for side in pair}
    names, information, gradient = list(sides), np.eye(len(sides)) / INEXACT_M**2, np.zeros(len(sides))
    for difference, pair in found:
        row = np.zeros(len(names))
        for side in pair:
            row[names.index(side.mode)] += float(side.outward @ side.inward)
        weight = 1.0 / difference.leader.sigma**2
        information += weight * np.outer(row, row)
        gradient += weight * difference.leader.off * row
    covariance = np.linalg.inv(information)
    placed = []
    for name, off_m, sigma_m in zip(names, covariance @ gradient, np.sqrt(np.abs(covariance).sum(axis=1)), strict=True):
        x_m, y_m = (off_m * sides[name].inward[:2]).round(4).tolist()
        placed.append((sides[name], FrameChange("beside", name, by, sides[name].corners, 0.0, (x_m, y_m),
                                                round(float(sigma_m), 4))))
    return placed


def revise_by_report(frame: LocaleFrame, report: UserReport, by: str) -> LocaleFrame:
    """A frame in which a door or a thing is as somebody said. Raises ValueError where it has nothing of that name."""
    what, state = report.what, report.state
    if state == "gone" and any((change.what, change.name) == ("extra", what) for change in frame.changes):
        return frame.restored("extra", what)
    known = {(change.what, change.name) for change in frame.changes}
    filed = frame.filed or frame
    names = [door.name for door in filed.doorways] if state in DOOR_STATES else [thing.name for thing in filed.things]
    if what not in names:
        kind = "an open door" if state in DOOR_STATES else "a thing"
        raise ValueError(f"expected {kind} of {frame.name} ({', '.join(names) or 'it has none'}), got {what!r}")
    if state in UNDONE:
        return frame.restored(UNDONE[state], what)
    if (state, what) in known:
        return frame
    return frame.changed(FrameChange("shut" if state == "shut" else "gone", what, by))


def contradicts(frame: LocaleFrame, report: UserReport, by: str) -> bool:
    """Whether a frame says otherwise of a door or a thing than somebody does."""
    with suppress(ValueError):  # it has nothing of that name
        return revise_by_report(frame, report, by).changes != frame.changes
    return False
