"""The live page in a browser while a mission runs: it is watched, paused, sent elsewhere and stopped from there."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from harvey.campaign.mission_task import Task
from harvey.runner.result import MissionResult
from harvey.simulation.simulated_run import build_head, run_mission
from harvey_serve.live_page import open_page as serve_page
from harvey_serve.run_gate import Gate
from harvey_serve.server import bind


class Served:
    """A mission that begins paused, on a thread of its own, and its addresses."""

    def __init__(self, with_token: str, to_watch: str, gate: Gate) -> None:
        self.with_token, self.to_watch, self.gate = with_token, to_watch, gate
        self.results: list[MissionResult] = []


@contextmanager
def serve(folder: Path, capsys: pytest.CaptureFixture[str]) -> Iterator[Served]:
    task = Task("forty-foot-hallway", (), 0)
    stage = task.stage()
    head = build_head(stage, 0)
    world, gate = head.load_world(), Gate()
    gate.order("pause")
    with serve_page(bind("127.0.0.1", 0), world, head.model(world).lens, "a run", gate=gate, part=stage.part) as live:
        token, watch = re.findall(r"http://\S+", capsys.readouterr().out)
        served = Served(token, watch, gate)

        def drive() -> None:
            result = run_mission(stage, 0, out=folder / "run", sinks=(live.live,), head=head, tell=live.teller.tell,
                                 around=lambda body, _replayed: live.guard(body))
            served.results.append(result)
            live.live.end(f"{result.outcome}: {result.reason}")

        driving = threading.Thread(target=drive, daemon=True)
        driving.start()
        try:
            yield served
        finally:
            gate.order("stop")
            driving.join(60.0)


def test_it_is_watched_sent_elsewhere_paused_and_stopped(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], open_page: Callable[..., Any]
) -> None:
    with serve(tmp_path, capsys) as served:
        page, other = open_page(served.with_token), open_page(served.to_watch)
        page.locator("#state", has_text="paused").wait_for()
        assert page.get_by_role("button", name="Pause").is_visible() and page.locator("#only-watching").is_hidden()
        assert other.get_by_role("button").count() == 0 and other.locator("#only-watching").is_visible()

        page.get_by_label("Tell it").fill("Go to the attic")
        page.get_by_role("button", name="Tell", exact=True).click()
        page.locator("#goal-answer", has_text="the attic").wait_for()
        page.get_by_label("Tell it").fill("(hallway (12,4,0))")
        page.keyboard.press("Enter")
        page.locator("#goal-answer", has_text="told: (hallway (12,4,0))").wait_for()

        page.get_by_role("button", name="Resume").click()
        for watcher in (page, other):
            watcher.locator("#milestones td.verified").first.wait_for()
            watcher.locator("#picture image").wait_for()
            watcher.locator("#decisions tbody tr").first.wait_for()
        assert page.locator("#plans .mark.believed").is_visible() and not page.locator("#plans .mark.true").is_visible()
        other.locator("#state", has_text="ended, reached").wait_for()
        assert page.locator("#orders").is_hidden() and page.locator("#go").is_hidden()
    (result,) = served.results
    assert result.outcome == "reached" and result.path_length_m < 5.0  # the first goal is 12 m away


def test_a_stop_from_the_page_stops_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], open_page: Callable[..., Any]
) -> None:
    with serve(tmp_path, capsys) as served:
        page, lost = open_page(served.with_token), iter((True, True))  # it is said again until somebody answers
        page.route("**/orders/stop", lambda route: route.abort() if next(lost, False) else route.continue_())
        page.get_by_role("button", name="Stop for good").focus()
        page.keyboard.press("Space")
        page.locator("#state", has_text="ended, stopped").wait_for()
    assert [result.outcome for result in served.results] == ["stopped"]


def test_nothing_on_it_is_a_barrier(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], find_barriers: Callable[..., list[str]]
) -> None:
    with serve(tmp_path, capsys) as served:
        assert find_barriers(served.with_token) == [] == find_barriers(served.to_watch)
