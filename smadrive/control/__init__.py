"""From a displacement setpoint to a heater current: the loop and its controllers, pure `update(..., dt)`.

May import safety, wire, hysteresis and numerics. Devices, files and real clocks do not belong here.
"""
