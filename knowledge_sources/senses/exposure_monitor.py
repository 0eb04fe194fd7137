"""Exposure monitor (§4): a picture that is dark, or white, has a reason: the lamps, a cover, or the camera itself."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from blackboard import Change, Effect, Level, Post, Posted, View, Watch, rule
from knowledge_sources.methods.belief import hedge
from knowledge_sources.methods.features import read_picture
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, find_difference, is_dark
from world_models.entries import Evidence, Explanation, RivalKind, Segments

ABOUT = "the light in pictures"
WHITE, MOST_WHITE = 250, 0.5
"""A pixel that is brighter is overexposed; a picture of which a larger part is tells little."""
SHADE = 0.2
"""Where something is seen in the dark, means of rows or columns differ by so much more than rounding has it."""
P_BY_CHANCE, UNLIKELY = 0.001, 3.0
"""Part of the pictures that are so, or not so, by chance; and by how much less likely [log] is a room that is black
without its lamps than a cover, and a cover in which something is seen than a room without lamps."""
WHAT: Mapping[RivalKind, str] = {
    "lamp": "lamps that are off", "cover": "a cover on the lens", "exposure": "a camera that exposes for too long"}


def find_light(view: View, trigger: Change) -> Post | None:
    """What a picture tells of its light; None where all is as it should be, and was before."""
    seen, frame = trigger.entry, view.get(trigger.entry.value.frame)
    if frame is None:
        return None
    grey, much, here = read_picture(frame.value.jpeg).grey, -math.log(P_BY_CHANCE), HELD.of(view)
    ratios: dict[RivalKind, float] = dict.fromkeys(WHAT, -much)
    shows = "a picture of light and shade"
    if is_dark(seen.value):
        is_black = max(float(grey.mean(axis=axis).std()) for axis in (0, 1)) < SHADE
        shows = "a black picture" if is_black else "a dark picture in which something is seen"
        ratios |= {"lamp": much - UNLIKELY * is_black, "cover": much - UNLIKELY * (not is_black)}
    elif float(np.mean(grey > WHITE)) > MOST_WHITE:
        shows, ratios["exposure"] = "a picture that is white for the most part", much
    elif not find_difference(view, ABOUT).rivals:
        return None
    explained = (Explanation("chance", "chance", 0.0), *(
        Explanation(kind, WHAT[kind], ratio) for kind, ratio in hedge(ratios).items()))
    at, when_s = here.pose, frame.value.sim_time_s
    told = Evidence(ABOUT, shows, explained, at.x_m, at.y_m, at.heading_rad, 0.0, 0.0, when_s)
    return Post(told, (seen, frame, here.entry))


@rule(on=Watch(Segments, (Posted,)), writes=Evidence, needs=(HELD,), bind=find_light, priority=Priority.ENTER,
      level=Level.PLAN)
def exposure_monitor(_view: View, case: Post) -> Iterable[Effect]:
    """Says where a picture is dark or white, and, once that was said, where one is not."""
    yield case
