"""Harvey in rooms by others: miniworld's textured rooms as a body's world, and floors with their plans."""

import harvey  # noqa: F401  # before numpy: it sets how numpy computes, and with that every decision
