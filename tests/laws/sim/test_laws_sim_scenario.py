"""Laws of scenario files: whatever is done to one, it is read or refused with a ScenarioError."""

from __future__ import annotations

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.scenario import ScenarioError, parse_scenario
from sim.scenario_names import SCENARIOS, list_scenarios

TEXTS = [(SCENARIOS / f"{name}.toml").read_text(encoding="utf-8") for name in list_scenarios()]
SCRAPS = st.sampled_from(["", "=", "[", "]", '"', "\n", "-", "1e400", "nan", "inf", "true", "[[faults]]", "heading_deg",
                          "{}", "servo = 3\n", "9999999999999999999",
                          "'", "#", "é", "\x00", "[start]", "start.x = 1\n"])


@st.composite
def mutants(draw: st.DrawFn) -> str:
    """A shipped scenario with a few pieces cut out or put in."""
    text = draw(st.sampled_from(TEXTS))
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.integers(0, 12)))
        text = text[:start] + draw(st.one_of(SCRAPS, st.text(max_size=3))) + text[end:]
    return text


@settings(deadline=None, max_examples=300)
@given(mutants())
def test_a_mutated_scenario_is_read_or_refused_clearly(text: str) -> None:
    try:
        parse_scenario(text, "mutant.toml")
    except ScenarioError as error:
        assert re.match(r"mutant\.toml:(\d+|\?): .*(expected|got)", str(error), re.DOTALL)


@settings(deadline=None, max_examples=50)
@given(st.text(max_size=40))
def test_any_text_is_refused_clearly(text: str) -> None:
    with pytest.raises(ScenarioError):
        parse_scenario(text, "any.toml")
