"""Why: explanations of a run from its journal, in sentences that name their entries.

In reading order: ``history`` and ``journal`` (entries by name), ``links`` (what rests on what), ``sentences``,
``facts`` and ``decisions`` (in words), ``model/`` (frames, and the world's file), ``story``, ``milestone``,
``questions`` (what is told), ``walk``, ``trace``, ``reach`` (the whole web), ``why_not``, ``ask``,
``why_not_answers`` (what did not happen).
"""
