"""The tuning session, in the driver: it handles requests of the pages between two ticks.

It may import rig, control, runs and the rest of tuning, except page/ and front/. Nothing here may wait or build a
model.
"""
