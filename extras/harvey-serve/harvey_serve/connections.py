"""Connections: a client that sends no request is cut off, so that others can still send orders."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, cast

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_CONNECTIONS = 256
"""Beyond so many, the one that has been silent longest is closed for each that comes."""
REQUEST_S = 5.0
"""A request is whole after this time [s], or its connection is closed."""

if TYPE_CHECKING:
    from uvicorn.server import Protocols


class ImpatientConnection(H11Protocol):
    """uvicorn's connection, which would wait for a request for ever."""

    _silent_since: float = 0.0
    _limit: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """One comes: another may have to go."""
        super().connection_made(transport)
        self._await_request()
        if len(self.connections) > MOST_CONNECTIONS:
            _close_one(self.connections, self)

    def on_response_complete(self) -> None:
        """The next request may come."""
        super().on_response_complete()
        self._await_request()

    def connection_lost(self, exc: Exception | None) -> None:
        """It is gone."""
        if self._limit is not None:
            self._limit.cancel()
        super().connection_lost(exc)

    @property
    def is_silent(self) -> bool:
        """Whether it has no request that is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def _await_request(self) -> None:
        self._silent_since = self.loop.time()
        if self._limit is not None:
            self._limit.cancel()
        self._limit = self.loop.call_later(REQUEST_S, self._hang_up)

    def _hang_up(self) -> None:
        if self.is_silent:
            self.transport.abort()


def _close_one(connections: set[Protocols], newest: ImpatientConnection) -> None:
    """Close the connection that has been silent longest; where none is, the one that has been there longest."""
    others = [cast(ImpatientConnection, other) for other in connections if other is not newest]
    oldest = min(others, key=lambda other: (not other.is_silent, other._silent_since))
    connections.discard(oldest)  # it is lost a little later; the next that comes is not to count it
    oldest.transport.abort()
