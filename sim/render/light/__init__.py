"""Light in the simulated building: lamps, daylight, reflections and the camera that adapts to them.

In reading order: ``lighting`` (the ``[light]`` table), ``lamps``, ``panes``, ``rays`` (visibility), ``light_map``
(the places where light is computed), ``irradiance`` (how much arrives there), ``sun_patches``, ``mirrored_camera``,
``lit_shading``, ``lit_renderer``, ``lights`` (from faces to a renderer), ``auto_exposure``.
"""
