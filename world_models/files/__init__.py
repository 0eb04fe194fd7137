"""Building models as files: read, compiled and imported."""
