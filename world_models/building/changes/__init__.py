"""What is believed otherwise than the world file says: pure functions on the geometry of a locale.

In reading order:

* :mod:`.shut_doors`: a doorway found shut.
* :mod:`.removals`: a thing, a landmark or a face that is gone.
"""
