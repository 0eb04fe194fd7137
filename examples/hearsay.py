"""A small Hearsay on the board alone: syllables are heard, words are guessed, and one sentence explains them all."""

from collections.abc import Iterable
from dataclasses import dataclass

import harvey
from harvey import Change, Effect, Entry, Level, Post, Posted, View, Watch

WORDS = {"go": ("go",), "kitchen": ("kit", "chen"), "to": ("to",), "the": ("the",), "chent": ("chen", "to")}
GRAMMAR = ("go", "to", "the", "kitchen")


@harvey.observation()
@dataclass(frozen=True)
class Syllable:
    text: str
    at: int


@harvey.inference()
@dataclass(frozen=True)
class Word:
    text: str
    start: int
    end: int


@harvey.inference()
@dataclass(frozen=True)
class Sentence:
    text: str


class WordGuesser(harvey.KnowledgeSource):
    """Guesses every word whose last syllable was just heard."""

    level = Level.PLAN
    on = (Watch(Syllable, (Posted,)),)
    writes = (Word,)

    def act(self, view: View, trigger: Change) -> Iterable[Effect]:
        heard = {entry.value.at: entry for entry in view.all(Syllable)}
        end = trigger.entry.value.at + 1
        for text, syllables in WORDS.items():
            span = [heard.get(at) for at in range(end - len(syllables), end)]
            if [entry and entry.value.text for entry in span] == list(syllables):
                yield Post(Word(text, end - len(syllables), end), tuple(span))


class Parser(harvey.KnowledgeSource):
    """Finds the sentence of the grammar in the words, once it is whole."""

    level = Level.GOAL
    on = (Watch(Word, (Posted,), lambda word: word.text == GRAMMAR[-1]),)
    priority = 0.9
    writes = (Sentence,)

    def bind(self, view: View, trigger: Change) -> list[Entry[Word]] | None:
        chain, end = [trigger.entry], trigger.entry.value.start
        for text in reversed(GRAMMAR[:-1]):
            before = view.latest(Word, lambda word, text=text, end=end: word.text == text and word.end == end)
            if before is None:
                return None
            chain, end = [before, *chain], before.value.start
        return chain

    def act(self, view: View, case: list[Entry[Word]]) -> Iterable[Effect]:
        yield Post(Sentence(" ".join(entry.value.text for entry in case)), tuple(case))


decisions: list[harvey.Decision] = []
scheduler = harvey.Scheduler([WordGuesser(), Parser()], sinks=[decisions.append])
for at, text in enumerate(("go", "to", "the", "kit", "chen")):
    scheduler.post([Post(Syllable(text, at))], "ear")
while scheduler.step():
    pass

sentence = scheduler.view.latest(Sentence)
print(f"heard: {sentence.value.text if sentence else 'nothing that makes sense'}")
print(f"because of {', '.join(map(str, sentence.because)) if sentence else 'nothing'}")
print(f"in {len(decisions)} cycles; words guessed: {', '.join(word.value.text for word in scheduler.view.all(Word))}")
