"""The fit of the heat balance to a recorded excitation, and the simulation of wire and thermocouple along a record.

May import what identification may import. The heat balance itself belongs to wire.
"""
