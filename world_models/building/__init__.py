"""The building model (§3.4): locales, faces, regions, landmarks, passages."""
