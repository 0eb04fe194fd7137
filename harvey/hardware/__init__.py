"""A robot of metal: its body put together from a base and a camera, missions on it, and what is checked before."""
