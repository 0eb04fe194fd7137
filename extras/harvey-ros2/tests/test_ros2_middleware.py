"""Middlewares: messages arrive whole, from who sent them, kept ones also late; other programs hear and list them."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import zenoh
from ros2_values import plain

from harvey_ros2.messages.messages import MessageTypes, message_types
from harvey_ros2.messages.middleware import LATCHED, SENSOR, Heard, Middleware, Topic, full_name
from harvey_ros2.messages.zenoh_middleware import ZenohMiddleware

TYPES = message_types("jazzy")
ODOM = Topic("/robot/odom", "nav_msgs/msg/Odometry", SENSOR)
STATIC = Topic("/tf_static", "tf2_msgs/msg/TFMessage", LATCHED)
POSE = Topic("/goal_pose", "geometry_msgs/msg/PoseStamped")
Open = Callable[[MessageTypes, str], Middleware]


@contextmanager
def router() -> Iterator[str]:
    """A Zenoh router of this process; its address."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    config = zenoh.Config()
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", f'["{address}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config):
        yield address


@pytest.fixture(params=["zenoh", "dds"])
def middlewares(request: pytest.FixtureRequest) -> Iterator[Open]:
    """Opens middlewares of one kind that hear one another."""
    opened: list[Middleware] = []
    if request.param == "dds":
        pytest.importorskip("cyclonedds")
        from harvey_ros2.messages.dds_middleware import DdsMiddleware

        yield lambda types, node: opened.append(DdsMiddleware(types, node, domain=77)) or opened[-1]  # type: ignore[func-returns-value]
    else:
        with router() as address:
            yield lambda types, node: opened.append(  # type: ignore[func-returns-value]
                ZenohMiddleware(types, node, router=address)) or opened[-1]
            for middleware in opened:
                middleware.close()
    for middleware in opened:
        middleware.close()
        middleware.close()


def wait_until(holds: Callable[[], Any], most_s: float = 10.0) -> None:
    ends_s = time.monotonic() + most_s
    while not holds():
        assert time.monotonic() < ends_s, "it did not come to be in time"
        time.sleep(0.01)


def _odometry(x_m: float) -> Any:
    return TYPES.build("nav_msgs/msg/Odometry", pose={"pose": {"position": {"x": x_m}}}, child_frame_id="base_link")


def test_messages_arrive_in_order_and_say_who_sent_them(middlewares: Open) -> None:
    one, two = middlewares(TYPES, "one"), middlewares(TYPES, "two")
    heard: list[Heard] = []
    two.subscribe(ODOM, heard.append)
    numbers = iter(range(10**6))

    def meet() -> bool:
        one.publish(ODOM, TYPES.encode(_odometry(next(numbers))))
        return bool(heard)

    wait_until(meet)
    time.sleep(0.2)
    heard.clear()
    sent = [_odometry(next(numbers)) for _ in range(3)]
    for message in sent:
        one.publish(ODOM, TYPES.encode(message))
    wait_until(lambda: len(heard) == 3)
    assert [plain(TYPES.decode(item.cdr, ODOM.type)) for item in heard] == [plain(message) for message in sent]
    assert all(item.came_s <= time.monotonic() for item in heard)
    assert {item.sender for item in heard} == {one.sender(ODOM)} != {two.sender(ODOM)}


def test_what_is_kept_reaches_who_comes_later(middlewares: Open) -> None:
    one = middlewares(TYPES, "one")
    message = TYPES.build(STATIC.type, transforms=[{"child_frame_id": "camera"}])
    one.publish(STATIC, TYPES.encode(message))
    time.sleep(0.1)
    late: list[Heard] = []
    middlewares(TYPES, "late").subscribe(STATIC, late.append)
    wait_until(lambda: late)
    assert plain(TYPES.decode(late[0].cdr, STATIC.type)) == plain(message)


def test_a_hash_of_another_distribution_is_heard_too() -> None:
    with router() as address:
        old = ZenohMiddleware(message_types("humble"), "old", router=address)
        new = ZenohMiddleware(TYPES, "new", router=address)
        heard: list[Heard] = []
        new.subscribe(POSE, heard.append)
        cdr = TYPES.encode(TYPES.build(POSE.type))
        wait_until(lambda: old.publish(POSE, cdr) or heard)  # type: ignore[func-returns-value]
        old.close()
        new.close()


def test_no_router_is_said() -> None:
    with pytest.raises(OSError, match=r"expected a Zenoh router at tcp/127\.0\.0\.1:1, got: "):
        ZenohMiddleware(TYPES, "alone", router="tcp/127.0.0.1:1")
    with pytest.raises(OSError, match="expected a Zenoh router at nonsense, got: "):
        ZenohMiddleware(TYPES, "alone", router="nonsense")


def test_names_begin_with_the_namespace_or_with_a_slash() -> None:
    assert full_name("odom", "") == full_name("odom", "/") == "/odom"
    assert full_name("odom", "robot") == full_name("odom", "/robot/") == "/robot/odom"
    assert full_name("/tf", "robot") == "/tf"


LISTEN = """
import asyncio, sys
import asyncio_for_robotics as afor
import pyzeros
from ros2_pyterfaces.cyclone import all_msgs

@afor.scoped
async def main():
    heard = pyzeros.Sub(getattr(all_msgs, sys.argv[1]), sys.argv[2])
    print("ready", flush=True)
    async for message in heard.listen_reliable():
        print(message, flush=True)
        return

with pyzeros.auto_context(node="listener"):
    asyncio.run(main())
"""
"""A program on other code: its own keys, its own types, its own bytes."""


@pytest.mark.parametrize(("topic", "fields", "said"), [
    (POSE, {"header": {"frame_id": "map"}, "pose": {"position": {"x": 1.25}}}, ("frame_id='map'", "x=1.25")),
    (ODOM, {"child_frame_id": "base_link", "twist": {"twist": {"linear": {"x": 0.5}}}},
     ("child_frame_id='base_link'", "x=0.5")),
])
def test_pyzeros_hears_what_it_says(tmp_path: Path, topic: Topic, fields: dict[str, Any], said: list[str]) -> None:
    pytest.importorskip("pyzeros")
    with router() as address:
        (tmp_path / "zenoh.json5").write_text(json.dumps({
            "mode": "client", "connect": {"endpoints": [address]}, "scouting": {"multicast": {"enabled": False}}}))
        (tmp_path / "listen.py").write_text(LISTEN)
        program = [sys.executable, str(tmp_path / "listen.py"), topic.type.split("/")[-1], topic.name]
        with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
                              env=os.environ | {"ZENOH_SESSION_CONFIG_URI": str(tmp_path / "zenoh.json5")}) as listener:
            assert listener.stdout is not None and listener.stderr is not None
            ready = listener.stdout.readline()
            assert ready == "ready\n", listener.stderr.read()
            node = ZenohMiddleware(TYPES, "harvey", router=address)
            cdr = TYPES.encode(TYPES.build(topic.type, **fields))
            wait_until(lambda: node.publish(topic, cdr) or listener.poll() is not None)  # type: ignore[func-returns-value]
            node.close()
            heard = listener.stdout.read()
    assert all(text in heard for text in said), heard


def test_it_is_listed_by_the_sdk_of_others() -> None:
    pytest.importorskip("zenoh_ros2_sdk")
    with router() as address:
        node = ZenohMiddleware(TYPES, "harvey", router=address)
        node.publish(POSE, TYPES.encode(TYPES.build(POSE.type)))
        node.subscribe(ODOM, lambda _: None)
        listing = [sys.executable, "-m", "zenoh_ros2_sdk.cli", "--router", address.removeprefix("tcp/"), "--no-daemon",
                   "topic", "list", "-t"]
        listed = subprocess.run(listing, capture_output=True, text=True, timeout=60, check=False)
        node.close()
    assert "/goal_pose [geometry_msgs/msg/PoseStamped]" in listed.stdout, listed
    assert "/robot/odom [nav_msgs/msg/Odometry]" in listed.stdout, listed
