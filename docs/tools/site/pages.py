"""A Sphinx extension: documents outside ``docs/`` as pages of the site.

The pages under ``docs/project/`` link to those documents; when the site is built, each is replaced by its document.
Links to these documents lead to their pages.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parents[3]
DOCS = ROOT / "docs"
PAGES: Mapping[str, str] = {
    "README.md": "project/readme.md",
    "ARCHITECTURE.md": "project/architecture.md",
    "CONTRIBUTING.md": "project/contributing.md",
    "CHANGELOG.md": "project/changelog.md",
    "tests/README.md": "project/tests.md",
}
"""The page of each document that is kept outside ``docs/``."""
LINK = re.compile(r"\]\((?![a-z]+:|#)([^)#\s]+)(#[^)\s]*)?\)")


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("source-read", _fill_in)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _fill_in(app: Sphinx, name: str, source: list[str]) -> None:
    page = Path(app.env.doc2path(name))
    source[0] = fill_in(source[0], page)


def fill_in(text: str, page: Path) -> str:
    """A page's text, or that of the document for which it stands, with links as they must be there. Raises OSError."""
    document = next((ROOT / name for name, of in PAGES.items() if DOCS / of == page), page)
    return lead_links(text if document == page else document.read_text(encoding="utf-8"), document, page)


def lead_links(text: str, document: Path, page: Path) -> str:
    """The links of a document, as they must be where its text stands in a page of the site."""
    def replace(link: re.Match[str]) -> str:
        target = Path(os.path.normpath(document.parent / link[1]))
        inside = PAGES.get(target.relative_to(ROOT).as_posix())
        target = target if inside is None else DOCS / inside
        return f"]({Path(os.path.relpath(target, page.parent)).as_posix()}{link[2] or ''})"

    return LINK.sub(replace, text)
