"""How is a large world read one locale at a time? From one SQLite file that it is compiled to.

In reading order:

* :mod:`.schema`: the tables.
* :mod:`.serialization`: faces, landmarks and arrays as bytes.
* :mod:`.writer`: compiles a world.
* :mod:`.sqlite_locales`: reads locale data on demand.
"""
