"""Made-up rooms, floors and missions for tests and experiments."""
