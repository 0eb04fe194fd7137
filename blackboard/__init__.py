"""The mechanism: entries, changes, effects, knowledge sources, agenda, servo levels and journal.

Standard library only. It knows no robot and no pixel. One idea a file; read them in this order:
entry, change, effect, index, shelf, board, level, knowledge_source, activation, agenda, servoing, encoding, journal,
retention, scheduler, archive.
"""
