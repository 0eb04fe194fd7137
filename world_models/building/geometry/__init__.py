"""Which shapes and colors is a building made of (§3.4)? Pure geometry and appearance; nothing here knows of locales.

In reading order:

* :mod:`.outlines`: geometry on a line and on the floor.
* :mod:`.faces`: planar patches with finishes, and their expected brightness.
* :mod:`.landmarks`: model lines with the surfaces on both sides, and corner points.
* :mod:`.solids`: boxes, from which faces and model lines follow.
* :mod:`.scene`: model lines and surfaces in arrays.
"""
