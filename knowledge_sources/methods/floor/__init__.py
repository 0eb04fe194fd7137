"""Where is the floor free? One camera with known mounting, or range sensors, against the model of the building (§4).

In reading order: ``floor_grid`` (which point of the floor each pixel shows), ``model_floor`` (where the model has
floor), ``appearance`` (what the floor looks like), ``things`` (regions that do not look like it; where they stand),
``parallax`` (do they stand up from it), ``see_floor`` (all of it for one picture), ``ranges`` (one reading of range
sensors), ``seen_floor`` (all readings together, and what of a way they do not show), ``lookout`` (from where that can
be seen).
"""
