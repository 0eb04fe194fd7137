"""A small Hearsay on the board alone: syllables are heard, words are guessed, and one sentence explains them all."""

from blackboard import History, Post, Posted, Scheduler, Watch, inference, observation, rule

WORDS = {"go": ("go",), "kitchen": ("kit", "chen"), "to": ("to",), "the": ("the",), "chent": ("chen", "to")}
GRAMMAR = ("go", "to", "the", "kitchen")


@observation
class Syllable:
    text: str
    at: int


@inference
class Word:
    text: str
    start: int
    end: int


@inference
class Sentence:
    text: str


@rule(on=Watch(Syllable, (Posted,)), writes=Word)
def word_guesser(view, trigger):
    """Guesses every word whose last syllable was just heard."""
    heard = {entry.value.at: entry for entry in view.all(Syllable)}
    end = trigger.entry.value.at + 1
    for text, syllables in WORDS.items():
        span = [heard.get(at) for at in range(end - len(syllables), end)]
        if [entry and entry.value.text for entry in span] == list(syllables):
            yield Post(Word(text, end - len(syllables), end), tuple(span))


def find_chain(view, trigger):
    """The words of the grammar in a row that end with the one that was just guessed; None where one is missing."""
    chain, end = [trigger.entry], trigger.entry.value.start
    for text in reversed(GRAMMAR[:-1]):
        before = view.latest(Word, lambda word, text=text, end=end: word.text == text and word.end == end)
        if before is None:
            return None
        chain, end = [before, *chain], before.value.start
    return chain


@rule(on=Watch(Word, (Posted,), lambda word: word.text == GRAMMAR[-1]), writes=Sentence, bind=find_chain, priority=0.9)
def parser(view, chain):
    """Finds the sentence of the grammar in the words, once it is whole."""
    yield Post(Sentence(" ".join(entry.value.text for entry in chain)), tuple(chain))


history = History()
scheduler = Scheduler([word_guesser, parser], sinks=[history])
for at, text in enumerate(("go", "to", "the", "kit", "chen")):
    scheduler.post([Post(Syllable(text, at))], "ear")
cycles = scheduler.run()

sentence = scheduler.view.latest(Sentence)
print(f"heard: {sentence.value.text if sentence else 'nothing that makes sense'}")
print(f"in {cycles} cycles; words guessed: {', '.join(word.value.text for word in scheduler.view.all(Word))}")
print(history.why("Sentence-1"))
