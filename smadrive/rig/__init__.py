"""A rig: the devices of a rig file, connected, with controller, supervisor and loop.

Only this package imports both the models and controllers, and the devices. The packages above `rig` reach the devices
through `rig`.
Control laws, protocols and result files do not belong here.
"""
