"""Modbus as a client: requests, the protocol without I/O, the client, framings, transports and traces.

This package may import `errors`, `clock`, `files`, `display`, `posix`, pyserial and fastcrc; only framing/rtu.py
imports pymodbus. The meaning of registers, device profiles, control and maths do not belong here.
"""
