"""Structures that repeat themselves: is a pose one repetition off ever verified, and how many right ones are?"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from experiments.bounds import at_least, at_most
from experiments.perception.locate_camera import RIVAL_MIN_LEAD, PoseVerdict
from experiments.perception.repeats_scenes import KINDS, MAX_PITCHES
from experiments.perception.repeats_trials import TOLERANCE_PITCHES, Case, CaseResult, run_case
from experiments.report import Cell, Report
from experiments.trials import RESULTS, campaign_folder, run_trials

TITLE = "Structures that repeat themselves: poses verified rightly and wrongly"
COLUMNS = ("structures", "cases", "wrong, no search", "wrong, ours", "unique", "verified of unique", "not testable",
           "of these name a rival", "refuted though right")
FIRST_SEED = 100_000
"""Seeds below are free for choosing constants."""
FULL, QUICK = 5000, 12
MAX_WRONG, MIN_VERIFIED = 1e-3, 0.98


def run(quick: bool, seed: int, missions: int | None = None) -> Report:
    """Draw cases of each kind in turn; ``missions``: how many cases."""
    count = missions or (QUICK if quick else FULL)
    kinds = list(KINDS)
    cases = [Case(kinds[n % len(kinds)], FIRST_SEED * (seed + 1) + n) for n in range(count)]
    folder = campaign_folder("repeats", seed, quick=quick)
    found = run_trials(run_case, cases, CaseResult, folder, "case")
    rows = [_row(kind, [r for c, r in zip(cases, found, strict=True) if c.kind == kind]) for kind in kinds]
    return Report(TITLE, COLUMNS, (*rows, _row("all", found)), _notes(seed, f"{folder}/{RESULTS}"),
                  _claims(found, quick=quick))


def _row(name: str, found: Sequence[CaseResult]) -> tuple[Cell, ...]:
    unique, untestable = [r for r in found if r.is_unique], [r for r in found if _is(r, PoseVerdict.NOT_TESTABLE)]
    return (
        name, len(found), _count(r.was_silently_wrong for r in found), _count(r.is_silently_wrong for r in found),
        len(unique), _count(_is_verified(r) for r in unique), len(untestable),
        _count(r.names_rival for r in untestable),
        _count(_is(r, PoseVerdict.REFUTED) and r.is_right for r in found))


def _claims(found: Sequence[CaseResult], *, quick: bool) -> tuple[tuple[str, bool], ...]:
    """What must hold; few cases cannot show how many unique ones are verified."""
    wrong, unique = _count(r.is_silently_wrong for r in found), [r for r in found if r.is_unique]
    verified = _count(_is_verified(r) for r in unique)
    claims = [(f"silently wrong at most 0.1%: {wrong} of {len(found)}, with 95 % confidence below"
               f" {at_most(wrong, len(found)):.2%}", wrong <= MAX_WRONG * len(found))]
    if not quick and unique:
        claims.append((f"of the unique ones at least 98% are verified: {verified} of {len(unique)}, with 95 %"
                       f" confidence above {at_least(verified, len(unique)):.1%}",
                       verified >= MIN_VERIFIED * len(unique)))
    return tuple(claims)


def _notes(seed: int, results: str) -> tuple[str, ...]:
    return (
        "Stairs, shelves, colonnades, window fronts, tiled floors and rows of doors with pitches of 0.25 to 3 m, with"
        " up to six rectangles on them that do not repeat, as lines; 8 % of the lines are missed, the others are in one"
        " to three pieces with 0.3 px of noise, among up to 120 segments of clutter. The prior is off by up to"
        f" {MAX_PITCHES:.0f} pitches. Seeds from {FIRST_SEED * (seed + 1)} on; constants were chosen on seeds below"
        f" {FIRST_SEED}. No pictures are rendered.",
        f"Wrong: verified, and more than {TOLERANCE_PITCHES} pitches off. No search: the same without a search for"
        " rivals, as it was before.",
        f"Unique: no other pose on a grid of half a pitch, each refined, comes within"
        f" {RIVAL_MIN_LEAD:g} of the true pose's log likelihood. It shares the likelihood with"
        " ours, not the search.",
        f"One line per case: {results}",
    )


def _is_verified(result: CaseResult) -> bool:
    return _is(result, PoseVerdict.VERIFIED) and result.is_right


def _is(result: CaseResult, verdict: PoseVerdict) -> bool:
    return result.verdict == verdict.value


def _count(held: Iterable[bool]) -> int:
    return sum(1 for h in held if h)
