"""What something on the floor may be (§4): a thing, a jamb that stands beside, a leaf, or dirt on the lens.

All of them compete for each sight. What nobody has thought of is the rest: by it a sight is a stain, a shade or a
reflection, as likely as its pixels leave open.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from knowledge_sources.methods.belief import PRIORS, to_log_odds
from knowledge_sources.methods.floor.door_beside import JAMB_OF, JambBeside
from knowledge_sources.methods.floor.found_things import tell_status
from knowledge_sources.settings import ActionSettings
from world_models.entries import Difference, Evidence, Explanation, Obstacle, RivalKind

BLOCKING: tuple[RivalKind, ...] = ("thing", "leaf", "jamb")
"""What is in the way, whatever it is: of a jamb the wall's end is, and nothing wider."""
STOOD_STILL = 3.0
"""For dirt, and against a thing, by each look in which it had the same pixels and would have moved on the floor: of a
thing two sides or three would each be within 12 of 50 pixels or more by chance."""
CAME_NOW = -3.0
"""For dirt of which no look before shows anything at its pixels: of twenty looks it came in one."""
SEEN_BEFORE = math.log(2.0)
"""Of three things that were seen since the place was sure, one was seen after a kidnap."""
NO_JAMB = -3.0
"""For a jamb where a sight shows what it does not explain."""


class Shown(NamedTuple):
    """What a sight shows of something, beside how it looks.

    Attributes:
        jamb: that explains it; None: none does.
        leaf: that explains it, in words; None: none does.
        still: in how many looks before it had the same pixels, and would have moved on the floor for that.
    """

    jamb: JambBeside | None = None
    leaf: str | None = None
    still: int = 0


def explain_sight(p_thing: float, shown: Shown, known: Difference | None, most: float) -> tuple[Explanation, ...]:
    """What each rival makes of a sight.

    Args:
        p_thing: how likely its pixels show something solid.
        most: no thing is more probable than this, so that what is gone is soon forgotten.
    """
    thing = None if known is None else known.find("thing")
    left = to_log_odds(most) - (0.0 if thing is None else thing.log_odds)
    return tuple(_explain(min(to_log_odds(p_thing), max(left, 0.0)), shown, known))


def _explain(ratio: float, shown: Shown, known: Difference | None) -> Iterator[Explanation]:
    against = STOOD_STILL * shown.still
    yield Explanation("thing", "a thing", ratio - against)
    yield Explanation("dirt", "dirt on the lens", ratio + (against or CAME_NOW))
    if shown.leaf is not None:
        yield Explanation("leaf", shown.leaf, ratio - against)
    if shown.jamb is not None:
        jamb = shown.jamb
        yield Explanation("jamb", jamb.words(), ratio + jamb.log_ratio - against, jamb.off_m, jamb.sigma_m)
    elif known is not None and (rival := known.find("jamb")) is not None:
        yield Explanation("jamb", rival.what, NO_JAMB, rival.off, rival.sigma)


def explain_free(ratio: float, known: Difference | None) -> tuple[Explanation, ...]:
    """What each rival makes of floor that is seen free where it should stand: dirt has no opinion."""
    others = () if known is None else tuple(r for r in known.rivals if r.kind in ("leaf", "jamb"))
    return (Explanation("thing", "a thing", ratio),
            *(Explanation(rival.kind, rival.what, ratio, rival.off, rival.sigma) for rival in others))


def explain_touch(leaf: str | None, known: Difference | None, most: float) -> tuple[Explanation, ...]:
    """What each rival makes of a touch: neither dirt on the lens is touched, nor what stands elsewhere."""
    rivals = {} if known is None else {rival.kind: rival for rival in known.rivals}
    ratio = max(0.0, to_log_odds(most) - (rivals["thing"].log_odds if "thing" in rivals else PRIORS["thing"]))
    of_leaf = () if leaf is None else (Explanation("leaf", leaf, ratio),)
    not_here = (Explanation(kind, rival.what, -2.0 * STOOD_STILL - max(0.0, rival.log_odds))
                for kind, rival in rivals.items() if kind not in BLOCKING)
    return Explanation("thing", "a thing", ratio), *of_leaf, *not_here


def explain_seen_elsewhere(known: Difference | None) -> tuple[Explanation, ...]:
    """What a kidnap says of a thing that was seen before it or after: most sights are before it, as the next tells it.
    """
    thing = None if known is None else known.find("thing")
    odds = 0.0 if thing is None else thing.log_odds
    return (Explanation("elsewhere", "a thing that stands elsewhere", odds - PRIORS["elsewhere"] - SEEN_BEFORE),)


def explain_seen_in_patch() -> tuple[Explanation, ...]:
    """What each rival makes of a thing that was seen nowhere but in a patch on the lens."""
    still = 2.0 * STOOD_STILL
    return Explanation("thing", "a thing", -still), Explanation("dirt", "dirt on the lens", still)


def judge_thing(thing: Obstacle, difference: Difference, settings: ActionSettings) -> Obstacle:
    """A thing as certain as its difference says, that something blocks the way there; gone where nothing may."""
    p = sum(rival.p for rival in difference.rivals if rival.kind in BLOCKING)
    certainty = min(p, settings.max_obstacle_certainty)
    if certainty < settings.min_gone_certainty:
        return replace(thing, certainty=certainty, status="gone")
    is_held = thing.is_there and difference.find("elsewhere") is None
    return replace(thing, certainty=certainty, status="there" if is_held else tell_status(certainty))


def tell_of_door(difference: Difference, evidence: Evidence) -> Evidence | None:
    """What evidence of a thing says of the door whose jamb it rather is; None where it is no jamb."""
    jamb = difference.leader
    said = tuple(e for e in evidence.explanations if e.kind == "thing" or (e.kind, e.what) == ("jamb", jamb.what))
    if jamb.kind != "jamb" or len(said) < 2:
        return None
    door = jamb.what.removeprefix(JAMB_OF).partition(" ")[0]
    return replace(evidence, about=door, shows=f"{difference.about} is seen at its end", explanations=said)
