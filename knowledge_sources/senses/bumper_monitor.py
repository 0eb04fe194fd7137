"""Bumper monitor (§4): what is felt where nothing can be touched is felt by a bumper that stays pressed."""

from __future__ import annotations

import math
from collections.abc import Iterable

from blackboard import Change, Effect, Entry, Post, Posted, View, Watch, rule
from knowledge_sources.methods.belief import hedge
from knowledge_sources.priority import Priority
from knowledge_sources.reads import HELD, is_worth_telling
from knowledge_sources.reads.questions import BUMPER
from world_models.entries import Contact, Course, Evidence, Explanation, MotionReport
from world_models.frames import wrap_angle

P_BY_CHANCE = 0.001
"""Part of the motions that a thing ends so by chance; and of those in which a bumper that is stuck feels nothing."""
LAST_PART_M, MIN_ASKED_M = 0.01, 0.05
"""What is touched on the last part of a way leaves it as long as it was asked for: of longer ways so few."""
MIN_TURNED_RAD, MAX_GONE_M = math.radians(30.0), 0.03
"""What was touched is on another side after such a turn; within such a way there is hardly a second thing."""


def find_pressed(view: View, trigger: Change) -> Post | None:
    """What a touch, or a motion without one, tells of the bumper; None for a touch that was to be expected."""
    last, contact, ratio = trigger.entry, view.latest(Contact), math.log(P_BY_CHANCE)
    if isinstance(last.value, Contact):
        when_s, shows, ratio = last.value.when_s, _find_oddity(view, last), -ratio
    else:  # a motion's touch comes with its report
        when_s = last.value.sim_time_s
        shows = "" if contact is None or contact.cycle == last.cycle else "it felt nothing in a motion"
    explained = (Explanation("chance", "touches by chance", 0.0), *(
        Explanation(kind, "a bumper that stays pressed", left) for kind, left in hedge({"bumper": ratio}).items()))
    if not shows or not is_worth_telling(view, BUMPER, explained):
        return None
    here = HELD.of(view).pose
    told = Evidence(BUMPER, shows, explained, here.x_m, here.y_m, here.heading_rad, 0.0, 0.0, when_s)
    return Post(told, (last, HELD.of(view).entry))


def _find_oddity(view: View, touch: Entry[Contact]) -> str:
    """Why nothing can have been touched, in words; "" where something may have been."""
    asked, since = view.get(touch.because[0].id), view.since(MotionReport, touch.cycle)
    report = next((one.value for one in since if one.cycle == touch.cycle), None)
    if asked is not None and report is not None and (isinstance(asked.value, Course) or (
            report.move_m > asked.value.move_m - LAST_PART_M and asked.value.move_m >= MIN_ASKED_M)):
        return f"it felt something, and the wheels went on for all of {report.move_m:.2f} m"
    before = next((one for one in view.newest_first(Contact) if one.cycle < touch.cycle), None)
    gone = [] if before is None else [one.value for one in view.since(MotionReport, before.cycle + 1)]
    if before is None or before.value.by != "bumper" or math.fsum(one.move_m for one in gone) > MAX_GONE_M:
        return ""
    turned_rad = wrap_angle(math.fsum(one.turn_rad for one in gone))
    off_rad = wrap_angle(touch.value.direction_rad - before.value.direction_rad)
    is_same = abs(off_rad) < 0.5 * math.hypot(touch.value.sigma_rad, before.value.sigma_rad)
    said = f"it felt something on the same side after a turn of {math.degrees(turned_rad):.0f} degrees"
    return said if is_same and abs(turned_rad) >= MIN_TURNED_RAD else ""


@rule(on=(Watch(Contact, (Posted,), lambda felt: felt.by == "bumper"), Watch(MotionReport, (Posted,))), writes=Evidence,
      needs=(HELD,), bind=find_pressed, priority=Priority.ENTER)
def bumper_monitor(_view: View, case: Post) -> Iterable[Effect]:
    """Says where the bumper feels what cannot be there, and, once that was said, where it feels nothing."""
    yield case
