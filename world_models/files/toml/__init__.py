"""What does a TOML file say? Every error names file, line, what was expected and what was got.

In reading order:

* :mod:`.source`: TOML values that know their file and line.
* :mod:`.settings`: tables as typed dataclasses, with units in the keys.
* :mod:`.mission`: what missions of the simulator and of hardware have in common.
* :mod:`.camera_file`: intrinsics, lens and mounting of a camera.
* :mod:`.placements`: finishes, parts, and where things are put.
* :mod:`.locale_reader`: one locale; :mod:`.other_files`: what a world file includes, and copies from other worlds.
* :mod:`.world_reader`: a whole world.
"""
