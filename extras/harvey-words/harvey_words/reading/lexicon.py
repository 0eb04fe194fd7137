"""The words of people who tell a way: their classes and meanings, and which word a misspelt one is.

The file of the language is ``lexicon.toml``; the model of a building adds what it names.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from harvey.errors import BadInput

CLASSES = ("VERB", "WAY", "PREP", "SEP", "NOT", "COUNT", "HEAD", "THING", "MOD")
LONGEST = 5
"""Words of the longest phrase."""
MOST_WORDS = 300
"""What comes after so many words of a text is not read: a way told by a person has some tens."""
SHORT, LONG = 4, 8
"""Letters of a word that may have one wrong, and two."""
OWN_FILE = Path(__file__).with_name("lexicon.toml")


class LexiconError(BadInput):
    """A file of a language that cannot be used."""


@dataclass(frozen=True, slots=True)
class Word:
    """A word or phrase of a text that means something for the way.

    Attributes:
        sort: its class in the lexicon, ``NAME`` for what only the model knows, ``STRANGE`` for what nobody does.
        meaning: the lexicon's or the model's word for it.
        text: as it stands in the text.
        place: number of its first word in the text.
        roles: what it does for the words beside it.
    """

    sort: str
    meaning: str
    text: str
    place: int
    roles: frozenset[str] = frozenset()


class Lexicon:
    """The words of a language, with the names of one building."""

    def __init__(self, data: Mapping[str, Any], named: Iterable[Collection[str]] = ()) -> None:
        """``named``: of each thing of the building, the words by which it is named there."""
        called = {frozenset(words) for words in named}
        names = frozenset[str]().union(*called)
        self.phrases: dict[tuple[str, ...], tuple[str, str]] = {
            tuple(phrase.split()): (sort, meaning)
            for sort in CLASSES for meaning, phrases in data[sort].items() for phrase in phrases}
        self.phrases |= {(colour,): ("MOD", colour) for colour in data["COLOURS"]}
        self.skipped = frozenset(tuple(text.split()) for text in data["SKIP"]["words"])
        self.colours: Mapping[str, tuple[float, float, float]] = {
            name: (rgb[0], rgb[1], rgb[2]) for name, rgb in data["COLOURS"].items()}
        groups: list[list[str]] = list(data["RELATED"].values())
        self.related = frozenset((one, other) for group in groups for one in group for other in group if one != other)
        self._tell_apart(data, called, names)
        self.names = frozenset(name for name in names if not name.isdigit() and (name,) not in self.phrases)
        self.names -= {word for (word, *more) in self.skipped if not more}
        self._roles = data["ROLES"]
        self._rewrites = data["SPLIT"]["rows"]
        self._nearest: dict[str, str] = {}

    def _tell_apart(self, data: Mapping[str, Any], called: Iterable[frozenset[str]], names: frozenset[str]) -> None:
        """Two words of one meaning that the building has for different things mean each its own there."""
        for sort in ("THING", "MOD"):
            for meaning, phrases in data[sort].items():
                own = names.intersection(phrases)
                if len(own) > 1 and all(len(words & own) < 2 for words in called):
                    self.phrases |= {(word,): (sort, word) for word in own}
                    kindred = own | {meaning}
                    self.related |= {(one, other) for one in kindred for other in kindred if one != other}

    @cached_property
    def _spellings(self) -> dict[int, list[str]]:
        """All single words of four letters and more, by length."""
        known: dict[int, list[str]] = {}
        for word in sorted(self._words):
            if len(word) >= SHORT - 1 and word.isalpha():
                known.setdefault(len(word), []).append(word)
        return known

    @cached_property
    def _words(self) -> frozenset[str]:
        return frozenset(word for phrase in (*self.phrases, *self.skipped) for word in phrase) | self.names

    def read(self, text: str) -> list[Word]:
        """The words of a text that mean something, in order; chatter is left out."""
        pieces = split_text(text, self._rewrites)
        corrected = [piece if piece in self._words else self.nearest(piece) for piece in pieces]
        found: list[Word] = []
        place = 0
        while place < len(pieces):
            length, sort, meaning = self._longest(corrected, place)
            own = pieces[place:place + length]
            if self._says_nothing(corrected, place, sort, meaning):
                sort = ""
            if sort == "STRANGE" and (place == 0 or pieces[place - 1] not in self._roles["article"]):
                sort = ""
            if sort:
                said = " ".join(own)
                roles = frozenset(role for role, words in self._roles.items() if said in words)
                found.append(Word(sort, meaning, said, place, roles))
            place += length
        return found

    def _says_nothing(self, pieces: Sequence[str], place: int, sort: str, meaning: str) -> bool:
        """Whether a word only stands for another, or is of a name: ``the blue one``, ``position 2``, ``this hall``."""
        before, roles = pieces[place - 1] if place else "", self._roles
        if sort == "COUNT":
            return before in roles["naming"] or (pieces[place] in roles["one"] and (
                before in roles["pointing"] or self._sort(before) in ("COUNT", "MOD")))
        if meaning != "it":
            return False
        is_apart = place + 1 == len(pieces) or pieces[place] in roles["pronoun"]
        after = "" if is_apart else self._longest(pieces, place + 1)[1]
        return after in ("HEAD", "THING", "MOD", "COUNT") or not (
            self._sort(before) == "PREP" or before in roles["taking"])

    def _sort(self, piece: str) -> str:
        """The class of a single word; '' of chatter."""
        return self.phrases.get((piece,), ("",))[0]

    def _longest(self, pieces: Sequence[str], place: int) -> tuple[int, str, str]:
        """Words of the longest phrase that begins here, its class ('' for chatter) and meaning."""
        for length in range(min(LONGEST, len(pieces) - place), 0, -1):
            phrase = tuple(pieces[place:place + length])
            if phrase in self.phrases:
                return length, *self.phrases[phrase]
            if phrase in self.skipped:
                return length, "", ""
        word = pieces[place]
        if word in self.names:
            return 1, "NAME", word
        return 1, "STRANGE", word

    def meaning(self, word: str) -> str:
        """The lexicon's word for a single word of the model."""
        found = self.phrases.get((word,))
        return found[1] if found and found[0] in ("THING", "MOD", "HEAD") else word

    def meanings(self, text: str) -> frozenset[str]:
        """What the words of a name or a description in the model mean, phrases before single words."""
        split = split_text(text, self._rewrites)
        pieces = [piece for piece in split if piece not in (".", ",") and not piece.isdigit()]
        found: set[str] = set()
        place = 0
        while place < len(pieces):
            length = next((n for n in range(min(LONGEST, len(pieces) - place), 1, -1)
                           if self.phrases.get(tuple(pieces[place:place + n]), ("",))[0] in ("THING", "MOD")), 1)
            own = pieces[place:place + length]
            found |= {self.phrases[tuple(own)][1]} if length > 1 else {self.meaning(own[0])}
            found |= {self.meaning(word) for word in own}
            place += length
        return frozenset(found)

    def nearest(self, word: str) -> str:
        """The known word that a misspelt one is, where exactly one is nearest; else itself."""
        if word not in self._nearest:
            self._nearest[word] = self._find_nearest(word) if word.isalpha() else word
        return self._nearest[word]

    def _find_nearest(self, word: str) -> str:
        if not SHORT - 1 <= len(word) <= 20:
            return word
        most = 2 if len(word) >= LONG - 1 else 1
        likely = {known for phrase, (sort, _) in self.phrases.items() if sort != "SEP" for known in phrase}
        lengths = range(len(word) - most, len(word) + most + 1)
        near = [(distance, known[0] != word[0], known not in likely, known)
                for length in lengths for known in self._spellings.get(length, ())
                if (distance := edit_distance(word, known, most)) <= most]
        if not near or (len(word) < SHORT and min(near)[1]):
            return word
        return min(near)[-1]


def split_text(text: str, rewrites: Iterable[tuple[str, str]] = ()) -> list[str]:
    """The words of a text in small letters, full stops and commas; at most ``MOST_WORDS``."""
    plain = text[:40 * MOST_WORDS].lower().replace("’", "'")
    for pattern, instead in ((" -+ |--+|[–—]", " , "), *rewrites):
        plain = re.sub(pattern, instead, plain)
    pieces = re.findall(r"[^\W\d_]+|\d+(?:st|nd|rd|th)?|[.,;:!?\n]", plain)[:MOST_WORDS]
    return [{";": ".", ":": ",", "!": ".", "?": ".", "\n": "."}.get(piece, piece) for piece in pieces]


def edit_distance(one: str, other: str, most: int) -> int:
    """Letters to change, add, leave out or swap with the next; more than ``most`` is not counted further."""
    before: list[int] = []
    last = list(range(len(other) + 1))
    for i, letter in enumerate(one, 1):
        row = [i]
        for j, wanted in enumerate(other, 1):
            cost = min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (letter != wanted))
            if i > 1 and j > 1 and letter == other[j - 2] and one[i - 2] == wanted:
                cost = min(cost, before[j - 2] + 1)
            row.append(cost)
        if min(row) > most:
            return most + 1
        before, last = last, row
    return last[-1]


@cache
def lexicon_data(path: str | Path = OWN_FILE) -> Mapping[str, Any]:
    """The file of a language. Raises LexiconError, naming the file."""
    try:
        data = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        Lexicon(data)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise LexiconError(f"{path}: expected a lexicon in the form of {OWN_FILE.name}, got {error!r}") from error
    return data
