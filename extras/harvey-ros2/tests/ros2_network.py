"""Networks that are cut and mended: a relay of this process, and a network namespace of the kernel's."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from ros2_robot import free_address

SPACE, HERE, THERE = "harvey-cut", "10.231.77.1", "10.231.77.2"


@dataclass(frozen=True, slots=True)
class Network:
    """A way to a robot.

    Attributes:
        robot: the address of its router where it is; us: the address by which we reach it.
        before: words before the robot's command.
        cut, mend: the way.
    """

    robot: str
    us: str
    before: Sequence[str]
    cut: Callable[[], None]
    mend: Callable[[], None]


@contextmanager
def relayed() -> Iterator[Network]:
    """A relay that passes bytes on; cut, it keeps its connections and passes nothing, as a cable that is out."""
    robot, us = free_address(), free_address()
    is_whole, over = threading.Event(), threading.Event()
    is_whole.set()

    def pump(source: socket.socket, sink: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while not over.is_set() and (data := source.recv(65536)):
                is_whole.wait()
                sink.sendall(data)
        for end in (source, sink):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def meet(server: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while not over.is_set():
                near, _ = server.accept()
                far = socket.create_connection(_host(robot), 5.0)
                far.settimeout(None)
                for ends in ((near, far), (far, near)):
                    threading.Thread(target=pump, args=ends, daemon=True).start()

    with socket.create_server(_host(us)) as server:
        threading.Thread(target=meet, args=(server,), daemon=True).start()
        try:
            yield Network(robot, us, (), is_whole.clear, is_whole.set)
        finally:
            over.set()
            is_whole.set()


@contextmanager
def spaced() -> Iterator[Network | None]:
    """A network namespace at the other end of a virtual cable; None where this computer lets nobody make one."""
    if os.geteuid() != 0 or shutil.which("ip") is None or _ip(f"netns add {SPACE}", most=1):
        yield None
        return
    with ExitStack() as stack:
        stack.callback(_ip, f"netns del {SPACE}", most=1)
        if _ip(f"link add harvey-cut0 type veth peer name harvey-cut1 netns {SPACE}", most=2):
            yield None
            return
        for words in (f"addr add {HERE}/30 dev harvey-cut0", "link set harvey-cut0 up",
                      f"-n {SPACE} addr add {THERE}/30 dev harvey-cut1", f"-n {SPACE} link set harvey-cut1 up",
                      f"-n {SPACE} link set lo up"):
            _ip(words)
        address = f"tcp/{THERE}:7447"
        yield Network(address, address, ("ip", "netns", "exec", SPACE), lambda: _set("down"), lambda: _set("up"))


def _set(state: str) -> None:
    _ip(f"link set harvey-cut0 {state}")


def _ip(words: str, most: int = 0) -> int:
    """Exit code of ``ip``; beyond ``most`` it raises."""
    done = subprocess.run(["ip", *words.split()], capture_output=True, text=True, check=False)
    assert done.returncode <= most, done.stderr
    return done.returncode


def _host(address: str) -> tuple[str, int]:
    host, _, port = address.removeprefix("tcp/").rpartition(":")
    return host, int(port)
