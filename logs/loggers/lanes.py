"""Lanes: when each knowledge source acts, and which servo level is in focus."""

from __future__ import annotations

import rerun as rr

from blackboard.activation import Activation
from blackboard.level import Level
from logs.mirror import Moment
from logs.palette import LEVELS, Colour
from logs.paths import FOCUS, LANES
from logs.tape import Tape

ACTS, GAP = "acts", ""


class Lanes:
    """Logs a lane only when its state changes."""

    def __init__(self) -> None:
        self._known: dict[str, None] = {}
        self._acting = ""
        self._focus = ""

    def begin(self, tape: Tape) -> None:
        names = [str(level) for level in Level]
        tape.fix(FOCUS, _style(names, [LEVELS[name] for name in names]))

    def log(self, tape: Tape, moment: Moment) -> None:
        decision = moment.decision
        for activation in decision.activated:
            self._meet(tape, activation)
        self._act(tape, lane(decision.chosen) if decision.chosen else "")
        if str(decision.focus) != self._focus:
            self._focus = str(decision.focus)
            tape.log(FOCUS, rr.StateChange(state=self._focus))

    def _meet(self, tape: Tape, activation: Activation) -> None:
        """A lane needs its style before its first state."""
        path = lane(activation)
        if path not in self._known:
            self._known[path] = None
            tape.fix(path, _style([ACTS], [LEVELS[str(activation.source.level)]]))

    def _act(self, tape: Tape, path: str) -> None:
        if path == self._acting:
            return
        if self._acting:
            tape.log(self._acting, rr.StateChange(state=GAP))
        if path:
            tape.log(path, rr.StateChange(state=ACTS))
        self._acting = path


def lane(activation: Activation) -> str:
    """Entity path of a knowledge source's lane; sources of one level lie together."""
    return f"{LANES}/{activation.source.level}/{activation.source.name}"


def _style(states: list[str], colours: list[Colour]) -> rr.StateConfiguration:
    return rr.StateConfiguration(values=[*states, GAP], labels=[*states, GAP], colors=[*colours, (0, 0, 0, 0)],
                                 visible=[True] * len(states) + [False])
