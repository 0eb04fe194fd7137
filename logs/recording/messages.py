"""What a change on the board amounts to, in a few plain words: one line of the recording."""

from __future__ import annotations

from blackboard.change import Change, Retracted, Revised
from world_models import words
from world_models.building.locale_frame import FrameRequest, LocaleFrame, has_answer
from world_models.entries.location import Hypothesis
from world_models.entries.robot import Drift
from world_models.entries.task import Leg, Milestone


class Messages:
    """Words changes in their order; it remembers the last pose hypotheses, to tell by how much each was corrected."""

    def __init__(self) -> None:
        self._hypotheses: dict[str, Hypothesis] = {}

    def message(self, change: Change) -> str:
        """The first clause of the entry's own sentence; "" for a change that is not worth a word."""
        value = change.entry.value
        if isinstance(change, Retracted):
            return f"no longer believes {change.entry.id}"
        if isinstance(value, Hypothesis):
            return self._hypothesis(change, value)
        if isinstance(value, LocaleFrame):
            return _describe_frame(change, value)
        if isinstance(value, FrameRequest) and has_answer(value):
            return _describe_answer(value)
        return "" if _is_detail(change) else words.brief(value)

    def _hypothesis(self, change: Change, new: Hypothesis) -> str:
        old = self._hypotheses.get(change.entry.id)
        self._hypotheses[change.entry.id] = new
        if not new.is_held or old is None or old.locale != new.locale or new.basis in ("command", "relocalization"):
            return words.brief(new)
        return f"the belief moves by {new.distance_from(old)}, by {new.basis}"


def _describe_frame(change: Change, frame: LocaleFrame) -> str:
    """What is believed otherwise; of a frame as filed the answered request tells, in the same cycle."""
    if frame.changes:
        return f"believes of {frame.name}: {words.listed([change.sentence() for change in frame.changes])}"
    return f"believes of {frame.name} again what the file says" if isinstance(change, Revised) else ""


def _describe_answer(request: FrameRequest) -> str:
    errors = {answer.asked: answer.error for answer in request.answers if answer.error}
    asked = [name or "the whole building" for name in request.locales if name not in errors]
    known = [f"what is known of {words.listed(asked)}"] * bool(asked)
    places = [f"{answer.asked} is in {words.listed(answer.locales)}" for answer in request.answers if answer.locales]
    return f"answer: {', '.join([*known, *places, *errors.values()])}"


def _is_detail(change: Change) -> bool:
    """What another entry of the same cycle says already, or what changes with every move."""
    value = change.entry.value
    if isinstance(change, Revised) and isinstance(value, Leg):
        return value.status == "moving"
    if isinstance(change, Revised) and isinstance(value, Milestone):
        return not value.is_open
    return isinstance(value, Drift)
