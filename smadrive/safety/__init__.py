"""Supervision of a run: faults, trips, bands of temperature, displacement and resistance, the way to zero current.

May import wire, hysteresis, numerics and measurement. Controllers and devices do not belong here.
"""
