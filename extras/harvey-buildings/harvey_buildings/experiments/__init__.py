"""Experiments with buildings of other formats: ``harvey experiment imported-building``, ``rosmaps``."""
