"""Explaining a run from its journal, in sentences that name their entries.

All that is said is a ``Sentence`` (text, entries, cycle), and what belongs together is a ``Story`` of them. In reading
order: ``phrases`` (both, and the phrase book), ``model`` (locale frames, and the world's file), ``why`` (the story of
an entry), ``subjects`` (of a milestone or a part of the building), ``turning_points`` and ``story`` (a run in a page of
text, part by part), ``true_errors``, ``questions_in_words`` (which entries or which part a question asks for),
``web`` (the whole web of reasons), ``diff`` (where two runs part). What did not happen, and why:
``harvey.replay.why_not_again``.
"""
