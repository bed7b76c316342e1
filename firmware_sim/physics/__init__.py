"""The wire: heat balance, phase transformation, ageing, faults of the heater circuit; Flexinol and random wires.

May import config and smadrive.hysteresis. Registers, frames, sensors and clocks do not belong here.
"""
