"""A real browser, Debian's Chromium, driven by Playwright: what is wrong on a page is a failure of every test."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from browser_pages import TELEPHONE

CHROMIUM = shutil.which("chromium")

Open = Callable[..., Any]
PATIENCE_MS = 300_000
"""A page waits so long for what is to come: a first mission compiles for minutes."""


def is_complaint(said: Any) -> bool:
    """Whether a line of the browser's console is one; that a form was refused (400) is an answer to the user."""
    return said.type in ("error", "warning") and "status of 400" not in said.text


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    driver_api = pytest.importorskip("playwright.sync_api", reason="the extra 'browser' is not installed")
    if CHROMIUM is None:
        pytest.skip("no chromium here: apt-get install chromium")
    with driver_api.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        yield started
        started.close()


@pytest.fixture
def open_page(browser: Any) -> Iterator[Open]:
    """Opens an address; keywords are those of a browser's context. Complaints of any page fail the test at its end."""
    wrong: list[str] = []
    contexts = []

    def open_it(address: str, **options: Any) -> Any:
        contexts.append(browser.new_context(**options))
        page = contexts[-1].new_page()
        page.set_default_timeout(PATIENCE_MS)
        page.on("console", lambda said: wrong.append(said.text) if is_complaint(said) else None)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.goto(address)
        return page

    yield open_it
    for context in contexts:
        context.close()
    assert wrong == []


@pytest.fixture
def find_barriers(browser: Any) -> Callable[[str], list[str]]:
    """What axe finds to be a barrier on a page at an address: by its rule, and where. In light, in dark, and narrow."""
    from axe_playwright_python.sync_playwright import Axe

    def find(address: str, **options: Any) -> list[str]:
        found = []
        for more in ({"color_scheme": "light"}, {"color_scheme": "dark"}, {"viewport": TELEPHONE}):
            context = browser.new_context(bypass_csp=True, **more, **options)  # axe is put into the page
            page = context.new_page()
            page.goto(address)
            page.wait_for_timeout(300)
            answer = Axe().run(page)
            found += [f"{one['id']}: {node['html'][:200]}" for one in answer.response["violations"]
                      for node in one["nodes"]]
            context.close()
        return found

    return find
