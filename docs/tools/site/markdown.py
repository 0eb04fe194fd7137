"""Markdown from the code: escaped texts, tables, and what a dataclass says of its fields."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

SPECIAL = re.compile(r"([\\`*_\[\]<>|#$])")
ROLE = re.compile(r":(?:\w+:)+`~?([^`]*)`")
NAMES = r"[a-z]\w*(?:, [a-z]\w*)*"
FIELDS = re.compile(rf"(?:^|; )({NAMES}): ")


def escape(text: str) -> str:
    """A text that Markdown shows as it is."""
    return SPECIAL.sub(r"\\\1", " ".join(text.split()))


def prose(text: str) -> str:
    """A text of a docstring, whose double backquotes mark code, on one line."""
    text = ROLE.sub(lambda role: f"``{role[1].rpartition('.')[2]}``", " ".join(text.split()))
    parts = text.split("``")
    return "".join(f"`{part}`" if number % 2 else SPECIAL.sub(r"\\\1", part) for number, part in enumerate(parts))


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a table; the cells are Markdown already."""
    lines = [head, ["---"] * len(head), *rows]
    return ["", *(f"| {' | '.join(line)} |" for line in lines), ""]


def summary(kind: type[Any]) -> str:
    """The first paragraph of a class's docstring."""
    return prose((inspect.getdoc(kind) or "").split("\n\n")[0])


def describe_fields(kind: type[Any]) -> Mapping[str, str]:
    """What the ``Attributes`` in the docstrings of a class and its bases say of each field."""
    known: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        _, _, section = inspect.cleandoc(base.__dict__.get("__doc__") or "").partition("Attributes:\n")
        for item in re.split(r"\n    (?! )", "\n" + section.split("\n\n")[0]):
            pieces = FIELDS.split(" ".join(item.split()))[1:]
            for names, what in zip(pieces[::2], pieces[1::2], strict=True):
                known |= dict.fromkeys(names.split(", "), prose(what))
    return known
