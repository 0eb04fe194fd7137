"""The report of a mission: in one file, the same each time, and working in a browser where there is one."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from harvey.campaign.campaign import Task, run_task
from harvey.report.page import build_page
from harvey.run_files.run_directory import RunDirectory
from harvey.why.journal import JournalHistory
from sim.made_up.short_missions import OFFICE, fault

CHROMIUM = shutil.which("chromium")
CLICKS = """
const drawn_again = () => new Promise((done) => setTimeout(done, 50));
window.addEventListener("load", async () => {
  const told = {};
  const shown = () => document.getElementById("cycle-shown").value;
  const turn = run.turns.find((one) => one.kind === "found");
  [...document.querySelectorAll("#turns button")].find((one) => one.textContent.includes("found")).click();
  await drawn_again();
  told.turn = [shown(), String(turn.cycle)];
  told.current = document.querySelector('#decisions [aria-current="true"] td').textContent;
  scrubber.value = 12;
  scrubber.dispatchEvent(new Event("input"));
  await drawn_again();
  told.scrubbed = shown();
  told.images = document.querySelectorAll("#picture image").length;
  told.lines = document.querySelectorAll("#picture line").length;
  told.visible = document.querySelectorAll("#plans .mark.believed:not([hidden])").length;
  told.belief = document.getElementById("belief").textContent;
  document.querySelector('#milestones button[data-entry^="Certificate-"]').click();
  let deep = 0;
  for (let open = document.querySelector("#why details"); open; deep += 1) {
    open.open = true;
    await drawn_again();
    open = open.querySelector(":scope > details");
  }
  told.deep = deep;
  told.why = document.getElementById("why").textContent;
  const lost = run.turns.find((one) => one.kind === "lost").cycle;
  const many = run.candidates.find((one) => one.cycle >= lost);
  if (many) {
    document.querySelector("#turns button").click();
    scrubber.value = many.cycle;
    scrubber.dispatchEvent(new Event("input"));
    await drawn_again();
    told.candidates = document.querySelectorAll("#candidates li").length;
  }
  const result = document.createElement("pre");
  result.id = "told";
  result.textContent = JSON.stringify(told);
  document.body.append(result);
});
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    folder = tmp_path_factory.mktemp("report")
    (folder / "kidnapped.toml").write_text(
        OFFICE + fault("kidnap", "allens-office", 3.0, distance_m=0.8, turn_deg=30.0), encoding="utf-8")
    assert run_task(Task(str(folder / "kidnapped.toml"), (), 0, folder / "run")).outcome == "reached"
    return RunDirectory(folder / "run")


@pytest.fixture(scope="module")
def page(run: RunDirectory) -> str:
    return build_page(run, JournalHistory(run.journal))


def contents(page: str) -> Any:
    found = re.search(r'<script id="data" type="application/json">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    return json.loads(found[1])


def test_it_asks_the_network_for_nothing(page: str) -> None:
    assert set(re.findall(r"https?://[^\"' <)]+", page)) <= {
        "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert "default-src 'none'" in page
    assert not re.search(r"<(link|iframe|object|embed)\b|@import|src=\"(?!data:)", page)


def test_it_holds_the_run(page: str, run: RunDirectory) -> None:
    history, data = JournalHistory(run.journal), contents(page)
    assert [one["cycle"] for one in data["cycles"]] == list(history.cycles)
    assert data["entries"].keys() == set(history.refs)
    assert all(set(entry["because"]) <= data["entries"].keys() for entry in data["entries"].values())
    assert len(data["pictures"]) == len([*history.of_kind("Frame")])
    judged = [one for one in data["pictures"] if "expected" in one]
    assert judged and all(len(line) == 4 for one in judged for line in (*one["expected"], *one["agreed"]))
    assert data["candidates"] and data["track"] and data["plans"][0]["rooms"]
    assert len(page) < 5e6


def test_it_is_the_same_each_time(page: str, run: RunDirectory) -> None:
    assert build_page(run, JournalHistory(run.journal)) == page


def test_without_the_recording_it_tells_no_truth(run: RunDirectory, tmp_path: Path) -> None:
    shutil.copytree(run.path, tmp_path / "run")
    bare = RunDirectory(tmp_path / "run")
    bare.recording.unlink()
    data = contents(build_page(bare, JournalHistory(bare.journal)))
    assert data["track"] == [] and data["errors"] == [] and data["beliefs"]


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: apt-get install chromium")
def test_in_a_browser_each_control_does_what_it_says(page: str, tmp_path: Path) -> None:
    file = tmp_path / "report.html"
    file.write_text(page.replace("</body>", f"<script>{CLICKS}</script></body>"), encoding="utf-8")
    done = subprocess.run(
        [str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}",
         "--enable-logging=stderr", "--virtual-time-budget=20000", "--dump-dom", file.as_uri()],
        capture_output=True, text=True, timeout=300)
    found = re.search(r'<pre id="told">(.*?)</pre>', done.stdout, re.DOTALL)
    assert "CONSOLE" not in done.stderr and found is not None, done.stderr[-2000:]
    told = json.loads(unescape(found[1]))
    assert told["turn"][0] == told["turn"][1] == told["current"]
    assert told["scrubbed"] == "12" and told["images"] == 1 and told["lines"] > 20 and told["visible"] == 1
    assert "It believes to be in allens-office" in told["belief"] and "in truth" in told["belief"]
    assert told["deep"] >= 4 and "Certificate-1.0" in told["why"] and "Frame-" in told["why"]
    assert told["candidates"] >= 1
