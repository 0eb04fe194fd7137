"""Explaining a run from its journal, in sentences that name their entries.

In reading order: ``phrases`` (the phrase book), ``model`` (locale frames, and the world's file), ``why`` (the story of
an entry), ``subjects`` (of a milestone or a part of the building), ``questions_in_words``, ``why_not`` (what
did not happen), ``web`` (the whole web of reasons), ``turning_points`` and ``story`` (a run in a page of text),
``diff`` (where two runs part).
"""
