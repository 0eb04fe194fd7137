"""``harvey report``: what is put into the page stays text, whatever it says."""

from __future__ import annotations

import base64
import json
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from blackboard import decision_line
from harvey.cli import main
from harvey.errors import BadInput
from harvey.report.data import WIDTH_PX, shrink
from harvey.report.page import embedded, fill_in
from report_contents import read_contents
from scripted_turns import decisions

TEXTS = st.text(st.characters(exclude_categories=("Cs",))) | st.sampled_from(
    ["</script><script>alert(1)</script>", "<!--", "<script>", "{{data}}", "\u2028", "&lt;", "]]>"])


class Scripts(HTMLParser):
    """What a browser takes for the contents of script elements."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self._inside = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "script":
            self._inside = True
            self.found.append("")

    def handle_endtag(self, tag: str) -> None:
        self._inside = self._inside and tag != "script"

    def handle_data(self, data: str) -> None:
        if self._inside:
            self.found[-1] += data


@given(st.recursive(TEXTS | st.integers() | st.none(), lambda inner: st.lists(inner) | st.dictionaries(TEXTS, inner)))
def test_what_is_embedded_comes_back_and_ends_no_script(contents: object) -> None:
    text = embedded(contents)
    assert json.loads(text) == contents and "<" not in text
    page = Scripts()
    page.feed(f"<script>{text}</script><p>after</p>")
    page.close()
    assert page.found == [text] or text.strip() == ""


@given(st.dictionaries(st.sampled_from("abc"), TEXTS, min_size=3), st.permutations("abc"))
def test_what_is_filled_in_is_not_looked_at_again(parts: dict[str, str], order: list[str]) -> None:
    frame = "-".join(f"<{{{{{name}}}}}>" for name in order)
    assert fill_in(frame, parts) == "-".join(f"<{parts[name]}>" for name in order)


@given(st.integers(1, 900), st.integers(1, 900))
def test_a_picture_is_kept_in_its_proportions(width: int, height: int) -> None:
    out = BytesIO()
    Image.new("RGB", (width, height), (200, 120, 40)).save(out, "JPEG")
    data, size = shrink(out.getvalue())
    small = Image.open(BytesIO(base64.b64decode(data)))
    assert size == (width, height) and max(small.size) <= WIDTH_PX
    scale = max(small.size) / max(size)
    assert small.size == pytest.approx((width * scale, height * scale), abs=1.0)


@pytest.mark.parametrize("jpeg", [b"", b"no picture", b"\xff\xd8\xff\xe0" + b"\x00" * 40])
def test_what_is_no_picture_is_one_error(jpeg: bytes) -> None:
    with pytest.raises(BadInput, match="expected a picture of the camera as JPEG"):
        shrink(jpeg)


@pytest.mark.parametrize("argv", [["--out", "report.pdf"], ["--out", "nowhere/report.html"]])
def test_a_file_that_cannot_be_written_is_one_error(
    argv: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "journal.jsonl").write_text("".join(decision_line(d) + "\n" for d in decisions()))
    assert main(["report", "run", *argv]) == 2
    assert capsys.readouterr().err.startswith("harvey: --out")
    assert main(["report", "run"]) == 0
    page = (tmp_path / "run.html").read_text(encoding="utf-8")
    assert "failed in cycle 8" in page and read_contents(page)["plans"] == []  # a run without its head has no plan


@pytest.mark.parametrize("journal", [b"", b"\x00" * 100, b"{}\n", b"foreign\n"])
def test_what_is_no_journal_is_one_error(tmp_path: Path, journal: bytes, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "journal.jsonl").write_bytes(journal)
    assert main(["report", str(tmp_path), "--out", str(tmp_path / "report.html")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1 and not (tmp_path / "report.html").exists()
