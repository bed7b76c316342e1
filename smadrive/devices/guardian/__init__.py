"""The guardian: a process that outlives the driver and switches the heat source off, and the driver's client of it.

May import devices, modbus and the ground. Never here: control, the rig file, anything that slows its start.
"""
