"""State that outlives a process: the trip latch, the locks of lines, and the key of a device.

This package may import `profile`, the identity of a device, `files` and the URLs of `modbus.transports`. Requests to a
device do not belong here.
"""
