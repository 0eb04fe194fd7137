"""What the tests in a browser share."""

TELEPHONE = {"width": 390, "height": 800}
"""Width and height of a telephone's screen [px]."""
