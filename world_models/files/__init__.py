"""How does a building get into the robot? World files are read and compiled here, and nothing else parses.

In reading order:

* :mod:`.world_files`: load a world from TOML or a compiled file, compile one, compute its digest.
* :mod:`.toml`: TOML with file and line for every error: worlds, missions, cameras, settings.
* :mod:`.construction`: from a description to faces and model lines.
* :mod:`.packed`: compiled worlds: a table of packed locale frames in one SQLite file.
* :mod:`.first_world`: the text of a first world file to change.
"""
