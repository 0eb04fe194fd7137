"""A blackboard: entries, changes, effects, knowledge sources, agenda, levels, journal and history.

Standard library only. It knows no robot and no pixel. README.md has it on one screen. One idea a file; read them in
this order: entry, kinds, change, effect, entry_store, board, level, condition, knowledge_source, rule, agenda,
servoing, journal, retention, scheduler, decoding, history.
"""

from blackboard.board import Blackboard, StaleError, View
from blackboard.change import Change, Posted, Quiescence, Retracted, Revised, Watch
from blackboard.effect import Effect, MissingEntryError, Post, Retract, Revise
from blackboard.entry import Entry, Ref
from blackboard.entry_store import Index
from blackboard.history import History
from blackboard.journal import Decision, decision_line
from blackboard.kinds import inference, observation, request
from blackboard.knowledge_source import KnowledgeSource
from blackboard.level import Level
from blackboard.rule import rule
from blackboard.scheduler import Port, Scheduler
from blackboard.servoing import Discrepancy, Servoing

__all__ = [
    "Blackboard", "Change", "Decision", "Discrepancy", "Effect", "Entry", "History", "Index", "KnowledgeSource",
    "Level", "MissingEntryError", "Port", "Post", "Posted", "Quiescence", "Ref", "Retract", "Retracted", "Revise",
    "Revised", "Scheduler", "Servoing", "StaleError", "View", "Watch", "decision_line", "inference", "observation",
    "request", "rule",
]
