"""The browser, for each test of this folder that asks for it."""

from browser_fixtures import browser, find_barriers, open_page

__all__ = ["browser", "find_barriers", "open_page"]
