"""``harvey serve``: who may watch, who may pause and stop, and what a hostile request can do."""

from __future__ import annotations

import json
import socket
import threading
import urllib.request
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("starlette", reason="the extra 'serve' is not installed")
from starlette.testclient import TestClient

from blackboard import Change, Level, Posted, Revised
from generated_boards import Bench
from harvey.cli import main
from harvey.errors import BadInput
from harvey.runner.teller import LiveTeller
from harvey_serve.app import MOST_WATCHERS, MOST_WORDS, build_app
from harvey_serve.connections import MOST_CONNECTIONS
from harvey_serve.live_page import LivePage
from harvey_serve.live_state import LiveState, Shown
from harvey_serve.run_gate import WHY, Gate, GatedBody
from harvey_serve.server import bind, serving
from scripted_turns import decisions
from world_models.camera import Camera
from world_models.entries import (
    STOP_KEY,
    BodyFault,
    Discrepancy,
    Goal,
    Hypothesis,
    MotionReport,
    Place,
    PlanSketch,
    Redirection,
    Subgoal,
    diagonal,
)
from world_models.files.world_files import load_world
from world_models.frames import Pose2

FLAT = Path(__file__).parents[3] / "docs" / "flat" / "flat.toml"
TOKEN = "the-token"
BASE = "http://127.0.0.1"
BEARER = {"Authorization": f"Bearer {TOKEN}"}


class Page:
    """An ended run, so that its events end too; the gate would still take orders."""

    def __init__(self) -> None:
        world = load_world(FLAT)
        self.gate = Gate()
        self.live = LiveState(world, Camera(512.0, 512.0, 256.0, 256.0, 512, 512))
        for decision in decisions():
            self.live(decision)
        self.live.end("reached: it is there")
        self.asked: list[str] = []
        self.app = build_app(self.live, self.gate, world, title="<b>a run</b>", token=TOKEN, ask=self.asked.append)


    @staticmethod
    def unended() -> LiveState:
        return LiveState(load_world(FLAT), Camera(512.0, 512.0, 256.0, 256.0, 512, 512))


@pytest.fixture(scope="module")
def page() -> Page:
    return Page()


@pytest.fixture(scope="module")
def client(page: Page) -> Iterator[TestClient]:
    with TestClient(page.app, base_url=BASE) as made:
        yield made


def test_who_has_the_token_pauses_resumes_and_stops() -> None:
    page = Page()
    with TestClient(page.app, base_url=BASE) as client:
        for order, state in (("pause", "paused"), ("resume", "running"), ("pause", "paused"), ("stop", "stopping")):
            answer = client.post(f"/orders/{order}", headers={**BEARER, "Origin": BASE})
            assert (answer.status_code, answer.text, page.gate.state) == (200, f"{state}\n", state)


@pytest.mark.parametrize("given_token", [None, "", "Bearer", "Bearer ", TOKEN, f"Bearer {TOKEN}x", f"bearer {TOKEN}",
                                         f"Bearer {TOKEN[:-1]}"])
@pytest.mark.parametrize("order", ["pause", "resume", "stop"])
def test_without_the_token_nothing_happens(page: Page, client: TestClient, given_token: str | None, order: str) -> None:
    headers = {} if given_token is None else {"Authorization": given_token}
    assert client.post(f"/orders/{order}?token={TOKEN}", headers=headers).status_code == 403
    assert page.gate.state == "running"


@pytest.mark.parametrize("headers", [
    {"Origin": "http://evil.example"}, {"Origin": "null"}, {"Origin": "https://127.0.0.1"},
    {"Origin": "http://127.0.0.1:1"}, {"Host": "evil.example"}, {"Host": "127.0.0.1.evil.example"}, {"Host": ""},
    {"Host": "evil.example", "Origin": "http://evil.example"}])
def test_another_site_is_refused_even_with_the_token(page: Page, client: TestClient, headers: dict[str, str]) -> None:
    assert client.post("/orders/pause", headers={**BEARER, **headers}).status_code in (400, 403)
    assert client.get("/", headers=headers).status_code in (400, 403)
    assert page.gate.state == "running"


def test_an_order_is_no_link(page: Page, client: TestClient) -> None:
    assert client.get("/orders/pause", headers=BEARER).status_code == 405
    assert client.post("/orders/drive", headers=BEARER).status_code == 404
    assert page.gate.state == "running"


def test_the_page_holds_no_token_and_asks_nobody_else(client: TestClient) -> None:
    for path in ("/", "/live.js", "/page.css"):
        answer = client.get(path)
        assert answer.status_code == 200 and TOKEN not in answer.text
        assert "default-src 'none'" in answer.headers["content-security-policy"]
        assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
    text = client.get("/").text
    assert "&lt;b&gt;a run" in text and "<b>a run" not in text and 'class="believed mark"' in text


def test_a_watcher_is_told_what_was_decided_last_and_how_it_ended(client: TestClient) -> None:
    answer = client.get("/events")
    assert answer.headers["content-type"].startswith("text/event-stream")
    told: dict[str, Any] = json.loads(answer.text.removeprefix("data: "))
    assert (told["state"], told["ended"]) == ("ended", "reached: it is there")
    made = list(decisions())
    assert [row["cycle"] for row in told["decisions"]] == [one.cycle for one in made][-12:]
    last = [str(change.entry.ref) for change in (*made[-1].observed, *made[-1].made)]
    assert [one["says"].split(":")[0] for one in told["decisions"][-1]["made"]] == last


def test_a_watcher_is_told_where_it_was_where_it_goes_and_that_it_is_lost() -> None:
    bench = Bench()
    goal = bench.put(Goal(Place("hall", 1.0, 2.0), Place("kitchen", 3.0, 1.0)))
    near, far = Place("hall", 3.0, 2.0), Place("kitchen", 1.0, 1.0)
    bench.put(PlanSketch(goal.id, (), "", (Subgoal(Place("hall", 1.0, 2.0), far, False), Subgoal(far, Place(
        "kitchen", 3.0, 1.0), False)), 0, True))
    bench.put(PlanSketch(goal.id, (0,), "hall", (Subgoal(Place("hall", 1.0, 2.0), near, True), Subgoal(
        near, far, True)), 1, True))
    held = bench.put(Hypothesis("hall", Pose2(1.0, 2.0, 0.0), diagonal(0.01, 0.01), "milestone"))
    doubt = bench.put(Discrepancy(Level.GOAL, "the check was refuted", None, (5.0, 30.0), "px"))
    live = LiveState(load_world(FLAT), Camera(512.0, 512.0, 256.0, 256.0, 512, 512))

    def tell(*changes: Change) -> dict[str, Any]:
        live.show(Shown(1, "action", "", "", "", changes))
        live.take()
        told: dict[str, Any] = json.loads(live.message("running"))
        return told

    told = tell(*(Posted(bench.view[entry.id]) for entry in (goal, held, doubt)),
                *(Posted(entry) for entry in bench.view.all(PlanSketch)))
    assert told["lost"] == "the check was refuted" and told["goal"] == "kitchen (3.00, 1.00) m"
    assert [place for place, _, _ in told["way"]] == ["kitchen", "kitchen"] and len(told["trail"]) == 1
    moved = [bench.revise(held, locale_from_robot=Pose2(x, 2.0, 0.0)) for x in (1.05, 1.2)]
    told = tell(*map(Revised, moved), Revised(bench.revise(doubt, status="corrected")))
    assert told["lost"] == "" and len(told["trail"]) == 2
    said = tell(*(Posted(bench.put(Redirection("done", answer=f"answer {number}"))) for number in range(5)))["said"]
    assert [one[-8:] for one in said] == ["answer 2", "answer 3", "answer 4"]
    gone = [Revised(bench.revise(entry, status="done")) for entry in bench.view.all(PlanSketch)]
    assert tell(*gone)["way"] == []


def test_who_has_the_token_sends_it_elsewhere(page: Page, client: TestClient) -> None:
    for words, told in (("Go to the kitchen", "Go to the kitchen"), (" the \u00d6fen ", "the \u00d6fen")):
        answer = client.post("/goal", headers=BEARER, content=words.encode())
        assert (answer.status_code, answer.text) == (200, f"told: {told}\n") and page.asked.pop() == told


@pytest.mark.parametrize(("words", "wanted"), [
    (b"\xff\xfe", "UTF-8"), (b"x" * (MOST_WORDS + 1), f"at most {MOST_WORDS} bytes"), (b"a\x00b", "control characters"),
    (b"a\nb", "in one line")])
def test_what_are_no_words_is_refused(page: Page, client: TestClient, words: bytes, wanted: str) -> None:
    answer = client.post("/goal", headers=BEARER, content=words)
    assert answer.status_code == 400 and wanted in answer.text and page.asked == []


@pytest.mark.parametrize("headers", [{}, {"Authorization": "Bearer "}, {**BEARER, "Origin": "http://evil.example"}])
def test_without_the_token_it_is_sent_nowhere(page: Page, client: TestClient, headers: dict[str, str]) -> None:
    assert client.post("/goal", headers=headers, content=b"Go to the kitchen").status_code == 403
    assert page.asked == []


def test_a_page_without_a_token_takes_no_order_at_all() -> None:
    page = Page()
    app = build_app(page.live, page.gate, load_world(FLAT), title="a run")
    with TestClient(app, base_url=BASE) as client:
        for path in ("/orders/stop", "/goal"):
            assert client.post(path, headers={"Authorization": "Bearer "}, content=b"kitchen").status_code == 404
        assert client.get("/").status_code == 200
    assert page.gate.state == "running"


@pytest.mark.parametrize(("text", "part", "wanted"), [
    ("Go to the attic", "", "no room of"), ("Go from the kitchen to the hall", "", "as the robot goes from where it"),
    ("the kitchen", "hall", "expected a room in hall"), ("(kitchen (900,1,0))", "", "expected a place within a room")])
def test_where_it_cannot_go_it_is_not_sent(text: str, part: str, wanted: str) -> None:
    page = Page()
    teller = LiveTeller()
    live = LivePage(LiveState(load_world(FLAT), Camera(512.0, 512.0, 256.0, 256.0, 512, 512)), page.gate, teller,
                    load_world(FLAT), part)
    with pytest.raises(ValueError, match=wanted):
        live.ask(text)
    live.ask(" Go on")
    assert teller._said.get_nowait().text == "go on"
    replace(live, part="", hears_all=True).ask("Fetch the  book")
    assert teller._said.get_nowait().text == "Fetch the book"
    ended = LivePage(page.live, page.gate, teller, load_world(FLAT))
    page.live.take()
    with pytest.raises(ValueError, match="one that has ended"):
        ended.ask("the kitchen")


LATIN = st.text(st.characters(min_codepoint=33, max_codepoint=126), max_size=40)
PATHS = LATIN | st.sampled_from(
    ["orders/stop", "orders/pause", "goal", "orders/../orders/stop", "events", "%00", "..%2f..%2fetc/passwd",
     "live.js"])
NAMES = st.sampled_from(["Authorization", "Origin", "Host", "Content-Length", "Cookie", "X-Forwarded-Host",
                         "X-HTTP-Method-Override", "Accept"])


@given(st.sampled_from(["GET", "POST", "PUT", "DELETE", "OPTIONS", "HEAD", "TRACE"]), PATHS,
       st.dictionaries(NAMES, LATIN.map(str.strip)), st.binary(max_size=200))
def test_hostile_requests_harm_nothing(
    page: Page, client: TestClient, method: str, path: str, headers: dict[str, str], body: bytes
) -> None:
    target = f"{BASE}/{path.replace('?', '').replace('#', '').replace(':', '')}"
    answer = client.request(method, target, headers=headers, content=body, follow_redirects=False)
    assert answer.status_code < 500
    assert page.gate.state == "running" and page.asked == []


class CountingBody:
    """A body that only counts what it is asked to do."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def execute(self, _command: Any) -> MotionReport:
        self.asked.append("execute")
        return MotionReport(0.0, 0.0, 0.0, 1.0)

    def wait(self, _duration_s: float) -> float:
        return 2.0

    def stop(self) -> None:
        self.asked.append("stop")


def test_a_paused_body_moves_when_it_is_resumed_and_not_before() -> None:
    body, gate = CountingBody(), Gate()
    gate.order("pause")
    gated: Any = GatedBody(body, gate)  # type: ignore[arg-type]
    mover = threading.Thread(target=gated.execute, args=(None,), daemon=True)
    mover.start()
    mover.join(0.05)
    assert mover.is_alive() and body.asked == []
    gate.order("resume")
    mover.join()
    assert body.asked == ["execute"]


@pytest.mark.parametrize("orders", [("stop",), ("pause", "stop"), ("stop", "resume"), ("stop", "pause", "resume")])
def test_a_stopped_body_moves_no_more(orders: tuple[Any, ...]) -> None:
    body, gate = CountingBody(), Gate()
    for order in orders:
        gate.order(order)
    gated: Any = GatedBody(body, gate)  # type: ignore[arg-type]
    fault = gated.execute(None)
    assert isinstance(fault, BodyFault) and (fault.what, fault.when_s) == (STOP_KEY, 2.0)
    assert body.asked == ["stop"]


def test_a_body_that_moves_by_itself_is_told_to_stop_before_the_answer_and_its_run_seems_never_to_hang() -> None:
    body, gate = CountingBody(), Gate()
    heard: list[str] = []
    gate.on_stop = heard.append
    ticked = threading.Event()
    gate.order("pause")
    gated: Any = GatedBody(body, gate, ticked.set)  # type: ignore[arg-type]
    mover = threading.Thread(target=gated.execute, args=(None,), daemon=True)
    mover.start()
    assert ticked.wait(60.0) and body.asked == []
    gate.order("stop")
    assert heard == [WHY]
    mover.join()
    assert body.asked == ["stop"]


@pytest.mark.parametrize(("host", "port", "wanted"), [
    ("0.0.0.0", 0, "one address of this machine"), ("evil.example", 0, "an IPv4 address"),
    ("127.0.0.1", 65536, "65535"), ("127.0.0.1", -1, "from 0 to"), ("192.0.2.1", 0, "that are free on this machine")])
def test_what_cannot_be_listened_on_is_said(host: str, port: int, wanted: str) -> None:
    with pytest.raises(BadInput, match=wanted):
        bind(host, port)


def test_a_port_is_used_once() -> None:
    with bind("127.0.0.1", 0) as first, pytest.raises(BadInput, match="that are free"):
        bind("127.0.0.1", first.getsockname()[1])


@pytest.mark.parametrize(("words", "wanted"), [
    (("--speed", "-1"), "--speed: expected a number that is not below 0"), (("--speed", "nan"), "--speed: expected"),
    (("--seed", "0..3"), "--seed: expected one seed, got 4"), (("--host", "*"), "--host: expected an IPv4 address")])
def test_bad_words_are_refused_in_a_sentence(
    words: tuple[str, ...], wanted: str, capsys: pytest.CaptureFixture[str], tmp_path: Any
) -> None:
    assert main(["serve", "forty-foot-hallway", "--out", str(tmp_path / "run"), *words]) == 2
    assert wanted in capsys.readouterr().err and not (tmp_path / "run").exists()


@pytest.fixture
def served(page: Page) -> Iterator[tuple[str, int]]:
    with serving(build_app(Page.unended(), page.gate, load_world(FLAT), title="a run", token=TOKEN),
                 listening := bind("127.0.0.1", 0)):
        yield listening.getsockname()


def order_over(address: tuple[str, int], order: str) -> str:
    asked = urllib.request.Request(f"http://{address[0]}:{address[1]}/orders/{order}", b"", BEARER, method="POST")
    with urllib.request.urlopen(asked, timeout=10.0) as answer:
        return str(answer.read().decode())


WATCH = b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"


@pytest.mark.parametrize("sent", [b"", b"GET / HTTP/1.1\r\nHost: 127", WATCH])
def test_held_connections_keep_no_order_from_being_heard(served: tuple[str, int], page: Page, sent: bytes) -> None:
    held = []
    try:
        for _ in range(2 * MOST_CONNECTIONS):
            held.append(socket.create_connection(served, timeout=10.0))
            held[-1].sendall(sent)
        assert order_over(served, "pause") == "paused\n" and page.gate.state == "paused"
        assert order_over(served, "resume") == "running\n"
    finally:
        for one in held:
            one.close()


def test_a_request_that_does_not_come_is_not_awaited(served: tuple[str, int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harvey_serve.connections.REQUEST_S", 0.3)
    with socket.create_connection(served, timeout=10.0) as slow:
        for letter in b"GET /":
            slow.sendall(bytes([letter]))
        assert slow.recv(1) == b""


def test_those_who_watch_are_only_so_many(served: tuple[str, int]) -> None:
    watching, answers = [], []
    try:
        for _ in range(MOST_WATCHERS + 1):
            watching.append(socket.create_connection(served, timeout=10.0))
            watching[-1].sendall(WATCH)
            answers.append(watching[-1].recv(12))
        assert answers == [b"HTTP/1.1 200"] * MOST_WATCHERS + [b"HTTP/1.1 503"]
    finally:
        for one in watching:
            one.close()
