"""A rig: the devices of a rig file, connected, with controller, supervisor and loop.

The only package that imports both columns, maths and devices, and the one that everything above it uses to reach them.
Control laws, protocols and files of results never belong here.
"""
