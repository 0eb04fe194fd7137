"""The hostile client of ``harvey experiment watchers``: what it sends must not be heeded, and is not."""

from __future__ import annotations

import asyncio
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from harvey_serve.app import build_app
from harvey_serve.live_state import LiveState
from harvey_serve.run_gate import Gate
from harvey_serve.server import bind, serving
from harvey_serve.watcher_clients import attack, make_request
from world_models.camera import Camera
from world_models.files.world_files import load_world

FLAT = Path(__file__).parents[3] / "docs" / "flat" / "flat.toml"


@given(st.integers(0, 2**32))
def test_no_request_has_the_right_token_but_from_another_site(seed: int) -> None:
    request = make_request(np.random.default_rng(seed))
    lines = request.partition(b"\r\n\r\n")[0].split(b"\r\n")
    assert b"Authorization: Bearer a-token" not in lines or b"Origin: http://evil.example" in lines


def test_none_of_300_is_heeded_and_none_is_an_error_of_the_server() -> None:
    world, gate = load_world(FLAT), Gate()
    asked: list[str] = []
    live = LiveState(world, Camera(512.0, 512.0, 256.0, 256.0, 512, 512))
    app = build_app(live, gate, world, title="a run", token="a-token", ask=asked.append)
    listening = bind("127.0.0.1", 0)
    with serving(app, listening):
        ((answers,),) = (one.values() for one in asyncio.run(attack(listening.getsockname()[1], 300, 0)))
    assert sum(count for count in answers.values()) == 300 and len(answers) >= 4
    assert not any(status.startswith("5") for status in answers)
    assert gate.state == "running" and asked == []
