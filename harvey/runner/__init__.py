"""A run: an agent at work through a body. It knows neither simulator nor hardware."""
