"""The wire: heat balance, phase transformation, ageing, faults of the heater circuit, and wires to choose from.

May import config and smadrive.hysteresis. Registers, frames, sensors and clocks never belong here: time is an argument.
"""
