"""A robot that is not there, as a network sees it."""
