"""Which part of the building does a camera see (§3.4)?

In reading order:

* :mod:`.culling`: the locales in view through chains of doorways, each with a window of the image; what convex surfaces
  hide of segments and points (shadow volumes).
* :mod:`.lines_and_points`: visible model lines and landmark corners, from both.
"""
