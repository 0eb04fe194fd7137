"""The report of a campaign of a hundred in a browser: it sorts, filters, and is readable on a telephone."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from browser_pages import TELEPHONE
from harvey.cli import main

SEEDS = range(100)


def result(seed: int) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    return {"scenario": "stroll", "seed": seed, "outcome": "lost" if seed % 3 == 0 else "reached",
            "reason": f"for the {seed}th reason",
            "final_error_m": None if seed == 4 else float(rng.lognormal(-5.0, 0.8)),
            "sim_time_s": float(rng.normal(60.0, 9.0)), "probes": int(rng.integers(0, 6)),
            "milestones": {"refuted": int(rng.integers(0, 3))}, "contacts": [], "collisions": 0}


RESULTS = [result(seed) for seed in SEEDS]
NAMES = [f"stroll, seed {seed}" for seed in SEEDS]


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("campaign") / "stroll"
    folder.mkdir()
    lines = [{"code": "x"}, *({"case": number, "result": one} for number, one in enumerate(RESULTS))]
    (folder / "results.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
    assert main(["report", str(folder), "--out", str(folder / "report.html")]) == 0
    return folder / "report.html"


def names(page: Any) -> list[str]:
    """The names of the missions that are shown, in the order in which they are."""
    return list(page.locator("#all tbody tr:visible th").all_inner_texts())


def test_it_sorts_by_numbers_and_by_names_and_leaves_what_is_not_known_at_the_end(
    report: Path, open_page: Callable[..., Any]
) -> None:
    page = open_page(report.as_uri())
    head = page.locator("#all thead th", has_text="final error mm")
    known = sorted((seed for seed in SEEDS if seed != 4), key=lambda seed: RESULTS[seed]["final_error_m"])
    head.locator("button").click()
    assert names(page) == [*(NAMES[seed] for seed in known), NAMES[4]]
    assert head.get_attribute("aria-sort") == "ascending"
    head.locator("button").click()
    assert names(page) == [*(NAMES[seed] for seed in known[::-1]), NAMES[4]]
    page.locator("#all thead th button").first.focus()
    page.keyboard.press("Enter")
    assert names(page) == NAMES  # seed 10 after seed 9


def test_it_filters_by_outcome_and_by_words(report: Path, open_page: Callable[..., Any]) -> None:
    page = open_page(report.as_uri())
    page.locator(".filters select").first.select_option("lost")
    assert names(page) == [NAMES[seed] for seed in SEEDS if seed % 3 == 0]
    assert "34 of 100 shown" in page.locator(".filters").inner_text()
    page.locator(".filters input").fill("seed 3")
    assert names(page) == [NAMES[seed] for seed in (3, 30, 33, 36, 39)]
    page.locator(".filters input").fill("")
    page.locator(".filters select").first.select_option("")
    assert names(page) == NAMES


def test_on_a_telephone_only_the_table_scrolls_sideways(report: Path, open_page: Callable[..., Any]) -> None:
    page = open_page(report.as_uri(), viewport=TELEPHONE)
    wide, shown = page.evaluate("[document.documentElement.scrollWidth, window.innerWidth]")
    assert wide <= shown


def test_nothing_on_it_is_a_barrier(report: Path, find_barriers: Callable[..., list[str]]) -> None:
    assert find_barriers(report.as_uri()) == []
