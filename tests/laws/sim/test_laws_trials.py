"""Laws of campaigns: a break changes nothing; what others found is found again; results keep the trials' order."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from experiments.trials import run_trials


@dataclass(frozen=True, slots=True)
class Square:
    """What is found of a number."""

    of: int
    value: float


def square(number: int) -> Square:
    return Square(number, number * number + 0.1)


def spoilt(number: int) -> Square:
    """Fails in every trial: a call that only reads kept results never calls it."""
    raise RuntimeError(f"trial {number} was done again")


NUMBERS = [5, 3, 8, 1]
FOUND = [square(number) for number in NUMBERS]


def test_results_come_in_the_order_of_the_trials_and_are_kept(tmp_path: Path) -> None:
    assert run_trials(square, NUMBERS, Square, tmp_path) == FOUND
    assert run_trials(spoilt, NUMBERS, Square, tmp_path) == FOUND


def test_a_campaign_that_was_broken_off_goes_on_where_it_was(tmp_path: Path) -> None:
    assert run_trials(square, NUMBERS[:2], Square, tmp_path) == FOUND[:2]
    kept = tmp_path / "results.jsonl"
    kept.write_text(kept.read_text(encoding="utf-8") + '{"case": 3, "fou', encoding="utf-8")
    assert run_trials(square, NUMBERS, Square, tmp_path) == FOUND
    assert run_trials(spoilt, NUMBERS, Square, tmp_path) == FOUND


@pytest.mark.parametrize("finder", [{"code": "of yesterday"}, {"arithmetic": "abacus"}])
def test_what_another_found_is_found_anew(tmp_path: Path, finder: dict[str, str]) -> None:
    run_trials(square, [], Square, tmp_path)
    here = json.loads((tmp_path / "results.jsonl").read_text(encoding="utf-8"))
    lines = [here | finder, *({"case": n, "result": {"of": 0, "value": 0.0}} for n in range(4))]
    (tmp_path / "results.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
    assert run_trials(square, NUMBERS, Square, tmp_path) == FOUND


def test_a_trial_that_raises_ends_the_campaign_and_loses_nothing(tmp_path: Path) -> None:
    run_trials(square, NUMBERS[:3], Square, tmp_path)
    with pytest.raises(RuntimeError, match="trial 1 was done again"):
        run_trials(spoilt, NUMBERS, Square, tmp_path)
    assert run_trials(spoilt, NUMBERS[:3], Square, tmp_path) == FOUND[:3]
