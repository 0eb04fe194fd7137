"""Signs that the viewer's fonts have. A text with any other sign ends a viewer without a window."""

from __future__ import annotations

import string

VERIFIED, REFUTED, TROUBLE = "✔", "✗", "⚠"

LATIN = "".join(map(chr, (*range(0xA1, 0xAD), *range(0xAE, 0x180))))
GREEK_AND_CYRILLIC = "".join(map(chr, (*range(0x3B1, 0x3CA), 0x3A9, *range(0x410, 0x450))))
SIGNS = frozenset(
    string.printable[:-2] + LATIN + GREEK_AND_CYRILLIC + "–—‘’“”…→≤−●▶" + VERIFIED + REFUTED + TROUBLE)
"""What may be shown."""


def viewable(text: str) -> str:
    """The text with "?" in place of each sign that the viewer cannot show."""
    return text if text.isascii() else "".join(sign if sign in SIGNS else "?" for sign in text)
