"""Supervision of a run: faults, trips, temperature and displacement bands, the way to zero current.

May import wire, hysteresis and measurement. Controllers and devices do not belong here.
"""
