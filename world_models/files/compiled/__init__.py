"""Compiled worlds: one SQLite file, read one locale at a time."""
