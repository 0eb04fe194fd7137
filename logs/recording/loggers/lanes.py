"""Lanes: what Harvey is busy with, the servo level in focus, when each knowledge source acts, faults of the body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import rerun as rr
import rerun.blueprint as rrb

from blackboard.agenda import Activation
from logs.recording.board_mirror import Moment
from logs.recording.logger import NEAR, Logger, Panel, Subject
from logs.recording.messages import ACTIVITIES, ACTIVITY_KINDS, activity
from logs.recording.palette import LEVELS, REJECTED, Colour
from logs.recording.paths import FAULTS, FOCUS, HARVEY
from logs.recording.stream import RecordingStream, viewable
from world_models.entries.body import BodyFault

ACTS, GAP = "acts", ""


class Lanes(Logger):
    """Logs a lane only when its state changes."""

    def __init__(self, subject: Subject) -> None:
        super().__init__(subject)
        self._known: dict[str, None] = {}
        self._states: dict[str, str] = {}
        self._acting = ""

    def panels(self) -> Sequence[Panel]:
        view = rrb.StateTimelineView(origin="/", contents=contents(), name="Who acts when, by level", time_view=NEAR)
        return (Panel(view, order=1, share=24),)

    def begin(self, stream: RecordingStream) -> None:
        stream.fix(HARVEY, style(ACTIVITIES))
        stream.fix(FOCUS, style(LEVELS))

    def log(self, stream: RecordingStream, moment: Moment) -> None:
        decision = moment.decision
        for activation in decision.activated:
            self._meet(stream, lane(activation), {ACTS: LEVELS[str(activation.source.level)]})
        self._act(stream, lane(decision.chosen) if decision.chosen else "")
        self._set(stream, FOCUS, str(decision.focus))
        if moment.touched(*ACTIVITY_KINDS):
            self._set(stream, HARVEY, moment.mirror.ask(activity).word)
        if moment.touched(BodyFault):
            self._ail(stream, moment)

    def _ail(self, stream: RecordingStream, moment: Moment) -> None:
        """A lane for the body, once something is wrong with it."""
        self._meet(stream, FAULTS, {fault.value.what: REJECTED for fault in moment.mirror.all(BodyFault)})
        fault = moment.mirror.latest(BodyFault, lambda f: f.is_open)
        self._set(stream, FAULTS, fault.value.what if fault else GAP)

    def _meet(self, stream: RecordingStream, path: str, states: Mapping[str, Colour]) -> None:
        """A lane needs its style before its first state."""
        if any(f"{path}:{state}" not in self._known for state in states):
            self._known |= dict.fromkeys(f"{path}:{state}" for state in states)
            stream.fix(path, style(states))

    def _act(self, stream: RecordingStream, path: str) -> None:
        if self._acting and self._acting != path:
            self._set(stream, self._acting, GAP)
        if path:
            self._set(stream, path, ACTS)
        self._acting = path

    def _set(self, stream: RecordingStream, path: str, state: str) -> None:
        if self._states.get(path) != state:
            self._states[path] = state
            stream.log(path, rr.StateChange, state=[state])


def lane(activation: Activation) -> str:
    """Entity path of a knowledge source's lane; sources of one level lie together."""
    return f"{activation.source.level}/{viewable(activation.source.name)}"


def contents() -> list[str]:
    """Where the lanes are, for the view."""
    return [f"+ /{path}" for path in (HARVEY, FOCUS, FAULTS, *(f"{level}/**" for level in LEVELS))]


def style(states: Mapping[str, Colour]) -> rr.StateConfiguration:
    """How the states of a lane look."""
    names = [viewable(state) for state in (*states, GAP)]
    return rr.StateConfiguration(
        values=names, labels=names, colors=[*states.values(), (0, 0, 0, 0)],
        visible=[True] * len(states) + [False])


LOGGERS = (Lanes,)
