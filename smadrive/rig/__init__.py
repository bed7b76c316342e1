"""A rig: the devices of a rig file, connected, with controller, supervisor and loop.

Only this package imports both columns, maths and devices; the packages above it reach the devices through it.
Control laws, protocols and result files do not belong here.
"""
