"""From the words of a text to its clauses: a grammar over the classes of the words.

The tree of lark is the reading of the text by itself; what it means on a building is found by following it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

from lark import Lark, Token, Tree
from lark.lexer import Lexer

from harvey_words.reading.lexicon import Word
from harvey_words.reading.told_acts import COMPASS


class WordLexer(Lexer):
    """Hands the words on as tokens; made for lark, which calls it."""

    def __init__(self, lexer_conf: Any) -> None:
        """Nothing of lark's own lexer is used."""

    def lex(self, data: Sequence[Word], parser_state: Any = None) -> Iterator[Token]:  # type: ignore[override]
        """A token a word, with the word as its value."""
        for word in data:
            sort = word.sort
            if sort == "HEAD" and word.meaning == "side":
                sort = "SIDE"
            elif sort == "PREP" and word.meaning == "of":
                sort = "OF"
            token = Token(sort, word.text)
            token.value = word
            yield token


STARTS = frozenset(
    ("go", "turn", "take", "face", "reach", "enter", "through", "exit", "pass", "halt", "stand", "there"))
"""Verbs with which another clause begins, also where nothing stands between."""
NOUNS = frozenset(("HEAD", "THING", "MOD", "NAME", "STRANGE", "COUNT"))
MOST_BETWEEN = 6
"""Words between the two that are joined by ``and``."""


@cache
def parser() -> Lark:
    """The parser of the grammar."""
    grammar = Path(__file__).with_name("grammar.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr", lexer=WordLexer)


@dataclass(frozen=True)
class Part:
    """A verb, a way (left, right, ahead), a thing, or where: a preposition with what follows.

    Attributes:
        sort: ``verb``, ``way``, ``thing``, ``where``, ``not``, ``sep``.
        meaning: of the verb, way or preposition.
        words: those of the thing.
        side: what stands for a thing: left, right, ahead.
    """

    sort: str
    meaning: str = ""
    words: tuple[Word, ...] = ()
    side: str = ""


@dataclass
class Clause:
    """The parts of a clause, with the word that ends it: ``dot``, ``comma``, ``then``, ``when``, ..., or nothing."""

    parts: list[Part] = field(default_factory=list)
    end: str = ""


def read_clauses(words: Sequence[Word]) -> tuple[Tree[Any], list[Clause]]:
    """The tree of a text, and its clauses."""
    kept = list(_mend(words))
    tree = parser().parse(kept)
    clauses: list[Clause] = []
    for node in tree.children:
        assert isinstance(node, Tree)
        clause = Clause()
        for child in node.children:
            part = _read_part(child)
            if part.sort == "sep":
                clause.end = part.meaning
            elif part.meaning == "be" and clause.parts[-1:] and clause.parts[-1].sort == "thing" and any(
                    one.meaning == "exit" for one in clause.parts):
                thing = clause.parts.pop()  # "when you come out of the lab the office is on the left"
                clauses.append(clause)
                clause = Clause([thing, part])
            elif part.meaning in STARTS and part.sort == "verb" and not (  # "your back faces the wall" is no turn
                    part.meaning == "face" and [one.meaning for one in clause.parts[-1:]] == ["back"]) and any(
                    one.sort in ("thing", "where", "way") or one.meaning == "exit" for one in clause.parts):
                clauses.append(clause)
                clause = Clause([part])
            else:
                clause.parts.append(part)
        clauses += _split_turns(clause)
    return tree, clauses


def _split_turns(clause: Clause) -> Iterator[Clause]:
    """``The wood hall one block left one block right one block``: each turn begins a clause."""
    turns = [at for at, part in enumerate(clause.parts) if part.sort == "way" and part.meaning in ("left", "right")]
    cuts = [at for at in turns if at] if len(turns) > 1 else []
    for begin, end in pairwise((0, *cuts, len(clause.parts))):
        yield Clause(clause.parts[begin:end], clause.end if end == len(clause.parts) else "")


def _mend(words: Sequence[Word]) -> Iterator[Word]:
    """Leave out what the grammar has no place for, and join what is one description.

    ``Between A and B`` is one, so is ``where A and B meet``, and ``the corner with the chair``.
    """
    words = _join_meetings(words)
    pair = 0
    for index, word in enumerate(words):
        before = words[index - 1] if index else None
        after = words[index + 1] if index + 1 < len(words) else None
        is_joint = bool(before and after and before.sort in NOUNS and after.sort in NOUNS)
        if word.sort == "NOT" and after is not None and after.meaning == "open":
            continue
        if word.meaning == "open" and before and before.sort == "NOT":
            word = Word("MOD", "closed", word.text, word.place)
        if "one-after" in word.roles and before and before.sort not in ("SEP", "VERB"):
            yield from (Word("SEP", "comma", "", word.place), Word("VERB", "enter", "", word.place))
        if "whose" in word.roles and before and before.sort == "PREP":
            continue
        if "after-that" in word.roles and before and before.sort in NOUNS and (after is None or after.meaning == "dot"):
            yield from (Word("PREP", "past", "after", word.place), Word("HEAD", "it", "that", word.place))
            continue
        if "once" in word.roles and (after is None or after.sort == "SEP" or (
                before and before.meaning in ("go", "ahead"))):
            yield Word("COUNT", "1", word.text, word.place)
        elif word.meaning in COMPASS and after is not None and after.sort == "HEAD":
            yield Word("NAME", word.meaning, word.text, word.place)
        elif word.meaning == "and" and index < pair and after is not None and after.sort in NOUNS:
            pair = 0
            yield Word("NAME", "&", word.text, word.place)
        elif word.meaning == "past" and after is not None and after.meaning == "on" and any(
                one.meaning == "side" for one in words[index + 3:index + 4]):
            yield from (word, Word("HEAD", "it", "", word.place))  # "the one after, on the same side"
        elif word.meaning == "of" and word.sort == "PREP":
            if is_joint and before and before.meaning == "side":
                yield Word("PREP", "in", word.text, word.place)  # "on the left side of the hall"
            elif is_joint:
                pair = index + MOST_BETWEEN if before and before.meaning in ("crossing", "corner") else pair
                yield word
        elif before and before.sort in NOUNS and (
                "far" in word.roles or (before.meaning == "unit" and word.sort in NOUNS)):
            yield from (Word("SEP", "comma", "", word.place), word)  # "two blocks chair", "the hall all the way down"
        elif "has" in word.roles and is_joint:
            yield from (Word("SEP", "comma", "", word.place), Word("VERB", "there", word.text, word.place))
        elif word.meaning == "with" and is_joint and before and before.sort in ("HEAD", "MOD"):
            pair = index + MOST_BETWEEN if before and before.meaning in ("crossing", "corner") else pair
            yield Word("PREP", "of", word.text, word.place)
        elif "where" in word.roles and word.sort == "VERB" and (after is None or after.sort in ("VERB", "SEP") or (
                before and (before.sort == "PREP" or before.meaning == "reach"))):
            continue
        else:
            if word.meaning == "between":
                pair = index + MOST_BETWEEN
            yield word


def _join_meetings(words: Sequence[Word]) -> list[Word]:
    """``Where the grass meets the bricks`` and ``where A and B come together`` are crossings."""
    joined = list(words)
    for index, word in enumerate(words):
        if word.sort != "VERB" or word.meaning != "meet":
            continue
        begin = next((back for back in range(index - 1, max(index - 10, -1), -1)
                      if "where" in words[back].roles or words[back].meaning == "dot"), 0)
        if "where" not in words[begin].roles:
            continue
        for place in range(begin + 1, index + 1):
            if joined[place].meaning in ("and", "meet"):
                joined[place] = Word("PREP", "of", joined[place].text, joined[place].place)
        joined[begin] = Word("HEAD", "crossing", "where", word.place)
    return joined


def _read_part(node: Any) -> Part:
    """A part from its branch of the tree."""
    words = tuple(_words_of(node))
    first = words[0]
    if node.data == "where":
        preps = [word for word in words if word.sort == "PREP"]
        inner = next((child for child in node.children if isinstance(child, Tree)), None)
        if inner is not None and inner.data == "side":
            return Part("where", preps[-1].meaning, (), next(iter(_words_of(inner))).meaning)
        things = tuple(_words_of(inner)) if inner is not None else ()
        strong = [prep.meaning for prep in preps if prep.meaning not in ("along", "at", "on", "in")]
        return Part("where", (strong or [preps[-1].meaning])[0], things)
    if node.data == "thing":
        return Part("thing", "", words)
    return Part(str(node.data), first.meaning, words)


def _words_of(node: Any) -> Iterator[Word]:
    for token in node.scan_values(lambda value: isinstance(value, Token)):
        if token.value.meaning != "of":
            yield token.value
