"""A blackboard: entries, changes, effects, knowledge sources, agenda, levels, journal and history.

Standard library only. It knows no robot and no pixel. README.md has it on one screen. One idea a file; read them in
this order: entry, kinds, change, effect, entry_store, board, ladder, condition, knowledge_source, rule,
agenda, journal, retention, scheduler, decoding, history.
"""

from blackboard.agenda import Activation
from blackboard.board import Blackboard, StaleError, View
from blackboard.change import Change, Posted, Quiescence, Retracted, Revised, Watch
from blackboard.condition import Condition
from blackboard.decoding import Decoders, MisfitError, brief, decode, fields_of
from blackboard.effect import Effect, MissingEntryError, Post, Retract, Revise, to_say
from blackboard.entry import Entry, Ref
from blackboard.entry_store import Index
from blackboard.history import History
from blackboard.journal import Decision, NOT_FINITE, Sink, decision_line, decision_record, plain
from blackboard.kinds import Registry, Role, always, inference, is_request, kind_of, kinds_in, observation, request
from blackboard.knowledge_source import KnowledgeSource
from blackboard.ladder import Ladder, Level, highest
from blackboard.rule import rule
from blackboard.scheduler import Port, RAISED, Scheduler, registry_of

__version__ = "0.1.0"

__all__ = [
    "NOT_FINITE", "RAISED", "Activation", "Blackboard", "Change", "Condition", "Decision", "Decoders",
    "Effect", "Entry", "History", "Index", "KnowledgeSource", "Ladder", "Level", "MisfitError",
    "MissingEntryError", "Port", "Post", "Posted", "Quiescence", "Ref", "Registry", "Retract", "Retracted", "Revise",
    "Revised", "Role", "Scheduler", "Sink", "StaleError", "View", "Watch", "always", "brief",
    "decision_line", "decision_record", "decode", "fields_of", "highest", "inference", "is_request", "kind_of",
    "kinds_in", "observation", "plain", "registry_of", "request", "rule", "to_say",
]
