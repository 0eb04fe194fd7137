"""What would have been, in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from harvey.campaign.summary import format_error
from harvey.counterfactual import Answer, Parting
from harvey.runner.result import UNFINISHED
from logs.explain.diff import describe, differing_leaves
from logs.explain.phrases import sentence
from logs.records import DecisionRecord
from logs.run_directory import RunDirectory
from world_models.words import count, listed


def describe_answer(answer: Answer, run: RunDirectory, changes: Sequence[str]) -> Iterator[str]:
    """The first decision that differs, what changed, and how it ends; ``changes`` as ``without line_finder``."""
    yield f"{run.path}, {' and '.join(changes)}:"
    if answer.then is None and answer.now is None:
        but = f", but for {listed(answer.revised)}, by which it was asked" if answer.revised else ""
        yield (f"nothing would have changed: all of its {count(answer.agreed, 'decision')} are the same, byte for"
               f" byte{but}.")
        return
    yield "first: as recorded; second: as it would have been"
    yield from describe(answer.agreed, answer.then, answer.now)
    yield ""
    yield from _parting(answer)
    yield from _end(answer, run)


def _parting(answer: Answer) -> Iterator[str]:
    if answer.parting is None:
        yield "It asks its body for the same as in the record to the end, so what was observed holds to the end."
        return
    held = count(answer.answered, "request")
    yield f"What was observed holds for {held} to the body, which are the same. Then it asks for something else:"
    yield f"  as recorded:              {_describe_requests(answer.parting.then, answer.parting.requests)}"
    yield f"  as it would have been:    {_describe_requests(answer.parting.now, answer.parting.requests)}"
    yield from _leaves(answer.parting)
    if answer.outcome.kind == UNFINISHED:
        yield "From there the record cannot tell what it would have observed."
    else:
        yield "From there the record cannot tell what it would have observed; the simulated robot went on by itself."


def _describe_requests(decision: DecisionRecord | None, requests: Sequence[type[Any]]) -> str:
    if decision is None:
        return "nothing any more"
    asked = "; ".join(f"{entry.ref}, {sentence(entry)}" for entry in decision.made if entry.kind in requests)
    return f"cycle {decision.cycle}: {asked}"


def _leaves(parting: Parting) -> Iterator[str]:
    """The values in which the requests differ, in full: what is rounded in words may look the same."""
    if parting.then is not None and parting.now is not None:
        then, now = ([entry.fields for entry in decision.made if entry.kind in parting.requests]
                     for decision in (parting.then, parting.now))
        for path, x, y in differing_leaves(then, now):
            yield f"    {path}: {x} against {y}"


def _end(answer: Answer, run: RunDirectory) -> Iterator[str]:
    if answer.outcome.kind == UNFINISHED:
        return
    before = run.read_result()
    yield ""
    yield "How it ends:"
    error_m = before.get("final_error_m")
    truly = f", {format_error(error_m)} from the goal" if isinstance(error_m, int | float) else ""
    yield f"  as recorded:              {before.get('outcome', UNFINISHED)}{truly}"
    now = f", {format_error(answer.result.error_m)} from the goal" if answer.result is not None else ""
    yield f"  as it would have been:    {answer.outcome.kind}{now}: {answer.outcome.reason}"
