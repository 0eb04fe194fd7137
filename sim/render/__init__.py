"""The simulated camera: renderer, lens and sensor."""
