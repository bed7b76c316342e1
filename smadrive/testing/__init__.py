"""Doors to the simulated device: for the demo, for tests, for continuous integration without hardware."""
