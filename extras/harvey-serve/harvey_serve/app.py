"""The live page's web application: everybody who reaches it may watch; only who has the token may order anything."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from html import escape
from importlib.resources import files
from typing import Any, get_args

from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from harvey.report.data import draw_blank_plans
from harvey.report.page import embedded, fill_in
from harvey_serve.live_state import LiveState
from harvey_serve.run_gate import Gate, Order
from world_models.building.world import World

PACKAGE = "harvey_serve"
PERIOD_S = 0.1
"""A watcher is told at most once in this time."""
LOCAL_HOSTS = ("127.0.0.1", "localhost")
HEADERS: Mapping[str, str] = {
    "content-security-policy": "default-src 'none'; img-src data:; style-src 'self' 'unsafe-inline'; script-src 'self';"
                               " connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "x-content-type-options": "nosniff", "referrer-policy": "no-referrer", "cache-control": "no-store",
}
"""Of every answer: nothing is fetched from elsewhere, and no other page can frame this one."""


MOST_WATCHERS = 192
"""Who comes to watch when there are so many is told to come later (503); orders are heard all the same."""
NO_TOKEN = "expected the token that was printed at the start\n"
MOST_WORDS = 1000
"""A goal has at most so many bytes."""


def refuse_goal(_text: str) -> None:
    """Raises ValueError: nobody can be sent elsewhere."""
    raise ValueError("expected a run that takes another goal, got one that does not")


class Board:
    """The newest message, for all watchers. A watcher that is slow misses messages; nobody keeps them for it."""

    def __init__(self, live: LiveState, gate: Gate) -> None:
        self._live, self._gate = live, gate
        self._message, self._state, self._number = "", "", 0
        self._changed = asyncio.Condition()

    async def renew(self) -> None:
        """Make a message whenever something is new, until cancelled."""
        while True:
            state = self._gate.state
            if self._live.take() or state != self._state:
                self._state = state
                self._message = f"data: {self._live.message(state)}\n\n"
                self._number += 1
                async with self._changed:
                    self._changed.notify_all()
            await asyncio.sleep(PERIOD_S)

    async def messages(self) -> AsyncIterator[str]:
        """The newest message, then each that is newer when the last was sent; ends with the run."""
        told = 0
        while True:
            async with self._changed:
                while self._number == told:
                    await self._changed.wait()
            told = self._number
            yield self._message
            if self._live.ended:
                return


class Guard:
    """Refuses requests that another site's page makes, and watchers beyond MOST_WATCHERS; marks every answer."""

    def __init__(self, app: ASGIApp) -> None:
        self._app, self._watchers = app, 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def marked(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        if scope["type"] == "http":
            headers = Headers(scope=scope)
            own = f"http://{headers.get('host', '')}"
            if any(origin != own for origin in headers.getlist("origin")):
                await PlainTextResponse("expected a request of this page, got one of another origin\n", 403)(
                    scope, receive, marked)
                return
            if scope["method"] in ("GET", "HEAD"):
                await self._show(scope, receive, marked)
                return
        await self._app(scope, receive, marked)

    async def _show(self, scope: Scope, receive: Receive, send: Send) -> None:
        if self._watchers >= MOST_WATCHERS:
            await PlainTextResponse(f"expected at most {MOST_WATCHERS} who watch, come later\n", 503)(
                scope, receive, send)
            return
        self._watchers += 1
        try:
            await self._app(scope, receive, send)
        finally:
            self._watchers -= 1


def build_app(
    live: LiveState, gate: Gate, world: World, *, title: str, token: str = "", ask: Callable[[str], None] = refuse_goal,
    hosts: Sequence[str] = LOCAL_HOSTS,
) -> Starlette:
    """The application.

    Args:
        token: what an order must be given with, as ``Authorization: Bearer TOKEN``; "": there are no orders.
        ask: tells the robot something, as where to go; raises ValueError where it cannot be.
        hosts: names under which it answers; a request for any other is refused (DNS rebinding).
    """
    boards: list[Board] = []
    page = _build_page(world, title)

    @asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        boards.append(Board(live, gate))
        renewing = asyncio.create_task(boards[-1].renew())
        try:
            yield
        finally:
            renewing.cancel()

    async def show(_request: Request) -> Response:
        return HTMLResponse(page)

    async def script(_request: Request) -> Response:
        return Response(_read("harvey.report", "draw.js") + _read(PACKAGE, "live.js"), media_type="text/javascript")

    async def style(_request: Request) -> Response:
        return Response(_read("harvey.report", "page.css"), media_type="text/css")

    async def events(_request: Request) -> Response:
        return StreamingResponse(boards[-1].messages(), media_type="text/event-stream")

    def is_allowed(request: Request) -> bool:
        given = request.headers.get("authorization", "")
        return secrets.compare_digest(given.encode(), f"Bearer {token}".encode())

    def order(request: Request) -> Response:  # on a thread of its own: a stop waits until the base has heard it
        if not is_allowed(request):
            return PlainTextResponse(NO_TOKEN, 403)
        wanted: Order = request.path_params["order"]
        if wanted not in get_args(Order):
            return PlainTextResponse(f"expected one of {', '.join(get_args(Order))}\n", 404)
        gate.order(wanted)
        return PlainTextResponse(f"{gate.state}\n")

    async def go(request: Request) -> Response:
        if not is_allowed(request):
            return PlainTextResponse(NO_TOKEN, 403)
        try:
            text = await _read_words(request)
            ask(text)
        except ValueError as error:
            return PlainTextResponse(f"{error}\n", 400)
        return PlainTextResponse(f"told: {text}\n")

    orders = [Route("/orders/{order}", order, methods=["POST"]), Route("/goal", go, methods=["POST"])] if token else []
    return Starlette(
        routes=[Route("/", show), Route("/live.js", script), Route("/page.css", style), Route("/events", events),
                *orders],
        middleware=[Middleware(Guard),
                    Middleware(TrustedHostMiddleware, allowed_hosts=list(hosts), www_redirect=False)],
        lifespan=lifespan)


async def _read_words(request: Request) -> str:
    """The words of a goal. Raises ValueError."""
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > MOST_WORDS:
            raise ValueError(f"expected at most {MOST_WORDS} bytes, as 'Go to the library', got more")
    try:
        words = body.decode("utf-8").strip()
    except UnicodeDecodeError:
        raise ValueError("expected words in UTF-8, as 'Go to the library', got other bytes") from None
    if not words.isprintable():
        raise ValueError("expected words in one line, as 'Go to the library', got control characters")
    return words


def _build_page(world: World, title: str) -> str:
    plans = draw_blank_plans(world)
    known: list[dict[str, Any]] = [{key: value for key, value in plan.items() if key != "svg"} for plan in plans]
    return fill_in(_read(PACKAGE, "live.html"), {
        "title": escape(title), "plans": "\n".join(plan["svg"] for plan in plans), "data": embedded({"plans": known})})


def _read(package: str, name: str) -> str:
    return (files(package) / name).read_text(encoding="utf-8")
