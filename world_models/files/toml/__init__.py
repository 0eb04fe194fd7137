"""What does a TOML file say? Every error names file, line, what was expected and what was got.

In reading order:

* :mod:`.line_numbers`, :mod:`.source`: TOML values that know their file and line, and the files that they name.
* :mod:`.settings`: tables as typed dataclasses, with units in the keys.
* :mod:`.mission`: what missions of the simulator and of hardware have in common.
* :mod:`.camera_file`: intrinsics, lens and mounting of a camera.
* :mod:`.placements`: finishes, parts, and where things are put.
* :mod:`.locale_reader`, :mod:`.subtrees`: one locale, and a part of one world in another.
* :mod:`.world_reader`: a whole world.
"""
