"""Drivers: the metal that Harvey moves and sees with, each behind a small interface. They know no board."""
