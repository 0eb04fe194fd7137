"""BodyReplay: a simulated body does again what the journal of its run says that it did.

The same calls give the same answers, so the simulated world is as it was when the run was cut off. Recorded
pictures are not rendered again. An answer that is not the journal's is an error.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from blackboard import Change, Effect, Entry, Port, Posted, Retract, plain
from harvey.errors import BadInput
from harvey.runner.replay import Live
from logs.records import EntryRecord, as_line
from sim.body.simulated_body import SimulatedBody
from sim.body.wheel_errors import ActuatorParameters
from world_models.entries import Course, MotorCommand, Resumed


class BodyReplay:
    """Asks the port of a simulated body again, and compares its answers with what was observed.

    A :class:`harvey.runner.resume.ResumedBody`.
    """

    def __init__(self, port: Port, body: SimulatedBody, seed: int, actuator: ActuatorParameters) -> None:
        self._port, self._body, self._seed, self._actuator = port, body, seed, actuator

    @contextmanager
    def replay(self, pictures: Mapping[int, bytes]) -> Iterator[Live]:
        """A while in which the body renders none of the recorded pictures."""
        self._body.use_recorded(pictures)
        yield self
        self._body.use_recorded({})

    def report(self, request: Entry[Any]) -> Iterable[Effect]:
        """What the wheels claim of a command that was cut off."""
        return self.answer(Posted(request), True)

    def __call__(self, made: Sequence[Change], observed: Sequence[EntryRecord[Any]]) -> None:
        """Let the body do what the changes asked for. Raises BadInput where its answer differs from ``observed``."""
        broken_off = find_interrupted(observed)
        answers = [effect for change in made for effect in self.answer(change, str(change.entry.ref) in broken_off)]
        now = [as_line(plain(effect.value)) for effect in answers if not isinstance(effect, Retract)]
        then = [as_line(record.fields) for record in observed if record.author == self._port.name]
        if now != then:
            number, pair = next((i, p) for i, p in enumerate(zip([*now, "nothing"], [*then, "nothing"], strict=False))
                                if p[0] != p[1])
            where = observed[0].cycle if observed else "its last"
            raise BadInput(f"the simulated robot does not answer as it did in cycle {where} (answer {number + 1}): "
                           f"expected {pair[1][:120]}, got {pair[0][:120]}")

    def answer(self, change: Change, broken_off: bool) -> Iterable[Effect]:
        """What the port answers; a command that was broken off is carried out in part, and a motion on the move stands.

        How much of it follows from the seed: when the process ended, nobody could say how far the robot was.
        """
        value = change.entry.value
        if broken_off and isinstance(value, Course):
            old = change.entry
            stopped = replace(value, speed_m_per_s=0.0)
            change = Posted(Entry(old.id, old.revision, stopped, old.author, old.cycle, old.because))
        elif broken_off and isinstance(value, MotorCommand):
            number = int(change.entry.id.rpartition("-")[2])
            part = float(np.random.default_rng([self._seed, number]).random())
            old = change.entry
            done = Entry(old.id, old.revision, part_of(value, part, self._actuator), old.author, old.cycle, old.because)
            change = Posted(done)
        return self._port.answer(change)


def part_of(command: MotorCommand, part: float, actuator: ActuatorParameters) -> MotorCommand:
    """What is done of a command when a part (0..1) of its time is over: first it turns, then it moves."""
    turn_s = abs(command.turn_rad) / actuator.turn_speed_rad_per_s
    move_s = command.move_m / actuator.speed_m_per_s
    gone_s = part * (turn_s + move_s)
    turned = min(1.0, gone_s / turn_s) if turn_s else 1.0
    moved = max(0.0, gone_s - turn_s) / move_s if move_s else 1.0
    return MotorCommand(command.turn_rad * turned, command.move_m * min(1.0, moved))


def find_interrupted(observed: Sequence[EntryRecord[Any]]) -> frozenset[str]:
    """The refs of the commands that a run, when it went on, was told not to have been answered."""
    resumed = (record.fields for record in observed if record.kind is Resumed and isinstance(record.fields, dict))
    return frozenset(str(ref) for value in resumed for ref in value.get("interrupted", ()))
