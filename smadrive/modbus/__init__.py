"""Modbus as a client: requests, the protocol without I/O, the client, framings, transports and traces.

May import the ground (errors, clock, files) and pyserial; pymodbus only in framing/rtu.py.
Never here: registers' meanings, device profiles, control, maths.
"""
