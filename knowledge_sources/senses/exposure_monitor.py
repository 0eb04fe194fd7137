"""Exposure monitor (§4): a picture that is dark, or white, has a reason: the lamps, a cover, or the camera itself."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from blackboard import Change, Effect, Entry, Level, Post, Posted, View, Watch, rule
from knowledge_sources.methods.belief import hedge
from knowledge_sources.methods.features import read_picture
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, find_difference, is_dark
from world_models.entries import CameraPicture, Evidence, Explanation, RivalKind, Segments

ABOUT = "the light in pictures"
MIN_WHITE = 230.0
"""A picture that is brighter on the mean, of 255, is overexposed."""
SHADE = 0.2
"""Where something is seen in the dark, means of rows or columns differ by so much more than rounding has it."""
P_BY_CHANCE, UNLIKELY = 0.001, 3.0
"""Part of the pictures that are so, or not so, by chance; and by how much less likely [log] is a room that is black
without its lamps than a cover, and a cover in which something is seen than a room without lamps."""
WHAT: Mapping[RivalKind, str] = {
    "lamp": "lamps that are off", "cover": "a cover on the lens", "exposure": "a camera that exposes for too long"}


Seen = tuple[Entry[Segments], Entry[CameraPicture]]


def find_light(view: View, trigger: Change) -> Seen | None:
    """A picture that is dark or white, or one after such a picture; None where all is as it should be, and was."""
    seen, frame = trigger.entry, view.get(trigger.entry.value.frame)
    is_odd = is_dark(seen.value) or seen.value.brightness > MIN_WHITE
    return (seen, frame) if frame is not None and (is_odd or find_difference(view, ABOUT).rivals) else None


@rule(on=Watch(Segments, (Posted,)), writes=Evidence, needs=(HELD,), bind=find_light, priority=Priority.ENTER,
      level=Level.PLAN)
def exposure_monitor(view: View, case: Seen) -> Iterable[Effect]:
    """Says where a picture is dark or white, and, once that was said, where one is not."""
    (seen, frame), much, here = case, -math.log(P_BY_CHANCE), HELD.of(view)
    ratios: dict[RivalKind, float] = dict.fromkeys(WHAT, -much)
    shows = "a picture of light and shade"
    if is_dark(seen.value):
        grey = read_picture(frame.value.jpeg).grey
        is_black = max(float(grey.mean(axis=axis).std()) for axis in (0, 1)) < SHADE
        shows = "a black picture" if is_black else "a dark picture in which something is seen"
        ratios |= {"lamp": much - UNLIKELY * is_black, "cover": much - UNLIKELY * (not is_black)}
    elif seen.value.brightness > MIN_WHITE:
        shows, ratios["exposure"] = "a picture that is white for the most part", much
    explained = (Explanation("chance", "chance", 0.0), *(
        Explanation(kind, WHAT[kind], ratio) for kind, ratio in hedge(ratios).items()))
    at, when_s = here.pose, frame.value.sim_time_s
    told = Evidence(ABOUT, shows, explained, at.x_m, at.y_m, at.heading_rad, 0.0, 0.0, when_s)
    yield Post(told, (seen, frame, here.entry))
