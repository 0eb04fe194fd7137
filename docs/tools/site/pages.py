"""A Sphinx extension: what pages take from the code and from documents outside ``docs/``, when the site is built.

In a page, ``<!-- generate: NAME -->`` stands for the Markdown that the generator of this name makes, and
``<!-- document: FILE -->`` for a document of the repository. Links to those documents lead to their pages.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path

from sphinx.application import Sphinx

from docs.tools.site.command_line import describe_commands
from docs.tools.site.journal import describe_kinds
from docs.tools.site.mission_files import (
    describe_faults,
    describe_hardware_tables,
    describe_scenario_tables,
    describe_shared_tables,
)
from docs.tools.site.setting_tables import describe_settings
from docs.tools.site.world_files import describe_world_keys
from world_models import frames

ROOT = Path(__file__).parents[3]
DOCS = ROOT / "docs"


def describe_frames() -> str:
    """What the module of coordinate frames says of them."""
    return f"```text\n{(frames.__doc__ or '').strip()}\n```"


PAGES: Mapping[str, str] = {
    "README.md": "project/readme.md",
    "ARCHITECTURE.md": "project/architecture.md",
    "CONTRIBUTING.md": "project/contributing.md",
    "CHANGELOG.md": "project/changelog.md",
    "tests/README.md": "project/tests.md",
}
"""The page of each document that is kept outside ``docs/``."""
GENERATORS: Mapping[str, Callable[[], str]] = {
    "commands": describe_commands, "settings": describe_settings, "kinds": describe_kinds,
    "shared-tables": describe_shared_tables, "hardware-tables": describe_hardware_tables,
    "scenario-tables": describe_scenario_tables, "faults": describe_faults, "world-keys": describe_world_keys,
    "frames": describe_frames,
}
"""What makes Markdown from the code, by the name that pages use."""
MARKER = re.compile(r"^<!-- (generate|document): (\S+) -->$", re.MULTILINE)
LINK = re.compile(r"\]\((?![a-z]+:|#)([^)#\s]+)(#[^)\s]*)?\)")


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("source-read", _fill_in)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _fill_in(app: Sphinx, name: str, source: list[str]) -> None:
    page = Path(app.env.doc2path(name))
    source[0] = fill_in(source[0], page)


def fill_in(text: str, page: Path) -> str:
    """The page's text with its markers replaced. Raises KeyError for a generator that there is not, OSError."""
    def replace(marker: re.Match[str]) -> str:
        kind, name = marker.groups()
        if kind == "generate":
            return GENERATORS[name]()
        return lead_links((ROOT / name).read_text(encoding="utf-8"), ROOT / name, page)

    return MARKER.sub(replace, lead_links(text, page, page))


def lead_links(text: str, document: Path, page: Path) -> str:
    """The links of a document, as they must be where its text stands in a page of the site."""
    def replace(link: re.Match[str]) -> str:
        target = Path(os.path.normpath(document.parent / link[1]))
        inside = PAGES.get(target.relative_to(ROOT).as_posix())
        target = target if inside is None else DOCS / inside
        return f"]({Path(os.path.relpath(target, page.parent)).as_posix()}{link[2] or ''})"

    return LINK.sub(replace, text)
