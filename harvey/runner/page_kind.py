"""What shows a run on a page while it goes on, and lets people send, pause and stop it: an extra brings it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

from harvey.errors import BadInput
from world_models.plugins import PAGES_GROUP, list_absent, load_plugins

LIVE = "live"
"""Its name, as an entry point."""


@dataclass(frozen=True, slots=True)
class PageKind:
    """A kind of live page.

    Attributes:
        serve: ``serve(port, world, lens, title, *, host, token, part)`` serves the page of one run while the block
            lasts. It gives an object with ``live`` (a sink of the run; ``live.end(text)`` tells how it ended),
            ``teller.tell`` (what is said to the run), ``guard(body, tick)`` (the body behind its gate) and ``gate``
            (``on_stop`` is called when somebody stops the run, ``state`` is how it stands).
    """

    serve: Callable[..., AbstractContextManager[Any]]


def find_page(asked_by: str) -> PageKind:
    """The page that is installed. Raises BadInput, which says what to install, where there is none."""
    if needs := list_absent(PAGES_GROUP).get(LIVE):
        raise BadInput(f"{asked_by} needs {needs}")
    page: PageKind = load_plugins(PAGES_GROUP, PageKind, LIVE)[LIVE]
    return page
