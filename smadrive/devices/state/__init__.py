"""State that outlives a process: the trip latch, the locks of lines, and the key of a device.

May import profiles, transports' URLs and files. Never here: a request to a device.
"""
