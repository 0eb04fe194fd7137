"""``harvey why RUN --not NAME`` names the condition that did not hold, and its value."""

from __future__ import annotations

from dataclasses import dataclass

from blackboard import Posted, Watch, always
from harvey.replay.why_not_again import read_predicate, tell_predicate
from harvey.wiring import KNOWLEDGE_SOURCES


@dataclass(frozen=True)
class Light:
    colour: str
    is_on: bool = True


WATCHES = (Watch(Light, (Posted,), lambda light: light.is_on), Watch(Light, (Posted,), lambda c: c.colour == "red"))


def is_green(light: Light) -> bool:
    """Whether it is green."""
    return light.is_on and light.colour == "green"


def test_a_condition_is_told_as_its_source_has_it_with_the_values_that_it_asks_for() -> None:
    blue = Light("blue")
    assert tell_predicate(WATCHES[0].where, blue) == "is_on; is_on is True"
    assert tell_predicate(WATCHES[1].where, blue) == "colour == 'red'; colour is 'blue'"
    assert tell_predicate(is_green, blue) == (
        "is_on and colour == 'green'; is_on is True; colour is 'blue'")


def test_a_condition_without_source_is_told_as_nothing() -> None:
    assert read_predicate(str.isalpha) == ("", ())  # type: ignore[arg-type]
    assert read_predicate(eval("lambda light: light.is_on")) == ("", ())


def test_each_condition_of_the_knowledge_sources_can_be_told() -> None:
    conditions = [watch.where for source in KNOWLEDGE_SOURCES for watch in source.on if watch.where is not always]
    assert len(conditions) > 40 and all(read_predicate(where)[0] for where in conditions)
