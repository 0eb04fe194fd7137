"""What a text asks to do, before the building is asked: steps with words for places (``task_lexicon.toml``).

A text is clauses, each with a verb; "then" and full stops put them in order, "and" between places leaves it open.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from harvey_words.reading.lexicon import Lexicon, lexicon_data
from harvey_words.tasks.task_entries import Step

START, HOME = "start", "home of"  # for words of a place: where it was told, and where the model says a thing is kept
MOST_WORDS, MOST_STEPS, LONGEST = 200, 40, 6
SORTS = ("VERB", "WORD", "TIMES", "NUMBER", "UNIT")
PIECES = re.compile(r"\d+(?:\.\d+)?|[^\W\d_][\w'-]*|[.,;:!?\n]")
WAYS = frozenset((
    *(("VERB", verb) for verb in ("turn", "exit", "pass")),
    *(("WAY", way) for way in ("left", "right", "ahead")),
    *(("HEAD", head) for head in ("crossing", "corner", "end", "unit", "turning"))))
STOPS = {";": ".", ":": ",", "!": ".", "?": ".", "\n": "."}


class TaskWordsError(ValueError):
    """A text that asks for nothing that is known: names the words, and what was expected."""


class Token(NamedTuple):
    """A word or phrase: its class in the lexicon, ``NAME`` for a place's or a thing's, its meaning, where it stands."""

    sort: str
    meaning: str
    text: str
    span: tuple[int, int] = (0, 0)


@cache
def task_lexicon() -> Mapping[str, Any]:
    """The file of the language."""
    return tomllib.loads(Path(__file__).with_name("task_lexicon.toml").read_text(encoding="utf-8"))


@cache
def _phrases() -> Mapping[tuple[str, ...], tuple[str, str]]:
    return {tuple(phrase.split()): (sort, meaning) for sort in reversed(SORTS)
            for meaning, phrases in task_lexicon()[sort].items() for phrase in phrases}


def read_tokens(text: str) -> list[Token]:
    """The words of a text with their classes; chatter is left out. Raises TaskWordsError where it is too long."""
    matches = list(PIECES.finditer(text.lower().replace("’", "'")))
    pieces = [STOPS.get(match.group(), match.group()) for match in matches]
    if len(pieces) > MOST_WORDS:
        raise TaskWordsError(f"expected at most {MOST_WORDS} words, got {len(pieces)}")
    known, found, place = _phrases(), list[Token](), 0
    while place < len(pieces):
        length = next((n for n in range(LONGEST, 0, -1) if tuple(pieces[place:place + n]) in known), 1)
        words = pieces[place:place + length]
        sort, meaning = known.get(tuple(words), ("NUMBER" if words[0][0].isdigit() else "NAME", words[0]))
        span = matches[place].start(), matches[place + len(words) - 1].end()
        found.append(Token(sort, meaning, " ".join(words), span))
        place += length
    return [token for token in found if token.meaning != "skip"]


def tells_way(text: str) -> bool:
    """Whether some words tell a way: by a turn, a mark that is passed, a door that is counted."""
    words = _way_lexicon().read(text)
    counts = any(word.sort == "COUNT" for word in words)
    return any((word.sort, word.meaning) in WAYS or (counts and word.meaning == "door") for word in words)


def _is_passage(text: str) -> bool:
    """Whether what is to be taken is a door or a hall."""
    nouns = [word.meaning for word in _way_lexicon().read(text) if word.sort in ("HEAD", "THING", "STRANGE")]
    return nouns[:1] in (["door"], ["hall"])


@cache
def _way_lexicon() -> Lexicon:
    return Lexicon(lexicon_data())


def is_word_to_go_on(text: str) -> bool:
    """Whether somebody says that what the robot waits for is done."""
    return len(text) < MOST_WORDS and {token.meaning for token in read_tokens(text)} - {"dot", "comma"} == {"done"}


def read_wanted(text: str) -> tuple[Step, ...]:
    """What a text asks for. Raises TaskWordsError, naming the words that were not understood."""
    reader = _ClauseReader(text)
    for clause in _split(read_tokens(text)):
        reader.read(clause)
    if reader.is_awaited:
        raise TaskWordsError("expected where to go instead if the door is shut, got nothing")
    if not 0 < len(reader.wanted) <= MOST_STEPS:
        raise TaskWordsError(f"expected 1 to {MOST_STEPS} things to do, as 'Go to ROOM', got {len(reader.wanted)}")
    return tuple(reader.wanted)


def _split(tokens: Sequence[Token]) -> list[list[Token]]:
    """Clauses: at full stops and "then", and at commas and "and" before a verb or a condition."""
    clauses: list[list[Token]] = [[]]
    for token, ahead in pairwise((*tokens, Token("", "", ""))):
        begins = ahead.sort == "VERB" or ahead.meaning in ("if", "instead")
        if token.meaning in ("dot", "then") or (token.meaning in ("comma", "and") and begins):
            clauses.append([])
        elif token.meaning == "if":
            clauses.append([token])
        else:
            clauses[-1].append(token)
    return [clause for clause in clauses if any(token.meaning not in ("comma", "and") for token in clause)]


@dataclass
class _ClauseReader:
    """Reads one clause after the other; knows what "it" is, and whether a condition waits for its "instead"."""

    text: str
    wanted: list[Step] = field(default_factory=list)
    is_awaited: bool = False
    thing: str = "it"
    groups: int = 0
    verb: str = ""
    way_from: int = 0

    def read(self, clause: Sequence[Token]) -> None:
        """Adds what is wanted with this clause too: a task, or a way, which goes on with what is said of going."""
        first, (begin, _), (_, end) = clause[0], clause[0].span, clause[-1].span
        goes = first.meaning == "go" or first.text == "take" or (first.sort != "VERB" and first.meaning != "if")
        said = self.text[begin:end]
        if goes and self.wanted and self.wanted[-1].is_told:
            self.wanted[-1] = replace(self.wanted[-1], phrase=self.text[self.way_from:end])
        elif (goes and tells_way(said)) or (first.text == "take" and _is_passage(said)):
            self.way_from = begin
            self.wanted.append(Step("ptrans", said, is_told=True))
        else:
            self.add(clause)

    def add(self, clause: Sequence[Token]) -> None:
        """Adds what is wanted with this clause too. Raises TaskWordsError."""
        is_instead = self.is_awaited or any(token.meaning == "instead" for token in clause)
        clause = [token for token in clause if token.meaning != "instead"]
        if clause and clause[0].meaning == "if":
            self._read_condition(clause[1:])
            return
        self.verb, rest = self._find_verb(clause)
        parts = _Parts(" ".join(token.text for token in rest)).read(rest)
        if (parts.seconds and self.verb != "wait") or (parts.rounds and self.verb not in ("go", "patrol")):
            raise TaskWordsError(f"expected a time with 'within' or 'wait', and times to go, got {parts.text!r}")
        if is_instead:
            places = parts.places or [START] * (self.verb == "return")
            if self.verb not in ("go", "return") or len(places) != 1:
                raise TaskWordsError(f"expected one place to go to instead, got {parts.text!r}")
            self.wanted[-1:] = [replace(self._last_place(), other=places[0])]
            self.is_awaited = False
            return
        more = [replace(one, due_s=parts.within_s) for one in self._list_steps(parts)]
        if self._goes_elsewhere(more):
            self.wanted.pop()
        self.wanted += more

    def _find_verb(self, clause: Sequence[Token]) -> tuple[str, Sequence[Token]]:
        """The verb, also misspelt, or that of the clause before, and what comes after it."""
        first = clause[0] if clause else Token("", "", "")
        if first.sort == "VERB":
            return first.meaning, clause[1:]
        verbs = {phrase[0]: verb for phrase, (sort, verb) in _phrases().items() if sort == "VERB" and len(phrase) == 1}
        if first.sort == "NAME" and (near := get_close_matches(first.text, sorted(verbs), 1, 0.8)):
            return verbs[near[0]], clause[1:]
        if first.text and (self.verb == "go" or (not self.verb and first.meaning == "to")):
            return "go", clause
        likely = get_close_matches(first.text, sorted(verbs), 3, 0.3) or ("go", "fetch", "bring")
        raise TaskWordsError(f"expected something to do, as {', '.join(likely)}, got {first.text!r}")

    def _last_place(self) -> Step:
        if not self.wanted or self.wanted[-1].act != "ptrans":
            raise TaskWordsError("expected where to go before what to do if a door is shut")
        return self.wanted[-1]

    def _read_condition(self, clause: Sequence[Token]) -> None:
        place, said = self._last_place().phrase, " ".join(token.text for token in clause)
        end = next((number for number, token in enumerate(clause) if token.meaning == "shut"), len(clause))
        words = {token.text for token in clause[:end] if token.meaning not in ("door", "it", "every")}
        if end == len(clause) or not words <= {"of", "to", "door", *place.split()}:
            raise TaskWordsError(f"expected 'if the door of {place} is shut', got {said!r}")
        self.is_awaited = True
        if rest := [token for token in clause[end + 1:] if token.meaning not in ("comma", "and")]:
            self.add(rest)

    def _goes_elsewhere(self, more: Sequence[Step]) -> bool:
        """Whether what was fetched to the start is, with these steps, brought where the text says."""
        if len(self.wanted) < 2 or self.wanted[-2].act != "grasp" or self.wanted[-1].phrase != START:
            return False
        return more[-1].what == self.wanted[-2].what or [one.phrase for one in more] == [START]

    def _list_steps(self, parts: _Parts) -> list[Step]:
        if self.verb in ("fetch", "bring"):
            return self._carry(parts)
        if self.verb in ("wait", "return"):
            places = [Step("ptrans", place) for place in parts.places or [START] * (self.verb == "return")]
            return [*places, Step("attend", wait_s=parts.seconds)] if self.verb == "wait" else places
        if not parts.places:
            raise TaskWordsError(f"expected a place to go to, got {parts.text!r}")
        if self.verb == "patrol" and not parts.rounds:
            raise TaskWordsError(f"expected how often, as 'twice' or '3 times', got {parts.text!r}")
        steps = [Step("ptrans", place) for place in (*parts.origins, *parts.via)]
        is_any = len(parts.places) > 1 and self.verb == "go" and not parts.in_order
        for _ in range(parts.rounds or 1):
            self.groups += is_any
            steps += [Step("ptrans", place, group=self.groups * is_any) for place in parts.places]
        return steps

    def _carry(self, parts: _Parts) -> list[Step]:
        """To fetch is to bring to the start. What is "it" is on the robot already, unless the text says from where."""
        thing, to = parts.thing, parts.recipient
        if self.verb == "bring" and parts.is_it and to in ("", thing):
            thing, to = "", thing
        if not (to or self.verb == "fetch") or not (thing or parts.is_it):
            raise TaskWordsError(f"expected what to {self.verb}, and where to, got {parts.text!r}")
        self.thing = what = thing or self.thing
        load = [Step("ptrans", parts.origins[0] if parts.origins else HOME, what), Step("grasp", what=what)]
        hand_over = [Step("atrans", what=what)] if to not in ("", START) else []
        return [*(load if thing or parts.origins else ()), Step("ptrans", to or START), *hand_over]


@dataclass
class _Parts:
    """The parts of a clause after its verb."""

    text: str
    places: list[str] = field(default_factory=list)
    origins: list[str] = field(default_factory=list)
    via: list[str] = field(default_factory=list)
    thing: str = ""
    recipient: str = ""
    is_it: bool = False
    seconds: float = 0.0
    within_s: float = 0.0
    rounds: int = 0
    in_order: bool = False

    def read(self, tokens: Sequence[Token]) -> _Parts:
        """Sorts the words of a clause by what stands before them."""
        role, words, number = "", list[str](), 1.0
        for token in (*tokens, Token("", "end", "")):
            if token.sort == "NAME" or (token.text in ("in", "on", "of") and words) or (token.sort == "VERB" and words):
                words.append(token.text)
                continue
            if token.sort == "NUMBER":
                number = float(token.meaning) * number
                continue
            if words:
                self._name(role, " ".join(words))
                words = []
            if token.sort == "UNIT":
                name = "within_s" if role == "within" else "seconds"
                setattr(self, name, number * float(token.meaning))
            elif token.sort == "TIMES":
                self.rounds = int(token.meaning)
            elif token.meaning in ("me", "return"):
                self.recipient = START
                self.places += [START] * (token.meaning == "me" and role != "for")
            self.is_it, self.in_order = self.is_it or token.meaning == "it", self.in_order or token.meaning == "order"
            role = role if token.meaning == "every" else token.meaning
        return self

    def _name(self, role: str, phrase: str) -> None:
        {"from": self.origins, "via": self.via, "for": []}.get(role, self.places).append(phrase)
        if role in ("to", "for"):
            self.recipient = phrase
        elif role not in ("from", "via"):
            self.thing, self.recipient = phrase, self.recipient or self.thing
