"""The report of a run, a file in a browser: every control, by mouse and by keyboard, on a desk and on a telephone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from browser_pages import TELEPHONE
from harvey.report.page import build_page
from logs.timeline import Timeline
from recorded_runs import Recorded
from report_contents import read_contents


@pytest.fixture(scope="module")
def report(recorded: Recorded, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a kidnap."""
    run, page = recorded("kidnap"), tmp_path_factory.mktemp("report") / "report.html"
    page.write_text(build_page(run, Timeline(run.journal)), encoding="utf-8")
    return page


@pytest.fixture(scope="module")
def data(report: Path) -> Any:
    return read_contents(report.read_text())


def test_a_turning_point_leads_to_its_cycle(report: Path, data: Any, open_page: Callable[..., Any]) -> None:
    page = open_page(report.as_uri())
    turn = next(one for one in data["turns"] if one["kind"] == "found")
    page.locator("#turns button", has_text="found").first.click()
    page.locator(f'#decisions [aria-current="true"] [data-cycle="{turn["cycle"]}"]').wait_for()
    assert page.locator("#cycle-shown").input_value() == str(turn["cycle"])


def test_the_scrubber_moves_by_keyboard_through_pictures_and_plan(
    report: Path, data: Any, open_page: Callable[..., Any]
) -> None:
    page = open_page(report.as_uri())
    page.locator("#cycle").focus()
    page.keyboard.press("Home")
    for _ in range(11):
        page.keyboard.press("ArrowRight")
    page.locator('#decisions [aria-current="true"] [data-cycle="12"]').wait_for()
    assert page.locator("#picture image").count() == 1 and page.locator("#picture line").count() > 20
    assert page.locator("#plans .mark.believed:not([hidden])").count() == 1
    belief = page.locator("#belief").inner_text()
    assert "It believes to be in allens-office" in belief and "in truth" in belief
    page.keyboard.press("End")
    page.locator(f'#decisions [aria-current="true"] [data-cycle="{len(data["cycles"])}"]').wait_for()


def test_a_certificate_opens_on_its_reasons_down_to_a_picture(report: Path, open_page: Callable[..., Any]) -> None:
    page = open_page(report.as_uri())
    page.locator('#milestones button[data-entry^="Certificate-"]').first.click()
    deep, chain = 0, "#why > details"
    while page.locator(chain).count():
        page.locator(chain).first.evaluate("one => { one.open = true; }")
        page.wait_for_timeout(20)
        deep, chain = deep + 1, f"{chain}:first-of-type > details"
    text = page.locator("#why").inner_text()
    assert deep >= 4 and "Certificate-1.0" in text and "CameraPicture-" in text


def test_while_it_is_lost_its_candidates_are_listed(report: Path, data: Any, open_page: Callable[..., Any]) -> None:
    page = open_page(report.as_uri())
    lost = next(one for one in data["turns"] if one["kind"] == "lost")["cycle"]
    many = next(one for one in data["candidates"] if one["cycle"] >= lost)
    page.locator("#cycle").evaluate(f"it => {{ it.value = {many['cycle']}; it.dispatchEvent(new Event('input')); }}")
    page.locator("#candidates li").first.wait_for()
    assert "may stand at" in page.locator("#candidates li").first.inner_text()


def test_on_a_telephone_only_tables_scroll_sideways(report: Path, open_page: Callable[..., Any]) -> None:
    page = open_page(report.as_uri(), viewport=TELEPHONE)
    wide, shown = page.evaluate("[document.documentElement.scrollWidth, window.innerWidth]")
    assert wide <= shown


def test_nothing_on_it_is_a_barrier(report: Path, find_barriers: Callable[..., list[str]]) -> None:
    assert find_barriers(report.as_uri()) == []
