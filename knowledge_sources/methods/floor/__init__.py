"""Where is the floor free? One camera with known mounting, or range sensors, against the model of the building (§4).

In reading order: ``model_floor`` (which point of the floor each pixel shows, and where the model has floor),
``appearance`` (what the floor looks like), ``relief`` (what an earlier picture shows to stand up from it, or to lie on
it), ``standing_regions`` (regions that do not look like it, or stand up from it, and where they stand), ``see_floor``
(all of it for one picture), ``ranges`` (one reading of range sensors), ``seen_floor`` (all readings together, what of a
way they do not show, and from where that can be seen); what stands on it: ``found_things``, ``door_beside``,
``weigh_sight``, ``weigh_touch``, and ``revise_frame`` (what is known of the locale then).
"""
