"""What is the building like (§3.4)? Locales, what bounds them, what stands in them, and how one gets about.

In reading order:

* :mod:`.geometry`: faces with regions, landmarks, solids and outlines: shapes and colors.
* :mod:`.locales`: locales, what stands in them, doorways, links (elevators and stairs), and where locales lie.
* :mod:`.changes`: what is believed differently than the world file says: a door found shut, a thing gone.
* :mod:`.passages`: passage graphs at every level of the hierarchy, and routes.
* :mod:`.locale_frame`: all that is known of one locale: the unit in which a building is requested, given and changed.
* :mod:`.building`: the queries, one locale at a time; :mod:`.world`: the whole, as files and the simulator have it.
* :mod:`.model_errors`: how well the model knows where things are, and which errors are shared.
* :mod:`.checks`: faults of a world.
* :mod:`.plan_view`: a floor plan as a drawing.
"""
