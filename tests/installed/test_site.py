"""The documentation site: it builds without a warning, every link in it leads somewhere, and it needs no network."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Mapping
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag

import pytest

from elsewhere import ROOT
from harvey.commands import MODULES

for extra in ("sphinx", "myst_parser", "furo"):
    pytest.importorskip(extra, reason=f"expected the extra 'docs' (pip install '.[docs]'), got no {extra}")

LOADED = {"script": "src", "img": "src", "link": "href", "object": "data", "iframe": "src", "source": "src"}


class PageReader(HTMLParser):
    """Collects from a page where its links lead, what it loads, and what can be linked to in it."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if LOADED.get(tag) in given:
            self.loaded.append(given[LOADED[tag]])


def sphinx(builder: str, source: Path, out: Path) -> subprocess.CompletedProcess[str]:
    strictly = ("-W", "--keep-going", "-q")
    command = [sys.executable, "-m", "sphinx", *strictly, "-b", builder, "-c", ROOT / "docs", source, out]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site")
    done = sphinx("html", ROOT / "docs", out)
    assert done.returncode == 0, done.stderr
    return out


@pytest.fixture(scope="module")
def pages(site: Path) -> Mapping[Path, PageReader]:
    return {path: PageReader(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}


def test_every_link_leads_to_a_file_and_a_place_in_it(pages: Mapping[Path, PageReader]) -> None:
    astray = []
    for path, page in pages.items():
        for link in [*page.links, *page.loaded]:
            if "://" in link or link.startswith(("mailto:", "data:")):
                continue
            name, anchor = urldefrag(link.partition("?")[0])
            target = (path.parent / unquote(name)).resolve() if name else path
            there = target in pages and unquote(anchor) in pages[target].anchors if anchor else target.is_file()
            if not there and not anchor.startswith("svg-"):  # the theme's icons
                astray.append(f"{path.name}: {link}")
    assert len(pages) > 10
    assert astray == []


def test_nothing_is_loaded_from_elsewhere(pages: Mapping[Path, PageReader]) -> None:
    assert [link for page in pages.values() for link in page.loaded if "://" in link or link.startswith("//")] == []


def test_every_document_of_the_repository_has_its_page(site: Path) -> None:
    documents = [path.relative_to(ROOT / "docs") for path in (ROOT / "docs").rglob("*.md")]
    assert [str(path) for path in documents if not (site / path.with_suffix(".html")).is_file()] == []


def test_the_man_page_has_every_command_and_is_sound(tmp_path: Path) -> None:
    done = sphinx("man", ROOT / "docs", tmp_path)
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "harvey.1").read_text(encoding="utf-8")
    assert [name for name in MODULES if f".SH HARVEY {name.upper()}\n" not in text] == []
    if shutil.which("groff"):
        formatter = ["groff", "-man", "-Tutf8", tmp_path / "harvey.1"]
        drawn = subprocess.run(formatter, capture_output=True, text=True, check=False)
        assert (drawn.returncode, drawn.stderr) == (0, "")


@pytest.mark.parametrize("link", ["[a page](nowhere.md)", "[a heading](start.md#nowhere)"])
def test_a_link_that_leads_nowhere_stops_the_build(tmp_path: Path, link: str) -> None:
    (tmp_path / "start.md").write_text("---\norphan: true\n---\n# Start\n", encoding="utf-8")
    (tmp_path / "index.md").write_text(f"# Site\n\n{link}\n", encoding="utf-8")
    done = sphinx("html", tmp_path, tmp_path / "out")
    assert done.returncode != 0
    assert "nowhere" in done.stderr
