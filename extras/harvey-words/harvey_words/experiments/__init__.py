"""Experiments with words: how well they are read, and how surely a robot that is told a way arrives."""
