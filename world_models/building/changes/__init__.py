"""What is believed otherwise than the world file says: pure functions on geometry and things.

In reading order:

* :mod:`.shut_doors`: a doorway found shut.
* :mod:`.removals`: a thing, a landmark or a face that is gone.
* :mod:`.extra_things`: something that stands there and the file lacks.
"""
