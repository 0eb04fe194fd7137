"""Where is the floor free? One camera with known mounting, or range sensors, against the model of the building (§4).

In reading order: ``model_floor`` (which point of the floor each pixel shows, and where the model has floor),
``appearance`` (what the floor looks like), ``standing_regions`` (regions that do not look like it; where they stand,
and do they stand up from it), ``see_floor`` (all of it for one picture), ``ranges`` (one reading of range sensors),
``seen_floor`` (all readings together, what of a way they do not show, and from where that can be seen); what stands on
it: ``found_things``, ``weigh_sight``, ``weigh_touch``, and ``revise_frame`` (what is known of the locale then).
"""
