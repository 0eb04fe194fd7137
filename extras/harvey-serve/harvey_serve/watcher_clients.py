"""Clients of a live page, in a process of their own: watchers, one that reads nothing, and hostile requests.

``python -m harvey_serve.watcher_clients watch|stall|attack PORT COUNT SEED`` prints a line when it is connected,
and at its end what it got, as JSON.
"""

from __future__ import annotations

import asyncio
import json
import sys
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping

import numpy as np

HOST = "127.0.0.1"
EVENTS = b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
AT_ONCE = 16
ANSWER_S = 10.0
METHODS = ("GET", "POST", "PUT", "DELETE", "OPTIONS", "PATCH", "HEAD", "TRACE", "PROPFIND")
PATHS = ("/", "/orders/stop", "/orders/pause", "/orders/resume", "/goal", "/orders/../orders/stop", "/orders/%73top",
         "//orders/stop", "/orders/stop?token=a-token", "/..%2f..%2fetc/passwd", "/%00", "/live.js",
         "/orders/" + "x" * 3000)
HEADERS = ("Authorization: Bearer", "Authorization: Bearer a-toke", "Authorization: Basic YS10b2tlbg==",
           "Authorization: bearer a-token", "Origin: http://evil.example", "Origin: null", "Host: evil.example",
           "X-Forwarded-Host: evil.example", "X-HTTP-Method-Override: POST", "Content-Length: 99999999999",
           "Content-Length: -1", "Transfer-Encoding: chunked", "Cookie: token=a-token", "Expect: 100-continue",
           "Content-Encoding: gzip", "Range: bytes=0-", "Upgrade: websocket")
BODIES = (b"", b"Go to the library", b"{\"goal\": \"library\"}", b"\xff\x00" * 50, b"a" * 5000)
LONG = 20_000


async def watch(port: int, count: int, _seed: int) -> list[dict[str, float]]:
    """So many who read all that they get."""
    lines = [await asyncio.open_connection(HOST, port, limit=1 << 24) for _ in range(count)]
    for _, writer in lines:
        writer.write(EVENTS)
    print("ready", flush=True)

    async def read(reader: asyncio.StreamReader) -> dict[str, float]:
        messages, size, began, last = 0, 0, time.perf_counter(), time.perf_counter()
        while line := await reader.readline():
            size += len(line)
            if line.startswith(b"data: "):
                messages, last = messages + 1, time.perf_counter()
        return {"rate": messages / max(last - began, 1e-9), "mb": size / 1e6}

    return list(await asyncio.gather(*(read(reader) for reader, _ in lines)))


async def stall(port: int, count: int, _seed: int) -> list[dict[str, float]]:
    """So many who ask for events and read none."""
    lines = [await asyncio.open_connection(HOST, port, limit=1) for _ in range(count)]
    for _, writer in lines:
        writer.write(EVENTS)
        writer.transport.pause_reading()  # type: ignore[attr-defined]
    print("ready", flush=True)
    await asyncio.to_thread(sys.stdin.read)  # until it is closed
    return [{"rate": 0.0, "mb": 0.0} for _ in lines]


async def attack(port: int, count: int, seed: int) -> list[dict[str, dict[str, int]]]:
    """So many hostile requests, a few at a time; how each was answered."""
    rng, answers = np.random.default_rng(seed), Counter[str]()
    requests = iter([make_request(rng) for _ in range(count)])
    print("ready", flush=True)

    async def send() -> None:
        for request in requests:
            answers[await ask(port, request)] += 1

    await asyncio.gather(*(send() for _ in range(AT_ONCE)))
    return [{"answers": dict(answers)}]


def make_request(rng: np.random.Generator) -> bytes:
    """A request that must not be heeded: it has no right token, or comes from elsewhere, or is none."""
    kind = rng.random()
    if kind < 0.1:
        return rng.bytes(int(rng.integers(1, 400))) + b"\r\n\r\n"
    if kind < 0.12:
        return b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n" + b"X: y\r\n" * LONG + b"\r\n"
    method, path, body = (int(rng.integers(len(options))) for options in (METHODS, PATHS, BODIES))
    headers = [f"Host: {HOST}", *(HEADERS[k] for k in rng.permutation(len(HEADERS))[:rng.integers(4)])]
    if kind < 0.3:  # the right token, from another site
        headers += ["Authorization: Bearer a-token", "Origin: http://evil.example"]
    if not any(line.startswith(("Content-Length", "Transfer-Encoding")) for line in headers):
        headers.append(f"Content-Length: {len(BODIES[body])}")
    lines = [f"{METHODS[method]} {PATHS[path]} HTTP/1.1", *headers, "Connection: close", "", ""]
    return "\r\n".join(lines).encode() + BODIES[body]


async def ask(port: int, request: bytes) -> str:
    """The status of the answer; "closed" where there is none."""
    try:
        reader, writer = await asyncio.open_connection(HOST, port)
        writer.write(request)
        first = await asyncio.wait_for(reader.readline(), ANSWER_S)
        writer.close()
        return first.split(b" ")[1].decode() if first.startswith(b"HTTP/") else "closed"
    except (OSError, TimeoutError):
        return "closed"


CLIENTS: Mapping[str, Callable[[int, int, int], Awaitable[object]]] = {"watch": watch, "stall": stall, "attack": attack}

if __name__ == "__main__":
    made = CLIENTS[sys.argv[1]](*map(int, sys.argv[2:]))

    async def main() -> object:
        return await made

    print(json.dumps(asyncio.run(main())), flush=True)
