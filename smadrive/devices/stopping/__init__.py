"""The emergency stop between two programs: a driver that listens for it, and `smadrive off`, which requests it.

This package may import `errors` and the state of devices. Requests to a device do not belong here.
"""
