"""How does a description become a building? From a world spec to faces and model lines (§3.4).

In reading order:

* :mod:`.specs`: a world as its file describes it, checked and in metres.
* :mod:`.rooms`: floor, ceiling, walls with openings, baseboards and mouldings.
* :mod:`.doors`: open doorways and closed doors.
* :mod:`.builder`: the world from its spec; what cannot be built is left out and reported.
"""
