"""What is known of a locale after something was found there, a door was looked at, or somebody said how it is."""

from __future__ import annotations

import math

from knowledge_sources.methods.floor.footprints import measure_change_m
from world_models.building.changes import find_along, outline_door
from world_models.building.locale_frame import UNDONE, FrameChange, LocaleFrame
from world_models.building.locales import Doorway
from world_models.entries import DOOR_STATES, Difference, DoorState, Obstacle, UserReport

MIN_BESIDE_SIGMAS = 3.0
"""What stands beside is drawn there from so many standard deviations on."""
MAX_BESIDE_SIGMA_M = 0.025  # and once its place is as well known as that
MIN_BESIDE_CHANGE_M = 0.01  # a place that is found to be otherwise by less is drawn as it was: nothing is planned anew
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
    """The building's frame, once its model is surely inexact; what was found is not taken back."""
    is_known = any(change.what == "inexact" for change in frame.changes)
    if is_known or not found.is_sure or found.leader.kind != "wall":
        return frame
    return frame.changed(FrameChange("inexact", frame.name, by))


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
        change = FrameChange("beside", door.name, by, outline_door(door), 0.0, (x_m, y_m), round(jamb.sigma, 4))
        if known is None:
            return frame.changed(change)
        moved_m = math.dist(known.by_m, change.by_m)
        return frame if moved_m < MIN_BESIDE_CHANGE_M else frame.restored("beside", door.name).changed(change)
    return frame.restored("beside", door.name) if known is not None and jamb.kind == "chance" else frame


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
