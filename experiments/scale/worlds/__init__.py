"""Worlds of any size, and the processes that run a mission in them, for ``world-size``."""
