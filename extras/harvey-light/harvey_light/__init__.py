"""Light in the simulated building: lamps, daylight and reflections, computed once for a building and drawn fast.

In reading order: ``hung_lamps``, ``light_map`` (the places where light is computed), ``rays`` (which patch a ray
meets), ``irradiance`` (how much light arrives), ``sun_patches``, ``lit_shading``, ``lit_renderer`` (with mirror
images), ``path_traced`` (the reference), ``baked`` (from faces to a renderer).
"""
