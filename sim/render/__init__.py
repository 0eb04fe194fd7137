"""The simulated camera: renderer, lens and sensor. It shares no code with the robot's own camera model.

In reading order: ``mesh`` (the building as flat patches, and these on the image plane), ``rasterizer`` (which patch is
seen at each sample), ``pieces`` (the samples sorted by patch), ``textures`` (its colour),
``renderer`` (all of these: a pinhole picture), ``lighting`` (the ``[light]`` table), ``lights`` (lamps, and what draws
a building under them), ``optics`` (the lens), ``auto_exposure``, ``sensor`` (what hides a part of the view; blur,
noise, JPEG).
"""
