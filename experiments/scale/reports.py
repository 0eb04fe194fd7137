"""Reports in a real browser: their size, how soon the first view stands, complaints, and barriers that axe finds."""

from __future__ import annotations

import shutil
import statistics
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from experiments.generated.missions import OFFICE, fault
from experiments.report import Cell, Report
from harvey.cli import main

MISSIONS = 100
OPENED = 5
MOST_MS, MOST_MB, MOST_MB_OF_HOUR = 2000.0, 5.0, 15.0
HOUR = """
world = "research_center"
details = ["research_center_details"]
goal = "(ptrans (hallway (40,4,0)) (hallway (80,4,0)))"

[start]
put_down_sigma_in = 0.5

[limits]
max_cycles = 200000
max_path_m = 10000.0
""" + "".join(f"\n[[told]]\nat_s = {25.0 * (n + 1)}\ngoal = \"Go to the {room}\"\n" for n, room in enumerate(
    ("robot laboratory", "library") * 71))
"""For an hour somebody sends it elsewhere every 25 seconds, before it has arrived."""
COLUMNS = ("report", "MB", "first view ms", "worst ms", "complaints", "barriers")
MB = 1e6
LACKING = "expected Chromium and the extra 'browser': apt-get install chromium; pip install 'harvey[browser]'"
VIEW = """() => {
  const ready = document.querySelector("#decisions tbody tr, #all tbody tr") !== null;
  return ready ? performance.now() : null;
}"""
"""Milliseconds since the page was asked for, once its table is filled."""


@dataclass(frozen=True)
class _Seen:
    """What a browser made of a page."""

    first_view_ms: tuple[float, ...]
    complaints: tuple[str, ...]
    barriers: tuple[str, ...]


def run(quick: bool, seed: int) -> Report:
    """Drive, write the reports, and open each in Chromium."""
    chromium = shutil.which("chromium")
    if chromium is None or find_spec("playwright") is None or find_spec("axe_playwright_python") is None:
        return Report("Reports in a browser", COLUMNS, (), (LACKING,))
    rows: list[tuple[Cell, ...]] = []
    seen: list[_Seen] = []
    are_small: list[bool] = []
    with TemporaryDirectory() as folder:
        for name, page, most_mb in _write(Path(folder), quick, seed):
            found = _open(page, chromium)
            seen.append(found)
            are_small.append(page.stat().st_size / MB < most_mb)
            rows.append((name, page.stat().st_size / MB, statistics.median(found.first_view_ms),
                         max(found.first_view_ms), len(found.complaints), len(found.barriers)))
    worst = max(ms for one in seen for ms in one.first_view_ms)
    claims = (
        (f"the first view of each stands within {MOST_MS / 1e3:g} s", worst < MOST_MS),
        (f"each is smaller than {MOST_MB:g} MB, that of an hour than {MOST_MB_OF_HOUR:g} MB", all(are_small)),
        ("no complaint on the browser's console", not any(one.complaints for one in seen)),
        ("axe finds no barrier, in light, in dark, and on a telephone", not any(one.barriers for one in seen)),
    )
    notes = (
        f"Each is opened {OPENED} times as a file, each time by a browser that has seen nothing; the first view stands"
        " when its table is filled and painted. Median and worst.",
        *(f"complaint: {text}" for one in seen for text in one.complaints),
        *(f"barrier: {text}" for one in seen for text in one.barriers),
    )
    return Report("Reports in a browser", COLUMNS, tuple(rows), notes, claims)


def _write(folder: Path, quick: bool, seed: int) -> Iterator[tuple[str, Path, float]]:
    """Reports, each with its name, and how large it may be [MB]."""
    office = folder / "office.toml"
    office.write_text(OFFICE, encoding="utf-8")
    kidnap = folder / "kidnap.toml"
    kidnap.write_text(OFFICE + fault("kidnap", "allens-office", 3.0, distance_m=0.8, turn_deg=30.0), encoding="utf-8")
    hour = folder / "hour.toml"
    hour.write_text(HOUR, encoding="utf-8")
    wanted = [("a kidnap in an office", str(kidnap), str(seed), MOST_MB)]
    if not quick:
        wanted = [("the main mission", "lab-to-allens-office", str(seed), MOST_MB),
                  ("a kidnap", "hallway-kidnap", str(seed), MOST_MB),
                  (f"a campaign of {MISSIONS}", str(office), f"{seed}..{seed + MISSIONS - 1}", MOST_MB),
                  ("an hour", str(hour), str(seed), MOST_MB_OF_HOUR)]
    for number, (name, scenario, seeds, most_mb) in enumerate(wanted):
        out, page = folder / f"run-{number}", folder / f"{number}.html"
        with redirect_stdout(sys.stderr):
            main(["run", scenario, "--seed", seeds, "--out", str(out)])
            if main(["report", str(out), "--out", str(page)]) != 0:
                raise RuntimeError(f"expected a report of {name}, got none")
        yield name, page, most_mb


def _open(page: Path, chromium: str) -> _Seen:
    """Open a page again and again, and let axe look at it."""
    from axe_playwright_python.sync_playwright import Axe
    from playwright.sync_api import sync_playwright

    times, complaints, barriers = [], [], []
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox", "--disable-gpu"])
        for _ in range(OPENED):
            context = browser.new_context()
            shown = context.new_page()
            shown.on("console", lambda said: complaints.append(said.text) if said.type != "log" else None)
            shown.on("pageerror", lambda error: complaints.append(str(error)))
            shown.goto(page.as_uri(), wait_until="commit")
            times.append(float(shown.wait_for_function(VIEW).json_value()))
            context.close()
        looks: tuple[dict[str, Any], ...] = (
            {"color_scheme": "light"}, {"color_scheme": "dark"}, {"viewport": {"width": 390, "height": 800}})
        for options in looks:
            context = browser.new_context(bypass_csp=True, **options)
            shown = context.new_page()
            shown.goto(page.as_uri())
            shown.wait_for_function(VIEW)
            barriers += [f"{one['id']}: {node['html']}" for one in Axe().run(shown).response["violations"]
                         for node in one["nodes"]]
            context.close()
        browser.close()
    return _Seen(tuple(times), tuple(complaints), tuple(barriers))
