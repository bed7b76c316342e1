"""From a displacement setpoint to a heater current: the loop and its controllers.

The `update` of a controller gets the time and the time step; no controller reads a clock. May import safety, wire,
hysteresis, numerics and files. Devices and real clocks do not belong here.
"""
