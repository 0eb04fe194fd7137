"""Documents say what is: what is generated in them is current, links lead somewhere, nothing is a placeholder."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.tools.architecture_picture import PICTURE, draw_architecture, name_of
from docs.tools.fill import GENERATORS, MARKED, fill, list_pages
from harvey.wiring import KNOWLEDGE_SOURCES, OWN_KINDS, load_kinds
from world_models.plugins import EXTRAS, list_absent

ROOT = Path(__file__).parents[3]
ROOMS = ("blackboard", "world_models", "knowledge_sources", "logs", "harvey")
DOCUMENTS = sorted(path.relative_to(ROOT) for path in (
    *ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("tests/*.md"), *ROOT.glob("blackboard/*.md"),
    *ROOT.glob("extras/*/*.md"),
    *(ROOT / "examples").rglob("*.md")))
TESTED = {
    "python": ("README.md", "docs/start.md", "docs/course/", "docs/how-to/knowledge-source.md", "docs/locale-frames.md",
               "blackboard/README.md"),
    "toml": ("docs/hardware.md", "docs/how-to/README.md", "docs/missions.md", "docs/locale-frames.md",
             "docs/how-to/ros2.md", "docs/how-to/own-simulator.md", "extras/harvey-words/README.md",
             "extras/harvey-people/README.md"),
    "console": ("docs/background/faq.md",),
    "{code-block}": ("docs/tutorials/",),
    "{toctree}": ("docs/index.md", "docs/course/index.md"),
}
"""Language of a block, and the documents in which tests run it, compare it or build it."""
FENCED = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\((?![a-z]+:)([^)#\s]*)(#[^)\s]+)?\)")


@pytest.mark.parametrize("page", [*list_pages()], ids=lambda page: page.stem)
def test_what_is_generated_in_a_page_is_what_its_generator_makes_now(page: Path) -> None:
    """``python -m docs.tools.fill`` writes it again."""
    if page.name == "command-line.md" and (absent := [name for group in EXTRAS for name in list_absent(group)]):
        pytest.skip(f"expected the extras, whose commands are in the page, got none that adds {', '.join(absent)}")
    text = page.read_text(encoding="utf-8")
    assert fill(text) == text
    assert [name for name, made in MARKED.findall(text) if not made.strip()] == []


def test_prose_names_only_sources_and_entries_that_exist() -> None:
    """``the ... watcher`` is a knowledge source by its whole name; ``Kind-1.0`` a kind, or a class of that page."""
    names = {name_of(source) for source in KNOWLEDGE_SOURCES}
    last = "|".join(sorted({name.split()[-1] for name in names}))
    called = re.compile(rf"\b[Tt]he\s+((?:[a-z]+\s+)?(?:{last}|selector|relocalizer))\b(?![-_/.]\w)")
    code = [path.relative_to(ROOT) for room in ROOMS for path in (ROOT / room).rglob("*.py")]
    unknown = []
    for page in (*(page for page in DOCUMENTS if page.name != "CHANGELOG.md"), *code):
        text = (ROOT / page).read_text(encoding="utf-8")
        found = [name.split() for name in called.findall(text)]
        unknown += [(str(page), " ".join(name)) for name in found if not {" ".join(name), name[-1]} & names]
        kinds = set(re.findall(r"\b([A-Z][a-z]\w+)-\d+\.\d+\b", text)) if page.suffix == ".md" else set()
        unknown += [(str(page), kind) for kind in kinds - set(load_kinds()) if f"class {kind}" not in text]
    assert unknown == []


def test_no_generated_part_is_without_its_page() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in list_pages())
    assert {name for name, _ in MARKED.findall(text)} == {*GENERATORS}


@pytest.mark.parametrize("document", DOCUMENTS, ids=str)
def test_a_document_has_no_placeholder(document: Path) -> None:
    """Neither a marker between whose ends nothing stands, nor a word that says that something is still to come."""
    text = (ROOT / document).read_text(encoding="utf-8")
    assert re.findall(r"<!--.*?-->", MARKED.sub("", text), re.DOTALL) == []
    assert re.findall(r"\b(?:TODO|TBD|FIXME|XXX|lorem ipsum|coming soon)\b", text, re.IGNORECASE) == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=str)
def test_every_link_leads_to_a_file_and_to_a_heading_in_it(document: Path) -> None:
    text = FENCED.sub("", (ROOT / document).read_text(encoding="utf-8"))
    astray = []
    for name, anchor in LINK.findall(text):
        target = (ROOT / document).parent / name if name else ROOT / document
        if not target.exists() or (anchor and anchor[1:] not in anchors_of(target)):
            astray.append(name + anchor)
    assert astray == []


def test_every_block_is_of_a_kind_that_some_test_runs_or_compares() -> None:
    """Commands, those without a language, are run by ``installed/test_documented_commands.py``."""
    found = {(language, document.as_posix()) for document in DOCUMENTS for language in re.findall(
        r"^```(\S+).*\n(?:.*\n)*?^```$", MARKED.sub("", (ROOT / document).read_text(encoding="utf-8")), re.MULTILINE)}
    assert found
    assert [one for one in sorted(found) if not any(one[1].startswith(named) for named in TESTED.get(one[0], ()))] == []


def test_the_block_of_an_entry_point_is_that_of_the_example() -> None:
    text = (ROOT / "docs/how-to/README.md").read_text(encoding="utf-8")
    block, = re.findall(r"^```toml\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert block in (ROOT / "examples/plugin/pyproject.toml").read_text(encoding="utf-8")


def test_a_link_that_leads_nowhere_is_seen() -> None:
    assert anchors_of(ROOT / "README.md") >= {"licence"}
    assert "nowhere" not in anchors_of(ROOT / "README.md")
    found = LINK.findall("[a](b.md#c) [d](#e) ![f](g.png) [h](https://i.j/k.md)")
    assert found == [("b.md", "#c"), ("", "#e"), ("g.png", "")]


def anchors_of(document: Path) -> set[str]:
    """Of its headings, as GitHub makes them and Sphinx does."""
    headings = re.findall(r"^#+ (.*)$", FENCED.sub("", document.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", one.lower()).replace(" ", "-") for one in headings}


def test_the_picture_is_the_one_that_the_classes_give() -> None:
    """It names every knowledge source and every kind of entry."""
    picture = PICTURE.read_text(encoding="utf-8")
    assert picture == draw_architecture(KNOWLEDGE_SOURCES, OWN_KINDS)
    words = {name for text in re.findall(r"<text[^>]*>([^<]*)</text>", picture) for name in text.split(" · ")}
    assert words >= {name_of(source) for source in KNOWLEDGE_SOURCES} | set(OWN_KINDS)
