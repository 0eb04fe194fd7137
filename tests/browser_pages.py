"""What the tests in a browser share."""

from __future__ import annotations

TELEPHONE = {"width": 390, "height": 800}
"""Width and height of a telephone's screen [px]."""
