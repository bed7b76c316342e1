"""Simulated rigs for the demo, for tests, and for continuous integration without hardware.

It may import rig, everything below it, and firmware_sim. Code that a rig with hardware needs never belongs here.
"""
