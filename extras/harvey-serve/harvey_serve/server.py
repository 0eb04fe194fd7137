"""Serving: uvicorn on a thread of its own, on a socket that was bound before the run begins."""

from __future__ import annotations

import ipaddress
import socket
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager

import uvicorn
from starlette.applications import Starlette

from harvey.errors import BadInput
from harvey_serve.connections import ImpatientConnection

LAST_WORDS_S = 1
"""A watcher that has not read the last message after this time does not get it [s]."""
MAX_PORT = 65535


def bind(host: str, port: int) -> socket.socket:
    """A socket that listens on one address of this machine; port 0 for any free one. Raises BadInput."""
    try:
        address = ipaddress.IPv4Address(host)
    except ValueError:
        raise BadInput(f"--host: expected an IPv4 address of this machine, as 127.0.0.1, got {host!r}") from None
    if address.is_unspecified:
        raise BadInput(f"--host: expected one address of this machine, as 127.0.0.1, got {host}, which means all")
    if not 0 <= port <= MAX_PORT:
        raise BadInput(f"--port: expected a number from 0 to {MAX_PORT}, got {port}")
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
        listening.listen()
    except OSError as error:
        listening.close()
        raise BadInput(f"--host {host} --port {port}: expected an address and port that are free on this machine,"
                       f" got: {error.strerror}") from None
    return listening


@contextmanager
def serving(app: Starlette, listening: socket.socket) -> Iterator[None]:
    """Serve for a while; at the end watchers get the last message, and nothing listens any more."""
    server = uvicorn.Server(uvicorn.Config(
        app, log_config=None, log_level="critical", access_log=False, http=ImpatientConnection,
        timeout_graceful_shutdown=LAST_WORDS_S, server_header=False, ws="none"))
    thread = threading.Thread(target=server.run, args=([listening],), name="live page", daemon=True)
    with closing(listening):
        thread.start()
        try:
            yield
        finally:
            server.should_exit = True
            thread.join()
