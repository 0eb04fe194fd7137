"""How well a description fits what the model has: log odds, 0 for a fit.

People's words are not the model's: a chair may be called a sofa, a floor grey by one and stone by another. Who calls a
thing so once does it again, so each such meaning is paid for once in a text (``Senses``).
"""

from __future__ import annotations

import math

from harvey_words.lexicon import Word
from harvey_words.told_acts import ThingWords
from harvey_words.word_map import COLOUR_REACH, Area, NamedFeature, WordMap

NEUTRAL = frozenset(("long", "colored", "frame", "picture", "north", "south", "east", "west"))
"""Words by which things are hardly told apart, and points of the compass, which are no part of a thing."""
Senses = frozenset[tuple[str, str]]
"""Words with what this writer means by them."""
MISFIT, UNKNOWN_HEAD, RELATED, UNKNOWN_MODIFIER = -4.5, -2.0, -1.2, -0.8
"""A word of the model that does not fit; one that the model lacks; a kindred thing; a property that the model lacks."""
OTHER_KIND = -1.5
"""A kindred thing, where the building has the very thing too."""
INSIDE = -0.3
"""A hall that is called by what stands in it."""
OTHER_SENSE = -1.0
"""A word for one kind of thing that had another before."""
WORST = -7.0


class WordMatcher:
    """Fits descriptions to the features and areas of a map."""

    def __init__(self, plan: WordMap) -> None:
        self._plan = plan
        self._words: dict[tuple[str, str, int], tuple[float, str]] = {}

    def fit(self, what: ThingWords, feature: NamedFeature, senses: Senses) -> tuple[float, Senses]:
        """How well a feature fits the words of a description, and the senses with those that it takes."""
        score = 0.0
        if what.heads & {"door", "room"} and feature.sort != "door":
            score += MISFIT
        if what.heads & {"wall", "end"}:
            return WORST, senses
        for word in what.names:
            if word.meaning == "open":
                score += 0.0 if feature.is_open else MISFIT
            elif word.meaning == "closed":
                score += MISFIT if feature.is_open else 0.0
            else:
                own, senses = self._fit_word(word, feature.meanings, feature.colours, _kind(feature), senses,
                                             id(feature))
                score += own
        return max(score, WORST), senses

    def fit_area(self, what: ThingWords, area: Area, senses: Senses) -> tuple[float, Senses]:
        """How well a hall or room fits."""
        score = 0.0
        for word in what.names:
            own, taken = self._fit_word(word, area.meanings, area.colours, _kind(area), senses, id(area))
            if own < INSIDE and word.sort != "MOD":
                inside = (self._fit_word(word, one.meanings, one.colours, _kind(one), senses, id(one))
                          for one in area.features if one.sort == "thing")
                best = max(inside, key=lambda pair: pair[0], default=(WORST, senses))
                own, taken = max((own, taken), (best[0] + INSIDE, best[1]), key=lambda pair: pair[0])
            score, senses = score + own, taken
        return max(score, WORST), senses

    def _fit_word(self, word: Word, meanings: frozenset[str], colours: tuple[tuple[float, float, float], ...],
                  kind: str, senses: Senses, key: int) -> tuple[float, Senses]:
        known = (word.sort, word.meaning, key)
        if known not in self._words:
            self._words[known] = self._weigh(word, meanings, colours, kind)
        score, sense = self._words[known]
        if not sense or (word.meaning, sense) in senses:
            return (0.0 if sense else score), senses
        score += OTHER_SENSE * any(one == word.meaning for one, _ in senses)
        return score, senses | {(word.meaning, sense)}

    def _weigh(self, word: Word, meanings: frozenset[str], colours: tuple[tuple[float, float, float], ...],
               kind: str) -> tuple[float, str]:
        """The log odds, and the sense that the word takes where it is not the model's own."""
        lexicon = self._plan.lexicon
        if word.meaning in meanings or (word.meaning in NEUTRAL and word.meaning not in self._plan.vocabulary):
            return 0.0, ""
        if word.meaning in lexicon.colours and colours:
            off = min(math.dist(lexicon.colours[word.meaning], colour) for colour in colours)
            return max(MISFIT, -((off / COLOUR_REACH) ** 2)), kind if off > COLOUR_REACH else ""
        if any((word.meaning, meaning) in lexicon.related for meaning in meanings):
            return RELATED + OTHER_KIND * (word.meaning in self._plan.vocabulary), kind
        if word.meaning in self._plan.vocabulary:
            return MISFIT, ""
        return (UNKNOWN_MODIFIER if word.sort == "MOD" else UNKNOWN_HEAD), kind


def _kind(of: NamedFeature | Area) -> str:
    """What a sense is kept for: all things that are called the same."""
    return " ".join(sorted(of.meanings))
