"""Buildings of other programs, in and out."""
