"""The guardian, a process that outlives the driver and switches the heat source off, and its client in the driver.

This package may import `devices`, `modbus` and the modules below them. Control, rig files and everything that slows the
start of the guardian do not belong here.
"""
