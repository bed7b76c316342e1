"""A rig: the devices of a rig file, connected, with controller, supervisor and loop.

Only this package imports both columns, maths and devices; everything above it reaches them through this package.
Control laws, protocols and result files do not belong here.
"""
