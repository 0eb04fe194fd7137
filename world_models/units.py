"""Units of files and output; inside everything is in metres and radians."""

FOOT_M = 0.3048
"""One foot [m]."""

INCH_M = 0.0254
"""One inch [m]."""
