"""The model in explanations: ``frames`` (by which locale frames an act went, whence model lines come), ``world_file``
(from which file and line), ``element`` (the story of a landmark, door, thing or room)."""
