"""Devices of a rig: registers by name and in engineering units, heat sources, sensors, the scan of a bus.

This package may import `modbus` and the modules below it. Hysteresis, wire, control, other maths and rig files do not
belong here.
"""
