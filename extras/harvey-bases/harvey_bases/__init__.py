"""Drivers of two more bases, and their emulators, which share no code with them: ``p2os`` and ``create2``."""
