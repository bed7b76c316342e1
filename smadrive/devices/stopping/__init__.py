"""The emergency stop between two programs: a driver that listens for it, and `smadrive off`, which requests it.

May import the state of devices and the ground. Never here: a request to a device.
"""
