"""What is the building like (§3.4)? Locales, what bounds them, what stands in them, and how one gets about.

In reading order:

* :mod:`.geometry`: faces with regions, landmarks, solids and outlines: shapes and colors.
* :mod:`.locales`: locales, doorways, and links (elevators and stairs).
* :mod:`.things`: furniture and the like, and findings about a world.
* :mod:`.extents`: where locales lie, with all that they contain.
* :mod:`.locale_source`, :mod:`.memory_locales`: where locale data come from, and those in memory.
* :mod:`.passages`: passage graphs at every level of the hierarchy, and routes.
* :mod:`.changes`: what is believed otherwise than the world file says: a door found shut, a thing gone.
* :mod:`.building`: the queries, one locale at a time; :mod:`.world`: the whole, as files and the simulator have it.
* :mod:`.model_errors`: how well the model knows where things are, and which errors are shared.
* :mod:`.checks`: faults of a world.
* :mod:`.plan_view`: a floor plan as a drawing.
"""
