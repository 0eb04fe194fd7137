"""How well a description fits what the model has: log odds, 0 for a fit.

People's words are not the model's: a chair may be called a sofa, a floor grey by one and stone by another.
"""

from __future__ import annotations

import math

from harvey_words.lexicon import Word
from harvey_words.told_acts import ThingWords
from harvey_words.word_map import COLOUR_REACH, Area, NamedFeature, WordMap

NEUTRAL = frozenset(("long", "colored", "frame", "picture", "north", "south", "east", "west"))
"""Words by which things are hardly told apart, and points of the compass, which are no part of a thing."""
MISFIT, UNKNOWN_HEAD, RELATED, UNKNOWN_MODIFIER = -4.5, -2.0, -1.2, -0.8
"""A word of the model that does not fit; one that the model lacks; a kindred thing; a property that the model lacks."""
OTHER_KIND = -1.5
"""A kindred thing, where the building has the very thing too."""
INSIDE = -0.3
"""A hall that is called by what stands in it."""
WORST = -7.0


class WordMatcher:
    """Fits descriptions to the features and areas of a map."""

    def __init__(self, plan: WordMap) -> None:
        self._plan = plan
        self._words: dict[tuple[str, str, int], float] = {}

    def fit(self, what: ThingWords, feature: NamedFeature) -> float:
        """How well a feature fits the words of a description."""
        if what.heads & {"wall", "end"}:
            return WORST
        score = MISFIT if what.heads & {"door", "room"} and feature.sort != "door" else 0.0
        for word in what.names:
            if word.meaning in ("open", "closed"):
                score += 0.0 if feature.is_open == (word.meaning == "open") else MISFIT
            else:
                score += self._fit_word(word, feature)
        return max(score, WORST)

    def fit_area(self, what: ThingWords, area: Area) -> float:
        """How well a hall or room fits."""
        score = 0.0
        for word in what.names:
            own = self._fit_word(word, area)
            if own < INSIDE and word.sort != "MOD":
                own = max([own, *(self._fit_word(word, one) + INSIDE for one in area.features if one.sort == "thing")])
            score += own
        return max(score, WORST)

    def _fit_word(self, word: Word, of: NamedFeature | Area) -> float:
        known = (word.sort, word.meaning, id(of))
        if known not in self._words:
            self._words[known] = self._weigh(word, of.meanings, of.colours)
        return self._words[known]

    def _weigh(self, word: Word, meanings: frozenset[str], colours: tuple[tuple[float, float, float], ...]) -> float:
        lexicon, vocabulary = self._plan.lexicon, self._plan.vocabulary
        if word.meaning in meanings or (word.meaning in NEUTRAL and word.meaning not in vocabulary):
            return 0.0
        if word.meaning in lexicon.colours and colours:
            off = min(math.dist(lexicon.colours[word.meaning], colour) for colour in colours)
            return max(MISFIT, -((off / COLOUR_REACH) ** 2))
        if any((word.meaning, meaning) in lexicon.related for meaning in meanings):
            return RELATED + OTHER_KIND * (word.meaning in vocabulary)
        if word.meaning in vocabulary:
            return MISFIT
        return UNKNOWN_MODIFIER if word.sort == "MOD" else UNKNOWN_HEAD
