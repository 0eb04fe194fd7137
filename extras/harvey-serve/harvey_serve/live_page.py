"""A run's live page: what it shows, who may order what, and how it is put between a run and its body."""

from __future__ import annotations

import secrets
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from socket import socket

from harvey.runner.ports import Body
from harvey.runner.teller import LiveTeller, PageKind
from harvey_serve.app import LOCAL_HOSTS, build_app, refuse_goal
from harvey_serve.live_state import LiveState
from harvey_serve.run_gate import Gate, GatedBody, do_nothing
from harvey_serve.server import bind, serving
from world_models.building.world import World
from world_models.camera import Camera
from world_models.commands import parse_destination
from world_models.entries import GO_ON
from world_models.files.toml.mission import TASK_READER
from world_models.plugins import SOURCES_GROUP, list_absent


@dataclass(frozen=True)
class LivePage:
    """The page of one run.

    Attributes:
        live: a sink of the run.
        gate: before its body.
        teller: tells it to go elsewhere.
        world: the building.
        part: the locale outside which nothing was built; "" for none.
        hears_all: whether any words are put on the board, where tasks are read and answered, not only places.
    """

    live: LiveState
    gate: Gate
    teller: LiveTeller
    world: World
    part: str = ""
    hears_all: bool = False

    def guard(self, body: Body, tick: Callable[[], None] = do_nothing) -> Body:
        """The body behind the gate; ``tick`` is called while the run is paused."""
        return GatedBody(body, self.gate, tick)

    def ask(self, text: str) -> None:
        """Tell the robot where to go, or to go on; or any task or answer, as ``harvey tell`` does.

        Raises:
            ValueError: it has ended, there is no such place, or these words are for nobody.
        """
        if self.live.ended:
            raise ValueError("expected a run that goes on, got one that has ended")
        if text.strip().lower() == GO_ON:
            self.teller.hear(GO_ON)
            return
        try:
            place = parse_destination(text, self.world)
        except ValueError:
            if not self.hears_all:
                raise
            self.teller.hear(" ".join(text.split()))  # the board answers it
            return
        if self.part and self.part not in self.world.path_of(place.locale):
            raise ValueError(f"expected a room in {self.part}, as only that is simulated here, got {place.locale}")
        if self.world.locale_at(place.in_world(self.world).position) is None:
            raise ValueError(f"expected a place within a room, in feet of its own frame, got {text!r}")
        self.teller.hear(text)


@contextmanager
def open_page(
    listening: socket, world: World, camera: Camera, title: str, *, gate: Gate | None = None, part: str = "",
    token: str = "",
) -> Iterator[LivePage]:
    """Serve the page of a run for a while, and print its addresses.

    Args:
        listening: as :func:`harvey_serve.server.bind` gives it.
        gate: of the run; None: the page only shows it.
        part: as of :class:`LivePage`.
        token: of who may order anything, where there is a gate; "" for a new one.
    """
    hears_all = TASK_READER not in list_absent(SOURCES_GROUP)
    page = LivePage(LiveState(world, camera), gate or Gate(), LiveTeller(), world, part, hears_all)
    token = "" if gate is None else token or secrets.token_urlsafe()
    host, port = listening.getsockname()
    app = build_app(page.live, page.gate, world, title=title, token=token, hosts=(*LOCAL_HOSTS, host),
                    ask=refuse_goal if gate is None else page.ask)
    with serving(app, listening):
        if token:
            print(f"to watch, send, pause and stop: http://{host}:{port}/#{token}")
        print(f"only to watch:                  http://{host}:{port}/", flush=True)
        if host not in LOCAL_HOSTS:
            print(f"whoever reaches {host} may watch; the line is not encrypted", file=sys.stderr, flush=True)
        yield page


@contextmanager
def serve_page(
    port: int, world: World, camera: Camera, title: str, *, host: str = "127.0.0.1", token: str = "", part: str = "",
) -> Iterator[LivePage]:
    """Serve the page of a run that can be paused and stopped; see :class:`harvey.runner.teller.PageKind`."""
    with open_page(bind(host, port), world, camera, title, gate=Gate(), part=part, token=token) as page:
        yield page


KIND = PageKind(serve_page)
