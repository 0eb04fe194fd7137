"""Pyglet draws without a screen from the first on: once another test has loaded its windows it no longer can."""

from contextlib import suppress

with suppress(ImportError):
    import pyglet

    pyglet.options["headless"] = True
