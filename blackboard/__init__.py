"""The mechanism: entries, changes, effects, knowledge sources, agenda, servo levels and journal.

Standard library only. It knows no robot and no pixel. One idea a file; read them in this order:
entry, kinds, change, effect, entry_store, board, level, condition, knowledge_source, agenda, servoing, journal,
retention, scheduler.
"""
