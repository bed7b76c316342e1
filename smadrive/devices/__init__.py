"""Devices of a rig: registers by name and in engineering units, heat sources, sensors, scan of a bus.

May import modbus and the ground. Never here: hysteresis, wire, control or any other maths, and no rig file.
"""
