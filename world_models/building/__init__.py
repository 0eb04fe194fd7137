"""What is the building like (§3.4)? Locales, what bounds them, what stands in them, and how one gets about.

In reading order:

* :mod:`.locales`: locales, doorways, and links (elevators and stairs).
* :mod:`.regions`, :mod:`.faces`: planar patches with finishes, and their expected brightness.
* :mod:`.landmarks`: model lines with the surfaces on both sides, and corner points.
* :mod:`.things`: furniture and the like, and findings about a world.
* :mod:`.intervals`, :mod:`.outlines`: geometry on a line and on the floor.
* :mod:`.solids`: boxes, from which faces and model lines follow.
* :mod:`.scene`: model lines and surfaces in arrays.
* :mod:`.extents`: where locales lie, with all that they contain.
* :mod:`.locale_source`, :mod:`.memory_locales`: where locale data come from, and those in memory.
* :mod:`.passages`: passage graphs at every level of the hierarchy, and routes.
* :mod:`.changes`: what is believed otherwise than the world file says: a door found shut, a thing gone.
* :mod:`.world`: the world, which answers for all of these.
* :mod:`.checks`: faults of a world.
* :mod:`.plan_view`: a floor plan as a drawing.
"""
